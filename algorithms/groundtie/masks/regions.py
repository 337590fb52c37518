"""Masks by regions: flat, homogeneous areas such as roads, waters and fields ([Suri2010] 5.3.2).

Speckle is filtered, regions grow from homogeneous seeds, and their shapes separate ground from
roofs. Long regions are thinned to their skeleton and broadened again by a window.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..progress import SILENT, Progress
from ..rasters.patch import Patch
from ..rasters.reading import Mask, Window
from ..speckle.statistics import HOMOGENEOUS_EXCESS, LOOKS_WINDOW_PX, local_statistics
from .growing import Region, Shape, grow_regions
from .radar import power
from .reduced import BlockMask, ReducedScene
from .scene import Scene, Selection
from .skeleton import pruned, skeleton
from .threshold import BLOCK_PX, disc, grown

# Window by which skeletons are broadened, 5–19 m in [Suri2010], and percentage of the brightest
# pixels inside that are excluded again.
WIDTH_M = 11.0
HIGH_PERCENT = 10.0

# Largest difference of a region's pixels from its homogeneous seed.
_TOLERANCE_DB = 2.5

# Least area of a region; least length and elongation of long regions; least area of wide ones.
_SMALLEST_M2 = 200.0
_LONG_M, _ELONGATION = 50.0, 3.0
_LARGE_M2 = 1500.0

# Ground lies in the lower part of the histogram ([Suri2010] 5.3.2), roofs and walls in the upper.
_BRIGHTEST_PERCENT = 60.0

# Regions as dark as the darkest of the scene are radar shadow, unless as large as a lake.
_DARKEST_PERCENT = 5.0
_SHADOW_DB = 1.5
_LAKE_M2 = 20_000.0

# Radius by which borders are smoothed before thinning.
_EVEN_M = 2.0

# Surroundings up to this distance take part, too: banks and kerbs are on the ground, and are the
# only structure of a homogeneous area. Gaps up to twice this width close.
_BORDER_M = 3.0


@dataclass(frozen=True)
class GroundRegions:
    """Homogeneous regions of a radar image that are ground, by their shapes and levels.

    Parameters
    ----------
    regions, skeleton, part
        The regions that were kept; the skeleton of the long ones; the mask, that is the broadened
        skeleton and the large, wider regions.
    skeleton_m
        Length of the skeleton.
    high
        Largest grey value that takes part, of means over about 4 × 4 pixels of the scene.
    """

    regions: BlockMask
    skeleton: BlockMask
    part: BlockMask
    skeleton_m: float
    high: float

    def select(self, window: Window) -> Selection:
        """Return which pixels of a window take part."""
        factor = self.part.factor
        side_px = _mean_blocks(factor) * factor
        around = window.widened(side_px)
        patch, inside = self.part.scene.read(around), window.slices_in(around)
        chosen = self.part.cut(window) & (_smooth(patch, side_px)[inside] <= self.high)
        valid = patch.valid[inside]
        return Selection(chosen & valid, valid)


def find_regions(
    scene: Scene,
    width_m: float = WIDTH_M,
    high_percent: float = HIGH_PERCENT,
    progress: Progress = SILENT,
) -> GroundRegions:
    """Find homogeneous regions on the ground in a radar image.

    Parameters
    ----------
    scene
        Grey values are amplitudes.
    width_m
        Window by which skeletons are broadened; 5–19 m in [Suri2010].
    high_percent
        Percentage of the brightest pixels inside that are excluded again.
    progress
        Receives every step.

    Raises
    ------
    RasterContentError
        No pixel of the scene is valid.
    """
    image = ReducedScene.of(scene, progress.part(0.0, 0.3))
    pixel_m = image.pixel_m
    longs, wide = _kept_regions(image, width_m, progress.part(0.3, 0.8))
    even = _without_holes(longs, round(_SMALLEST_M2 / pixel_m**2), max(round(_EVEN_M / pixel_m), 1))
    lines = pruned(skeleton(even), round(width_m / pixel_m / 2))
    part = _broadened(lines, wide, width_m, pixel_m) & image.patch.valid
    inside = _smooth(image.patch, _mean_blocks(image.factor))[part]
    high = float(np.percentile(inside, 100 - high_percent)) if inside.size else np.inf
    regions, lined, kept = (image.mask(blocks) for blocks in (longs | wide, lines, part))
    return GroundRegions(regions, lined, kept, _length_px(lines) * pixel_m, high)


def _broadened(lines: Mask, wide: Mask, width_m: float, pixel_m: float) -> Mask:
    """Return the broadened skeleton, the wide regions, and the border of both."""
    broad = grown(lines, disc(max(round(width_m / pixel_m / 2), 1)))
    return grown(broad | wide, disc(max(round(_BORDER_M / pixel_m), 1)))


def _kept_regions(image: ReducedScene, width_m: float, progress: Progress) -> tuple[Mask, Mask]:
    """Return the long regions on the ground, and the large, wide ones."""
    valid, pixel_m = image.patch.valid, image.pixel_m
    level, looks = image.without_speckle()
    variation2 = local_statistics(power(image.patch), valid, LOOKS_WINDOW_PX).variation2
    brightest = np.percentile(level[valid], _BRIGHTEST_PERCENT)
    progress.update(0.5)
    smallest = max(int(_SMALLEST_M2 / pixel_m**2), 1)
    most = HOMOGENEOUS_EXCESS / looks
    found = grow_regions(level, variation2, valid, most, _TOLERANCE_DB, smallest)
    regions = [region for region in found if region.level_db <= brightest]
    shadow_db = _darkest_db(regions) + _SHADOW_DB
    longs, wide = np.zeros(level.shape, bool), np.zeros(level.shape, bool)
    for region in regions:
        shape = Shape.of(region.mask)
        area_m2 = shape.area * pixel_m**2
        if region.level_db < shadow_db and area_m2 < _LAKE_M2:
            continue
        if shape.length * pixel_m >= _LONG_M and shape.elongation >= _ELONGATION:
            longs[region.box.slices] |= region.mask
        if area_m2 >= _LARGE_M2 and shape.width * pixel_m > width_m:
            wide[region.box.slices] |= region.mask
    return longs, wide


def _darkest_db(regions: list[Region]) -> float:
    """Return the level below which `_DARKEST_PERCENT` of the regions' area lie."""
    if not regions:
        return -np.inf
    level = np.array([region.level_db for region in regions])
    area = np.array([np.count_nonzero(region.mask) for region in regions])
    order = level.argsort()
    below = np.cumsum(area[order]) / area.sum()
    return float(level[order][np.searchsorted(below, _DARKEST_PERCENT / 100)])


def _without_holes(mask: Mask, smallest_px: int, radius_px: int) -> Mask:
    """Return a mask with smooth borders and without holes smaller than `smallest_px` pixels."""
    even = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_CLOSE, disc(radius_px))
    even = cv2.morphologyEx(even, cv2.MORPH_OPEN, disc(radius_px))
    _, labels, stats, _ = cv2.connectedComponentsWithStats(1 - even, connectivity=4)
    small = stats[:, cv2.CC_STAT_AREA] < smallest_px
    small[0] = False  # the mask itself
    return np.asarray((even > 0) | small[labels])


def _mean_blocks(factor: int) -> int:
    """Return the side, in blocks of so many pixels, of the means that tell the brightest pixels.

    A limit holds only for means over as many pixels: of more, fewer are as bright.
    """
    return max(BLOCK_PX // factor, 1)


def _smooth(patch: Patch, side_px: int) -> NDArray[np.float32]:
    """Return the mean over a square around each pixel; invalid ones count as 0."""
    known = np.where(patch.valid, patch.values, np.float32(0))
    return np.asarray(cv2.blur(known, (side_px, side_px)))


def _length_px(lines: Mask) -> float:
    """Return the length of lines one pixel wide: straight steps and diagonals."""
    straight = np.count_nonzero(lines[1:] & lines[:-1]) + np.count_nonzero(
        lines[:, 1:] & lines[:, :-1]
    )
    down = lines[1:, 1:] & lines[:-1, :-1] & ~lines[1:, :-1] & ~lines[:-1, 1:]
    up = lines[:-1, 1:] & lines[1:, :-1] & ~lines[1:, 1:] & ~lines[:-1, :-1]
    return float(straight + np.sqrt(2) * (np.count_nonzero(down) + np.count_nonzero(up)))
