"""What of an image a classifier lets take part, decided at every so many of its pixels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from ..masks.scene import Scene, Selection
from ..rasters.grid import mesh
from ..rasters.reading import FloatImage, Mask, Window
from .classifier import FeatureClassifier
from .patch_statistics import NO_BANDS, PATCH_PX

# So many pixels a side are decided together: few of those that their patches see.
_CELL_PX = 8

_MARGIN_PX = PATCH_PX // 2

# A patch is left out if a quarter of it is to be, which it is so far beside: what is masked is
# drawn back by this.
_BACK_PX = PATCH_PX // 4


@dataclass(frozen=True)
class ClassifiedScene:
    """A scene, and the classifier that decides of each cell of its grid whether it takes part.

    Parameters
    ----------
    scene
        The image.
    bands
        Returns all of its bands in a window of the grid, shape (bands, h, w).
    classifier
        Is asked what the patches around the cells' middles are.
    """

    scene: Scene
    bands: Callable[[Window], FloatImage]
    classifier: FeatureClassifier

    def select(self, window: Window) -> Selection:
        """Return which pixels of a window take part, the same whatever the window."""
        around = window.widened(_BACK_PX)
        kept, valid = self._kept(around)
        # Nothing is drawn back from where the image ends.
        masked = (~(kept & valid)).astype(np.uint8)
        core = cv2.erode(masked, np.ones((2 * _BACK_PX + 1,) * 2, np.uint8))
        inside = window.slices_in(around)
        return Selection((core == 0)[inside] & valid[inside], valid[inside])

    def _kept(self, window: Window) -> tuple[Mask, Mask]:
        """Return which pixels' surroundings the classifier keeps, and which are valid."""
        cells = window.aligned(_CELL_PX)
        across, down = cells.width // _CELL_PX, cells.height // _CELL_PX
        around = cells.widened(_MARGIN_PX)
        patch = self.scene.read(around)
        bands = self.bands(around) if self.classifier.bands else NO_BANDS
        middles = _MARGIN_PX + _CELL_PX * (mesh(np.arange(across), np.arange(down)) + 0.5)
        kept = self.classifier.keep(patch, middles, bands).reshape(down, across)
        pixels = kept.repeat(_CELL_PX, axis=0).repeat(_CELL_PX, axis=1)
        return pixels[window.slices_in(cells)], patch.valid[window.slices_in(around)]
