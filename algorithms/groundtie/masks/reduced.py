"""A whole radar image in memory, reduced if it is large, and masks that are found in it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..errors import RasterContentError
from ..progress import Progress
from ..rasters.patch import Patch
from ..rasters.reading import FloatImage, Mask, Window
from ..rasters.windows import cut
from ..speckle.filters import SpeckleFilter
from ..speckle.statistics import estimate_looks
from .radar import power
from .scene import Scene, Selection

# Scenes with more pixels are reduced.
_MOST_PIXELS = 24_000_000

# Window of the speckle filter.
_FILTER_PX = 7


@dataclass(frozen=True)
class BlockMask:
    """The blocks of a scene that take part.

    Parameters
    ----------
    scene
        The image.
    factor
        Side of the blocks, in pixels of the scene.
    blocks
        Shape (h, w).
    """

    scene: Scene
    factor: int
    blocks: Mask

    def cut(self, window: Window) -> Mask:
        """Return the pixels of a window that take part, valid or not; none beyond the scene."""
        around = window.aligned(self.factor)
        blocks = cut(self.blocks, Window(*(n // self.factor for n in around)))
        pixels = blocks.repeat(self.factor, axis=0).repeat(self.factor, axis=1)
        return pixels[window.slices_in(around)]

    def select(self, window: Window) -> Selection:
        """Return which pixels of a window take part."""
        valid = self.scene.read(window).valid
        return Selection(self.cut(window) & valid, valid)


def reduction(scene: Scene) -> int:
    """Return the side of the blocks, in pixels, whose means of a scene fit into memory."""
    return math.ceil(math.sqrt(scene.grid.width * scene.grid.height / _MOST_PIXELS))


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
    def of(cls, scene: Scene, progress: Progress) -> ReducedScene:
        """Read a scene.

        Raises
        ------
        RasterContentError
            No pixel of the scene is valid.
        """
        factor = reduction(scene)
        patch = scene.reduced(factor, progress)
        if not patch.valid.any():
            raise RasterContentError(f"{scene.like.path} has no valid pixels to make a mask of")
        return cls(scene, factor, patch)

    @property
    def pixel_m(self) -> float:
        """Side of a block."""
        return self.scene.grid.pixel_size_m * self.factor

    def without_speckle(self) -> tuple[FloatImage, float]:
        """Return the filtered power in decibels, shape (h, w), and the equivalent number of looks.

        The looks are those of the means.
        """
        intensity, valid = power(self.patch), self.patch.valid
        looks = estimate_looks(intensity, valid)
        filtered = SpeckleFilter("enhanced-frost", _FILTER_PX, looks)(intensity, valid)
        level_db = 10 * np.log10(np.maximum(filtered, np.float32(1e-6)))
        return np.asarray(level_db, np.float32), looks

    def mask(self, blocks: Mask) -> BlockMask:
        """Return a selection of blocks, shape (h, w), as a mask of the scene."""
        return BlockMask(self.scene, self.factor, blocks)
