"""What of an image a classifier lets take part, told on a lattice of its pixels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..masks.scene import Scene, Selection
from ..rasters.reading import Window
from .classifier import FeatureClassifier
from .patch_statistics import NO_BANDS, PATCH_PX, FloatImage

# So many pixels a side are told together: few of those that their patches see.
_CELL_PX = 8

_MARGIN_PX = PATCH_PX // 2


@dataclass(frozen=True)
class ClassifiedScene:
    """A scene, and the classifier that tells of each cell of its grid whether it takes part.

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
        col, row = (at - at % _CELL_PX for at in window[:2])
        across, down = (
            -(-(at + size - first) // _CELL_PX)
            for at, size, first in zip(window[:2], window[2:], (col, row), strict=True)
        )
        around = Window(
            col - _MARGIN_PX,
            row - _MARGIN_PX,
            across * _CELL_PX + 2 * _MARGIN_PX,
            down * _CELL_PX + 2 * _MARGIN_PX,
        )
        patch = self.scene.read(around)
        bands = self.bands(around) if self.classifier.bands else NO_BANDS
        cols, rows = np.meshgrid(np.arange(across), np.arange(down))
        middles = _MARGIN_PX + _CELL_PX * np.array([cols.ravel() + 0.5, rows.ravel() + 0.5]).T
        kept = self.classifier.keep(patch, middles, bands).reshape(down, across)
        pixels = kept.repeat(_CELL_PX, axis=0).repeat(_CELL_PX, axis=1)
        inside = slice(window.row - row, None), slice(window.col - col, None)
        part = pixels[inside][: window.height, : window.width]
        shown = patch.valid[_MARGIN_PX:, _MARGIN_PX:][inside][: window.height, : window.width]
        return Selection(part & shown, shown)
