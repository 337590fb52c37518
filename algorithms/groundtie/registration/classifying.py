"""Classifiers of registering tools: what they tell to leave out is masked before matching."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

from ..errors import ParameterError
from ..features.classified import ClassifiedScene
from ..features.classifier import FeatureClassifier, read_classifier
from ..features.patch_statistics import FloatImage
from ..masks.choice import INPUT, REFERENCE
from ..progress import Progress
from ..rasters.pair import ImagePair
from ..rasters.reading import Window
from .masking import masked, scene_of


@dataclass(frozen=True)
class Classifying:
    """The classifiers for both images; None: all of an image takes part."""

    reference: Path | None
    input: Path | None

    def apply(self, pair: ImagePair, stack: ExitStack, progress: Progress) -> ImagePair:
        """Return the pair with what classifiers tell to leave out masked; as `MaskRequest.apply`.

        Raises
        ------
        ParameterError
            A file is no classifier, or one for an image of other bands.
        """
        for name, path in ((REFERENCE, self.reference), (INPUT, self.input)):
            if path is not None:
                pair = _classified(pair, name, path, stack, progress)
        return pair


def _classified(
    pair: ImagePair, name: str, path: Path, stack: ExitStack, progress: Progress
) -> ImagePair:
    classifier = read_classifier(path)
    scene = scene_of(pair, name)
    _require_bands(path, classifier, scene.like.path, len(scene.like.image_bands))

    def bands(window: Window) -> FloatImage:
        piece = scene.grid.window(*window)
        if name == REFERENCE:
            return pair.reference_bands(piece)
        return pair.input_bands(piece, pair.claimed_px)

    classified = ClassifiedScene(scene, bands, classifier)
    pair, share = masked(pair, name, scene, classified.select, stack, progress)
    progress.update(1.0, f"{path.name} leaves out {1 - share:.0%} of {Path(scene.like.path).name}")
    return pair


def _require_bands(path: Path, classifier: FeatureClassifier, image: str, count: int) -> None:
    """Raise `ParameterError` if a classifier looks at other bands than an image has."""
    if classifier.bands not in (0, count):
        raise ParameterError(
            f"{path} was trained on an image of {classifier.bands} bands; {image} has {count}"
        )
