"""Masks by grey value: strong scatterers (walls, double bounces) are masked ([Suri2010] 4.5).

The thresholds are percentiles of the block-averaged image, which has less speckle; they are applied
to the blocks at full resolution.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..errors import ParameterError, RasterContentError
from ..progress import SILENT, Progress
from ..rasters.reading import Mask, Window
from .scene import Scene, Selection, block_means

# Side of the blocks whose means are compared, in pixels ([Suri2010] 4.5).
BLOCK_PX = 4

# Masked by default: 20–30 % gave the best results in [Suri2010].
HIGH_PERCENT = 20.0

# Number of means that give the percentiles. Scenes of more than 8000 × 8000 px are sampled, which
# bounds the memory.
_MEANS = 4_000_000


@dataclass(frozen=True)
class ThresholdMask:
    """The blocks of a scene whose mean grey values are `low` to `high`.

    Pixels up to `grow_px` beside other blocks, along columns and rows, take no part, either.
    """

    scene: Scene
    low: float
    high: float
    grow_px: tuple[int, int]

    @classmethod
    def of(
        cls,
        scene: Scene,
        high_percent: float,
        low_percent: float = 0.0,
        grow_m: float = 0.0,
        progress: Progress = SILENT,
    ) -> ThresholdMask:
        """Return the mask of a scene without given percentages of its brightest and darkest blocks.

        What lies within `grow_m` of these takes no part, either.

        Raises
        ------
        ParameterError
            Nothing is left between the two percentages.
        RasterContentError
            No pixel of the scene is valid.
        """
        if high_percent + low_percent >= 100:
            raise ParameterError(
                f"without the brightest {high_percent:g} % and the darkest {low_percent:g} %, "
                "nothing is left"
            )
        sample = scene.sample(BLOCK_PX, _MEANS, progress)
        if sample.size == 0:
            raise RasterContentError(f"{scene.like.path} has no valid pixels to make a mask of")
        low, high = np.percentile(sample, [low_percent, 100 - high_percent])
        width_m, height_m = scene.grid.pixel_sides_m
        return cls(
            scene,
            float(low) if low_percent > 0 else -np.inf,
            float(high) if high_percent > 0 else np.inf,
            (round(grow_m / width_m), round(grow_m / height_m)),
        )

    def select(self, window: Window) -> Selection:
        """Return which pixels of a window take part."""
        # Whole blocks, and their surroundings into which the mask grows.
        around = window.widened(max(self.grow_px)).aligned(BLOCK_PX)
        patch = self.scene.read(around)
        means = block_means(patch, BLOCK_PX)
        out = means.valid & ((means.values > self.high) | (means.values < self.low))
        inside = window.slices_in(around)
        full = np.repeat(np.repeat(out, BLOCK_PX, axis=0), BLOCK_PX, axis=1)
        valid = patch.valid[inside]
        return Selection(valid & ~grown(full, ellipse(*self.grow_px))[inside], valid)


def grown(mask: Mask, around: NDArray[np.uint8]) -> Mask:
    """Return a mask extended by what lies around each of its pixels: a `disc` or `ellipse`."""
    if around.size == 1:
        return mask
    return np.asarray(cv2.dilate(mask.astype(np.uint8), around) > 0)


def disc(radius_px: int) -> NDArray[np.uint8]:
    """Return the pixels within a distance of the centre, shape (2 r + 1, 2 r + 1), as 0 and 1."""
    return ellipse(radius_px, radius_px)


def ellipse(cols: int, rows: int) -> NDArray[np.uint8]:
    """Return the pixels of an ellipse with semi-axes of so many columns and rows, as 0 and 1.

    It is what lies within a distance on the ground if pixels are not square there.
    """
    x, y = (np.arange(-reach, reach + 1) / (reach + 0.5) for reach in (cols, rows))
    return np.asarray(np.hypot.outer(y, x) <= 1, np.uint8)
