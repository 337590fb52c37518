"""Pixel-locked content: structure that is the same in both arrays, wherever the ground lies.

Labels, frames, watermarks, clouds of one deck, tiles of one mosaic and the pattern of one sensor
are drawn at a column and row, or on the map, which another grid has at other columns and rows. Two
images that share them match there, whatever ground they show.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..context import Context
from ..geometry.transform import Transform
from ..rasters.grid import Grid, PointFunction
from ..rasters.pair import ImagePair
from ..rasters.patch import Patch
from ..similarity.description import BORDER_PX
from ..similarity.in_common import (
    LOOK_REACH_PX,
    Look,
    drawn_edges,
    sameness_of,
)
from ..similarity.sameness import REACH_PX, WINDOW_PX, Windows, covered
from ..similarity.seams import seams, step_products
from .chip_windows import ChipWindows, Resampled, singly
from .matcher import Places
from .shared_content import Sensors, SharedContent

# Steps between whole columns are compared unresampled, radar images as if on whole pixels, where a
# transform is so near to those.
_NEAR_PX = 1.5

# What is drawn lies on whole pixels all over; of other pairs, one in 64 lies as near by chance.
# Measured (suite attacks): drawn mostly up to 0.05; of 127 right pairs on one grid none as near is
# refused, but some beyond 0.09, and one of the suite series at 0.08.
EXACT_PX = 0.0625

# Where what is drawn deceives, transforms lie within so many times of what counts as exact of whole
# pixels of the array, or within the second of what is nominal: of two cameras' images 10 of 11, of
# right transforms 6 of 18 (suite margins, --seeds 87000-87029 --sample 120).
WHOLE_TIMES_EXACT, NOMINAL_PX = 4, 1.5

# Around an edge, chips see it this far off; around a seam, which is long, as far as filters reach.
_EDGE_SURROUNDINGS_PX = 9
_SEAM_SURROUNDINGS_PX = 2 * BORDER_PX + 1

# Around a part that is masked, what lies there is looked at, too.
_RIM_PX = 2 * REACH_PX


@dataclass(frozen=True)
class LockedContent:
    """Which pixels of the reference the input repeats where both are drawn alike.

    Called with a part of the matching grid, it returns their surroundings, as `HeldOut` does.

    Parameters
    ----------
    pair
        The images.
    to_input
        Takes map positions to where the input has what is drawn there, in its pixels: where the
        transform has them, or the whole number of columns and rows off that it moves the array by.
    shared
        What they have the same.
    """

    pair: ImagePair
    to_input: PointFunction
    shared: SharedContent

    def __call__(self, piece: Grid) -> NDArray[np.bool_]:
        """Return which pixels of a part of the matching grid lie where both are the same, (h, w).

        What is drawn ends somewhere in the windows that vary alike: all of them is taken, unless
        the surroundings are one camera's views of the ground, and what is around edges if they
        or the transform are evidence. If the transform is, what follows in other colours is, too,
        unless nearly everything does.
        """
        patches = self._around(piece)
        windows = Windows.of(*patches)
        same, shared = windows.same, self.shared
        if not shared.is_explained:
            if shared.is_exact and not shared.sameness.is_copy_in_other_colours:
                same = same | windows.related
            same = covered(same, WINDOW_PX)
            if shared.sameness.has_sharp_edges or shared.is_exact:
                same |= covered(drawn_edges(*patches), _EDGE_SURROUNDINGS_PX)
            if shared.sameness.has_seams:
                same |= covered(seams(*patches), _SEAM_SURROUNDINGS_PX)
        return _inner(same)

    def around_edges(self, piece: Grid) -> NDArray[np.bool_]:
        """Return which pixels of a part lie around edges that coincide, whatever else, (h, w)."""
        return _inner(covered(drawn_edges(*self._around(piece)), _EDGE_SURROUNDINGS_PX))

    def _around(self, piece: Grid) -> tuple[Patch, Patch]:
        size = piece.width + 2 * _RIM_PX, piece.height + 2 * _RIM_PX
        around = piece.window(-_RIM_PX, -_RIM_PX, *size)
        return Resampled(self.pair, self.to_input).read(around)


def _inner(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    return mask[_RIM_PX:-_RIM_PX, _RIM_PX:-_RIM_PX]


def find_locked_content(
    pair: ImagePair,
    transform: Transform,
    places: Places,
    sensors: Sensors,
    exact_px: float,
    context: Context,
    images: Resampled | None = None,
) -> LockedContent | None:
    """Return what the images repeat where a transform has them.

    Parameters
    ----------
    pair
        The images.
    transform
        What was found.
    places
        Where it is looked for.
    sensors
        What the images may be.
    exact_px
        Within this of whole pixels, what was found lies on them as exactly as it is known.
    context
        Threads.
    images
        The pair's, resampled by the transform with 21 px and more around them; None: they are
        resampled here.

    Returns
    -------
    None of an image in the geometry of its sensor, which repeats nothing that is drawn on a map,
    unless the transform moves the array.
    """
    whole, off_px = _by_whole_pixels(pair, transform)
    to_input: PointFunction
    if off_px <= exact_px:
        to_input = whole
    elif type(pair.input.source.grid) is Grid:
        to_input = transform
    else:
        return None

    def windows(by: PointFunction) -> ChipWindows:
        known = images if by is transform else None
        # Chips may end a pixel beyond the grid.
        seen = known or Resampled.of(pair, by, places.grid, LOOK_REACH_PX + 1, context)
        return ChipWindows(seen, places, LOOK_REACH_PX, None)

    is_near, seen = off_px <= _NEAR_PX, windows(to_input)
    unresampled = windows(whole) if is_near and to_input is not whole else seen
    _, looks = seen.map(singly(Look.of), context)
    _, steps = unresampled.map(singly(step_products), context)
    sameness = sameness_of(looks, steps)
    off_nominal = _off_nominal_px(pair.grid, transform) / NOMINAL_PX
    off_drawn = min(off_px / (WHOLE_TIMES_EXACT * exact_px), off_nominal)
    is_whole = is_near if sensors is Sensors.RADARS else off_px <= exact_px
    shared = SharedContent(sameness, sensors, is_whole, off_drawn)
    return LockedContent(pair, to_input, shared)


def _by_whole_pixels(pair: ImagePair, transform: Transform) -> tuple[PointFunction, float]:
    """Return the move by whole columns and rows nearest to a transform, and how far off it is.

    The latter at most, in pixels.
    """
    grid, reference = pair.grid, pair.reference.source.grid
    xy = grid.pixel_to_map(grid.places())
    found, there = transform(xy), reference.map_to_pixel(xy)
    offset = np.rint(np.median(found - there, axis=0))
    off_px = float(np.abs(found - there - offset).max())
    return lambda xy: reference.map_to_pixel(xy) + offset, off_px


def _off_nominal_px(grid: Grid, transform: Transform) -> float:
    """Return how far at most a transform is from what is nominal, in pixels of a grid."""
    px = grid.places()
    return float(np.abs(grid.map_to_pixel(transform.model(grid.pixel_to_map(px))) - px).max())
