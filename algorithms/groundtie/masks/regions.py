"""Masks by regions: what is flat and homogeneous, as roads, waters and fields ([Suri2010] 5.3.2).

Speckle is filtered, regions grow from homogeneous seeds, their shapes separate ground from roofs,
and long ones are thinned to their skeleton and broadened by a window again.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..errors import RasterContentError
from ..progress import SILENT, Progress
from ..rasters.patch import Patch
from ..rasters.reading import Mask, Window
from ..speckle.filters import SpeckleFilter
from ..speckle.statistics import LOOKS_WINDOW_PX, estimate_looks, local_statistics
from .cast_shadow import out_of_shadow
from .growing import Region, Shape, grow_regions
from .radar import power
from .range_order import open_ground
from .scene import Scene, Selection
from .skeleton import pruned, skeleton
from .threshold import BLOCK_PX, disc, grown

# Window by which skeletons are broadened, 5–19 m in [Suri2010], and percentage of the brightest
# pixels inside that take no part after all.
WIDTH_M = 11.0
HIGH_PERCENT = 10.0

# Larger scenes are reduced to larger pixels.
_MOST_PIXELS = 24_000_000

# Window of the speckle filter.
_FILTER_PX = 7

# Seeds vary little more than speckle alone, in the windows in which looks are estimated; a region
# takes in pixels that differ from its seed by so much.
_SEED_EXCESS = 1.3
_TOLERANCE_DB = 2.5

# Regions: long ones from this length and elongation on, others from this area on.
_SMALLEST_M2 = 200.0
_LONG_M, _ELONGATION = 50.0, 3.0
_LARGE_M2 = 1500.0

# Ground lies in the lower part of the histogram ([Suri2010] 5.3.2), roofs and walls in the upper.
_BRIGHTEST_PERCENT = 60.0

# Regions as dark as the darkest of the scene are radar shadow, unless as large as a lake.
_DARKEST_PERCENT = 5.0
_SHADOW_DB = 1.5
_LAKE_M2 = 20_000.0

# Borders are made even by this before they are thinned.
_EVEN_M = 2.0

# The surroundings up to this distance take part, too: banks and kerbs are on the ground, and the
# only structure of a homogeneous area. Gaps up to twice as wide close.
_BORDER_M = 3.0


@dataclass(frozen=True)
class GroundRegions:
    """The ground, on a grid of pixels `factor` times the scene's.

    Parameters
    ----------
    scene
        The image.
    factor
        Side of the pixels of the masks, in pixels of the scene.
    regions, skeleton, part
        Homogeneous regions that were kept; the skeleton of the long ones; the mask: the broadened
        skeleton and the large regions that are wider, or a dense town's ground. Shape (h, w).
    low, high
        Grey values below and above which nothing takes part, of means over 4 × 4 pixels of the
        scene.
    skeleton_m
        Length of the skeleton.
    extent_m2
        Area of the scene's valid pixels.
    """

    scene: Scene
    factor: int
    regions: Mask
    skeleton: Mask
    part: Mask
    skeleton_m: float
    low: float
    high: float
    extent_m2: float

    @property
    def share(self) -> float:
        """Share of the scene's valid area that takes part."""
        pixel_m = self.scene.grid.pixel_size_m * self.factor
        return float(np.count_nonzero(self.part)) * pixel_m**2 / self.extent_m2

    def select(self, window: Window) -> Selection:
        """Return which pixels of a window take part."""
        return self.cut(self.part, window, (self.low, self.high))

    def cut(
        self, mask: Mask, window: Window, limits: tuple[float, float] = (-np.inf, np.inf)
    ) -> Selection:
        """Return the part of one of the masks that lies in a window, between two grey values."""
        patch = self.scene.read(window)
        rows = np.arange(window.row, window.row + window.height) // self.factor
        cols = np.arange(window.col, window.col + window.width) // self.factor
        inside = (rows >= 0) & (rows < mask.shape[0]), (cols >= 0) & (cols < mask.shape[1])
        chosen = mask[np.ix_(rows.clip(0, mask.shape[0] - 1), cols.clip(0, mask.shape[1] - 1))]
        chosen = chosen & inside[0][:, None] & inside[1] & patch.valid
        if np.isfinite(limits).any():
            level = _smooth(patch)
            chosen &= (level >= limits[0]) & (level <= limits[1])
        return Selection(chosen, patch.valid)


def find_ground(
    scene: Scene,
    width_m: float = WIDTH_M,
    high_percent: float = HIGH_PERCENT,
    progress: Progress = SILENT,
    shadow_azimuth_deg: float | None = None,
    low_percent: float = 0.0,
    is_town: bool = False,
) -> GroundRegions:
    """Find the ground in a radar image.

    Parameters
    ----------
    scene
        Grey values are amplitudes.
    width_m
        Window by which skeletons are broadened; 5–19 m in [Suri2010].
    high_percent
        Percentage of the brightest pixels inside that take no part after all.
    progress
        Receives every step.
    shadow_azimuth_deg
        Direction in which cast shadows of the other image fall, clockwise from the top: ground
        that they may reach takes no part. None: there are none.
    low_percent
        Percentage of the darkest pixels inside that take no part after all.
    is_town
        Whether the scene is a dense town, whose ground lies apart from layover and radar shadow:
        that alone is the mask, and no other parameter counts for it.

    Raises
    ------
    RasterContentError
        No pixel of the scene is valid.
    """
    factor = int(np.ceil(np.sqrt(scene.grid.width * scene.grid.height / _MOST_PIXELS)))
    patch = scene.reduced(factor, progress.part(0.0, 0.3))
    if not patch.valid.any():
        raise RasterContentError(f"{scene.like.path} has no valid pixels to make a mask of")
    pixel_m = scene.grid.pixel_size_m * factor
    growing = progress.part(0.3, 0.8)
    level, longs, wide = _kept_regions(patch, pixel_m, width_m, growing)
    even = _without_holes(longs, round(_SMALLEST_M2 / pixel_m**2), max(round(_EVEN_M / pixel_m), 1))
    lines = pruned(skeleton(even), round(width_m / pixel_m / 2))
    progress.update(0.9)
    low, high = -np.inf, np.inf
    if is_town:
        part = open_ground(level, patch.valid, pixel_m)
    else:
        part = _broadened(lines, wide, width_m, pixel_m) & patch.valid
        if shadow_azimuth_deg is not None:
            part = out_of_shadow(part, shadow_azimuth_deg, pixel_m)
        inside = _smooth(patch)[part]
        if inside.size:
            high = float(np.percentile(inside, 100 - high_percent))
            low = float(np.percentile(inside, low_percent)) if low_percent > 0 else low
    return GroundRegions(
        scene,
        factor,
        longs | wide,
        lines,
        part,
        _length_px(lines) * pixel_m,
        low,
        high,
        np.count_nonzero(patch.valid) * pixel_m**2,
    )


def _broadened(lines: Mask, wide: Mask, width_m: float, pixel_m: float) -> Mask:
    """Return the skeleton with its window, the wide regions, and the border of both."""
    broad = grown(lines, max(round(width_m / pixel_m / 2), 1))
    return grown(broad | wide, max(round(_BORDER_M / pixel_m), 1))


def _kept_regions(
    patch: Patch, pixel_m: float, width_m: float, progress: Progress
) -> tuple[NDArray[np.float32], Mask, Mask]:
    """Return the level in decibels, long regions on the ground, and large and wide ones."""
    intensity = power(patch)
    looks = estimate_looks(intensity, patch.valid)
    variation2 = local_statistics(intensity, patch.valid, LOOKS_WINDOW_PX).variation2
    level = _decibels(SpeckleFilter("enhanced-frost", _FILTER_PX, looks)(intensity, patch.valid))
    brightest = np.percentile(level[patch.valid], _BRIGHTEST_PERCENT)
    progress.update(0.5)
    smallest = max(int(_SMALLEST_M2 / pixel_m**2), 1)
    found = grow_regions(
        level, variation2, patch.valid, _SEED_EXCESS / looks, _TOLERANCE_DB, smallest
    )
    regions = [region for region in found if region.level_db <= brightest]
    shadow_db = _darkest_db(regions) + _SHADOW_DB
    longs, wide = np.zeros(level.shape, bool), np.zeros(level.shape, bool)
    for region in regions:
        shape = Shape.of(region.mask)
        area_m2 = shape.area * pixel_m**2
        if region.level_db < shadow_db and area_m2 < _LAKE_M2:
            continue
        if shape.length * pixel_m >= _LONG_M and shape.elongation >= _ELONGATION:
            _add(longs, region)
        if area_m2 >= _LARGE_M2 and shape.width * pixel_m > width_m:
            _add(wide, region)
    return level, longs, wide


def _darkest_db(regions: list[Region]) -> float:
    """Return the level below which a few percent of the regions' area lie."""
    if not regions:
        return -np.inf
    level = np.array([region.level_db for region in regions])
    area = np.array([np.count_nonzero(region.mask) for region in regions])
    order = level.argsort()
    below = np.cumsum(area[order]) / area.sum()
    return float(level[order][np.searchsorted(below, _DARKEST_PERCENT / 100)])


def _without_holes(mask: Mask, smallest_px: int, radius_px: int) -> Mask:
    """Return a mask with even borders and without holes that are smaller than some pixels."""
    even = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_CLOSE, disc(radius_px))
    even = cv2.morphologyEx(even, cv2.MORPH_OPEN, disc(radius_px))
    _, labels, stats, _ = cv2.connectedComponentsWithStats(1 - even, connectivity=4)
    small = stats[:, cv2.CC_STAT_AREA] < smallest_px
    small[0] = False  # the mask itself
    return np.asarray((even > 0) | small[labels])


def _add(mask: Mask, region: Region) -> None:
    box = region.box
    mask[box.row :, box.col :][: box.height, : box.width] |= region.mask


def _decibels(intensity: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.asarray(10 * np.log10(np.maximum(intensity, np.float32(1e-6))), np.float32)


def _smooth(patch: Patch) -> NDArray[np.float32]:
    """Return the mean over as many pixels around each as in a block; invalid ones count as 0."""
    known = np.where(patch.valid, patch.values, np.float32(0))
    return np.asarray(cv2.blur(known, (BLOCK_PX, BLOCK_PX)))


def _length_px(lines: Mask) -> float:
    """Return the length of lines one pixel wide: steps along rows and columns, and diagonals."""
    straight = np.count_nonzero(lines[1:] & lines[:-1]) + np.count_nonzero(
        lines[:, 1:] & lines[:, :-1]
    )
    down = lines[1:, 1:] & lines[:-1, :-1] & ~lines[1:, :-1] & ~lines[:-1, 1:]
    up = lines[:-1, 1:] & lines[1:, :-1] & ~lines[1:, 1:] & ~lines[:-1, :-1]
    return float(straight + np.sqrt(2) * (np.count_nonzero(down) + np.count_nonzero(up)))
