"""Pixel-locked content: structure that is identical in both arrays, wherever the ground lies.

Labels, frames, watermarks, clouds of one deck, tiles of one mosaic and the pattern of one sensor
are fixed to columns and rows, or to map positions, which have other columns and rows in another
grid. Two images that share such drawn content match where it coincides, whatever ground they show.
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
from ..similarity.in_common import LOOK_REACH_PX, Look, drawn_edges, sameness_of
from ..similarity.sameness import REACH_PX, WINDOW_PX, Windows, covered
from ..similarity.seams import seams, step_products
from .chip_windows import ChipWindows, Resampled, singly
from .matcher import Places
from .shared_content import Sensors, SharedContent

# If a transform is this close to whole pixels, steps between whole columns are compared without
# resampling, and radar images count as shifted by whole pixels.
_NEAR_PX = 1.5

# Drawn content lies on whole pixels everywhere; one in 64 other pairs lies as close by chance.
# Measured (suite attacks): drawn content is mostly within 0.05. Of 127 correct pairs on one grid
# none this close is refused, but some beyond 0.09 are, and one of the suite series at 0.08.
EXACT_PX = 0.0625

# Transforms misled by drawn content lie within the first, in units of the exactness limit, of whole
# pixels of the array, or within the second of the nominal geotransform. For images of two cameras,
# 10 of 11 of them do, and 6 of 18 correct transforms (suite margins, --seeds 87000-87029 --sample
# 120).
WHOLE_TIMES_EXACT, NOMINAL_PX = 4, 1.5

# An edge affects chips within this distance; a seam, which is long, as far as the filters reach.
_EDGE_SURROUNDINGS_PX = 9
_SEAM_SURROUNDINGS_PX = 2 * BORDER_PX + 1

# Content within this margin of a piece affects its mask.
_RIM_PX = 2 * REACH_PX


@dataclass(frozen=True)
class LockedContent:
    """A mask of the reference pixels whose content the input repeats.

    Called with a part of the matching grid, as `HeldOut` is, it returns the surroundings of these
    pixels.

    Parameters
    ----------
    pair
        The images.
    to_input
        Takes map positions to the input pixels that hold the same drawn content, by the transform
        or by its shift of the array rounded to whole columns and rows.
    shared
        The content that they share.
    """

    pair: ImagePair
    to_input: PointFunction
    shared: SharedContent

    def __call__(self, piece: Grid) -> NDArray[np.bool_]:
        """Return which pixels of a part of the matching grid lie in identical content, (h, w).

        Drawn content ends somewhere inside the windows that vary alike. Whole windows are masked,
        unless the images are copies or one camera's views of the ground. Surroundings of edges are
        masked if the edges or the transform are evidence. If the transform is, so are windows
        related in other colours, unless nearly all are.
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
        """Return which pixels of a part lie around coinciding edges, drawn or not, (h, w)."""
        return _inner(covered(drawn_edges(*self._around(piece)), _EDGE_SURROUNDINGS_PX))

    def _around(self, piece: Grid) -> tuple[Patch, Patch]:
        return Resampled(self.pair, self.to_input).read(piece.widened(_RIM_PX))


def _inner(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    return mask[_RIM_PX:-_RIM_PX, _RIM_PX:-_RIM_PX]


def find_locked_content(
    images: Resampled,
    transform: Transform,
    places: Places,
    sensors: Sensors,
    exact_px: float,
    context: Context,
) -> LockedContent | None:
    """Find the content that two images aligned by a transform share.

    Parameters
    ----------
    images
        A pair's, resampled by the transform with a margin of at least 21 px.
    transform
        The transform that was found.
    places
        The chips that are compared.
    sensors
        Kinds of sensors that the images may come from.
    exact_px
        A transform within this distance of whole pixels lies on them within its accuracy.
    context
        Threads.

    Returns
    -------
    The shared content. None for an input in sensor geometry, which repeats nothing that is drawn
    on a map, unless the transform shifts the array by whole pixels.
    """
    pair = images.pair
    whole, off_px = _by_whole_pixels(pair, transform)
    to_input: PointFunction
    if off_px <= exact_px:
        to_input = whole
    elif type(pair.input.source.grid) is Grid:
        to_input = transform
    else:
        return None

    def windows(by: PointFunction) -> ChipWindows:
        seen = images
        if by is not transform:
            # Chips may extend a pixel beyond the grid.
            seen = Resampled.of(pair, by, places.grid, LOOK_REACH_PX + 1, context)
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
    """Return the whole-pixel shift nearest to a transform, and its largest deviation in pixels."""
    grid, reference = pair.grid, pair.reference.source.grid
    xy = grid.pixel_to_map(grid.places())
    found, there = transform(xy), reference.map_to_pixel(xy)
    offset = np.rint(np.median(found - there, axis=0))
    off_px = float(np.abs(found - there - offset).max())
    return lambda xy: reference.map_to_pixel(xy) + offset, off_px


def _off_nominal_px(grid: Grid, transform: Transform) -> float:
    """Return the largest distance of a transform from the nominal one, in pixels of a grid."""
    px = grid.places()
    return float(np.abs(grid.map_to_pixel(transform.model(grid.pixel_to_map(px))) - px).max())
