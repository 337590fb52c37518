"""What lies before and behind a region as the radar looks: of ground and of roofs, the opposite.

Along the radar's range direction an elevated object shows its bright layover first and its shadow
last. So a roof has layover before it and shadow behind it; ground between buildings has the shadow
of the nearer one before it and the layover of the farther one behind it.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..rasters.patch import Patch
from ..rasters.reading import Mask, Window
from .cast_shadow import shadow_azimuth_deg
from .growing import Region

# Dark lies behind bright at all distances up to a building's layover and shadow together.
_APART_M = 40.0
_OUTER_PERCENT = 25.0

# What lies within this distance from a region is looked at, and it is bright if among so many of
# the brightest of the scene.
_REACH_M = 12.0
_BRIGHT_PERCENT = 20.0

# Holes of a region up to so many pixels wide are speckle.
_HOLE_PX = 5


@dataclass(frozen=True)
class RangeOrder:
    """Shadow and layover of a radar image, and where it looks.

    Parameters
    ----------
    dark, bright
        What may be radar shadow, and layover, with a rim of r pixels; shape (h + 2 r, w + 2 r).
    behind
        Window that holds a region's centre and what lies behind it, shape (2 r + 1, 2 r + 1).
    """

    dark: Mask
    bright: Mask
    behind: NDArray[np.uint8]

    @classmethod
    def of(
        cls, level_db: NDArray[np.float32], valid: Mask, shadow_db: float, pixel_m: float
    ) -> RangeOrder:
        """Return the order in a radar image, whose look direction is inferred from itself.

        Parameters
        ----------
        level_db
            Smoothed image in decibels, shape (h, w).
        valid
            Which of its pixels are valid, same shape.
        shadow_db
            Level of the brightest radar shadow.
        pixel_m
            Size of a pixel.
        """
        apart_px = max(round(_APART_M / pixel_m), 3)
        azimuth_deg = shadow_azimuth_deg(Patch(level_db, valid), _OUTER_PERCENT, apart_px)
        brightest = np.percentile(level_db[valid], 100 - _BRIGHT_PERCENT)
        reach = max(round(_REACH_M / pixel_m), 1)
        along, steps = np.deg2rad(azimuth_deg), np.arange(reach + 1)
        cols, rows = (np.rint(f * steps).astype(int) for f in (np.sin(along), -np.cos(along)))
        behind: NDArray[np.uint8] = np.zeros((2 * reach + 1,) * 2, np.uint8)
        behind[reach + rows, reach + cols] = 1
        dark, bright = (
            np.pad(mask & valid, reach) for mask in (level_db < shadow_db, level_db > brightest)
        )
        return cls(dark, bright, behind)

    def evidence_of_ground(self, region: Region) -> float:
        """Return by how much a region looks like ground: −2, a roof, to 2, ground.

        Shares of shadow before and layover behind it speak for ground; shadow behind and layover
        before, for a roof.
        """
        reach, box = len(self.behind) // 2, region.box
        mask = np.pad(region.mask.astype(np.uint8), reach)
        whole = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, np.ones((_HOLE_PX, _HOLE_PX), np.uint8))
        # A pixel lies behind the region if the window finds it on the other side of the pixel.
        behind, before = (
            (cv2.dilate(whole, window) > 0) & (whole == 0)
            for window in (np.ascontiguousarray(self.behind[::-1, ::-1]), self.behind)
        )
        around = Window(box.col, box.row, box.width + 2 * reach, box.height + 2 * reach).slices
        dark, bright = self.dark[around], self.bright[around]
        before, behind = before & ~behind, behind & ~before
        return (
            _share(dark, before)
            - _share(dark, behind)
            + _share(bright, behind)
            - _share(bright, before)
        )


def _share(of: Mask, side: Mask) -> float:
    return float(of[side].mean()) if side.any() else 0.0
