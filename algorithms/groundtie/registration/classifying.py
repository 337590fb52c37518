"""Classifiers as masks: what a classifier leaves out of an image takes no part."""

from __future__ import annotations

from pathlib import Path

from ..errors import ParameterError
from ..features.classified import ClassifiedScene
from ..features.classifier import read_classifier
from ..features.patch_statistics import FloatImage
from ..masks.choice import REFERENCE
from ..masks.scene import Scene
from ..rasters.pair import ImagePair
from ..rasters.reading import Window


def read_scene_classifier(pair: ImagePair, name: str, scene: Scene, path: Path) -> ClassifiedScene:
    """Return a classifier applied to one image of a pair.

    Parameters
    ----------
    pair
        The images.
    name
        "reference" or "input".
    scene
        That image on the matching lattice.
    path
        A file that train_feature_classifier has written.

    Raises
    ------
    ParameterError
        The file is no classifier, or one for an image of other bands.
    """
    classifier = read_classifier(path)
    image, count = scene.like.path, len(scene.like.image_bands)
    if classifier.bands not in (0, count):
        raise ParameterError(
            f"{path} was trained on an image of {classifier.bands} bands; {image} has {count}"
        )

    def bands(window: Window) -> FloatImage:
        piece = scene.grid.window(*window)
        if name == REFERENCE:
            return pair.reference_bands(piece)
        return pair.input_bands(piece, pair.nominal_px)

    return ClassifiedScene(scene, bands, classifier)
