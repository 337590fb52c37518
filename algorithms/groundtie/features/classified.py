"""The part of an image that a classifier keeps, decided on a coarser grid of cells."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from ..masks.scene import Scene, Selection
from ..rasters.grid import mesh
from ..rasters.reading import FloatImage, Mask, Window
from .classifier import FeatureClassifier
from .hog import PATCH_PX
from .patch_statistics import NO_BANDS, REACH_PX

# Side of the cells whose pixels are decided together; it is small against the side of a patch.
_CELL_PX = 8

# A patch is left out if a quarter of it is to be, that is, up to this distance beside content to
# be left out. The masked area is therefore shrunk by this.
_BACK_PX = PATCH_PX // 4


@dataclass(frozen=True)
class ClassifiedScene:
    """A scene, and the classifier that decides for each cell of its grid whether it takes part.

    Parameters
    ----------
    scene
        The image.
    bands
        Returns all bands in a window of the grid, shape (bands, h, w).
    classifier
        Decides on the patches around the cells' centres.
    """

    scene: Scene
    bands: Callable[[Window], FloatImage]
    classifier: FeatureClassifier

    def select(self, window: Window) -> Selection:
        """Return which pixels of a window take part, independent of the window's place and size."""
        around = window.widened(_BACK_PX)
        kept, valid = self._kept(around)
        # The mask is not shrunk at the image's border.
        masked = (~(kept & valid)).astype(np.uint8)
        core = cv2.erode(masked, np.ones((2 * _BACK_PX + 1,) * 2, np.uint8))
        inside = window.slices_in(around)
        return Selection((core == 0)[inside] & valid[inside], valid[inside])

    def _kept(self, window: Window) -> tuple[Mask, Mask]:
        """Return the pixels whose surroundings the classifier keeps, and the valid pixels."""
        cells = window.aligned(_CELL_PX)
        across, down = cells.width // _CELL_PX, cells.height // _CELL_PX
        around = cells.widened(REACH_PX)
        patch = self.scene.read(around)
        bands = self.bands(around) if self.classifier.bands else NO_BANDS
        middles = REACH_PX + _CELL_PX * (mesh(np.arange(across), np.arange(down)) + 0.5)
        kept = self.classifier.keep(patch, middles, bands).reshape(down, across)
        pixels = kept.repeat(_CELL_PX, axis=0).repeat(_CELL_PX, axis=1)
        return pixels[window.slices_in(cells)], patch.valid[window.slices_in(around)]
