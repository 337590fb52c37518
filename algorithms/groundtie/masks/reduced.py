"""A whole radar image at once, reduced where it is large, and masks found in it."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..errors import RasterContentError
from ..progress import SILENT, Progress
from ..rasters.patch import Patch
from ..rasters.reading import FloatImage, Mask, Window
from ..speckle.filters import SpeckleFilter
from ..speckle.statistics import estimate_looks
from .radar import power
from .scene import Scene, Selection

# Larger scenes are reduced to larger pixels.
_MOST_PIXELS = 24_000_000

# Window of the speckle filter.
_FILTER_PX = 7


@dataclass(frozen=True)
class ReducedScene:
    """A radar image as means over blocks of `factor` × `factor` pixels.

    Parameters
    ----------
    scene
        The image. Grey values are amplitudes.
    factor
        Side of the blocks, in pixels of the scene.
    patch
        The means, shape (h, w).
    """

    scene: Scene
    factor: int
    patch: Patch

    @classmethod
    def of(cls, scene: Scene, progress: Progress = SILENT) -> ReducedScene:
        """Read a scene.

        Raises
        ------
        RasterContentError
            No pixel of the scene is valid.
        """
        factor = int(np.ceil(np.sqrt(scene.grid.width * scene.grid.height / _MOST_PIXELS)))
        patch = scene.reduced(factor, progress)
        if not patch.valid.any():
            raise RasterContentError(f"{scene.like.path} has no valid pixels to make a mask of")
        return cls(scene, factor, patch)

    @property
    def pixel_m(self) -> float:
        """Side of a block."""
        return self.scene.grid.pixel_size_m * self.factor

    @cached_property
    def looks(self) -> float:
        """Equivalent number of looks of the means."""
        return estimate_looks(power(self.patch), self.patch.valid)

    @cached_property
    def level_db(self) -> FloatImage:
        """Power without its speckle, in decibels, shape (h, w)."""
        speckle_filter = SpeckleFilter("enhanced-frost", _FILTER_PX, self.looks)
        filtered = speckle_filter(power(self.patch), self.patch.valid)
        return np.asarray(10 * np.log10(np.maximum(filtered, np.float32(1e-6))), np.float32)

    def select(self, mask: Mask, window: Window) -> Selection:
        """Return the part of a mask of the blocks, shape (h, w), that lies in a window."""
        valid = self.scene.read(window).valid
        rows = np.arange(window.row, window.row + window.height) // self.factor
        cols = np.arange(window.col, window.col + window.width) // self.factor
        inside = (rows >= 0) & (rows < mask.shape[0]), (cols >= 0) & (cols < mask.shape[1])
        chosen = mask[np.ix_(rows.clip(0, mask.shape[0] - 1), cols.clip(0, mask.shape[1] - 1))]
        return Selection(chosen & inside[0][:, None] & inside[1] & valid, valid)
