"""Pixel-locked content: structure that is the same in both arrays, wherever the ground lies.

Labels, frames, watermarks, clouds of one deck, tiles of one mosaic and the pattern of one sensor
are drawn at a column and row, or at a nominal place, which another grid has at other columns and
rows. Two images that share them match there, whatever ground they show.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto

import numpy as np
from numpy.typing import NDArray

from ..context import Context
from ..geometry.transform import Transform
from ..rasters.grid import Grid, PointFunction
from ..rasters.pair import ImagePair
from ..similarity.description import BORDER_PX
from ..similarity.in_common import (
    LOOK_REACH_PX,
    Look,
    Sameness,
    drawn_edges,
    sameness_of,
)
from ..similarity.sameness import REACH_PX, WINDOW_PX, Windows, covered
from ..similarity.seams import seams
from .chip_windows import Resampled
from .matcher import Places

# A transform that moves all of the overlap by whole pixels, or leaves it at its nominal place, but
# for this, may be content's.
_LARGEST_BEND_PX = 1.5

# What is drawn lies on whole pixels all over; of other pairs, one in 64 lies as near by chance.
# Measured (suite attacks): drawn mostly up to 0.05; of 127 right pairs on one grid none as near is
# refused, but some beyond 0.09, and one of the suite series at 0.08.
EXACT_PX = 0.0625

_LATTICE = 9

# Around an edge, chips see it this far off; around a seam, which is long, as far as filters reach.
_EDGE_SURROUNDINGS_PX = 9
_SEAM_SURROUNDINGS_PX = 2 * BORDER_PX + 1


class Sensors(Enum):
    """What sensors the images may be of."""

    CAMERAS = auto()
    RADARS = auto()
    DIFFERENT = auto()


@dataclass(frozen=True)
class LockedContent:
    """Which pixels of the reference the input repeats where both are drawn alike.

    Called with a part of the matching grid, it returns their surroundings, as `HeldOut` does.

    Parameters
    ----------
    pair
        The images.
    to_input
        Takes map positions to where the input has what is drawn there, in its pixels: a whole
        number of columns and rows off, or at its nominal place.
    sameness
        How much they have the same.
    sensors
        What the images may be.
    is_exact
        Whether the transform moves the array by whole pixels all over, and does nothing else.
        Speckle moves what is drawn over two radars' images off whole pixels; but radar images of
        one ground vary alike where it has averaged out: those that do not count as exact.
    """

    pair: ImagePair
    to_input: PointFunction
    sameness: Sameness
    sensors: Sensors
    is_exact: bool

    @property
    def is_evident(self) -> bool:
        """Whether more is the same than two views show of one ground, or lies too exactly so."""
        return self.sameness.is_evident or self.is_exact

    @property
    def is_explained(self) -> bool:
        """Whether the images are copies, or one camera's views of one ground.

        What is left of them need not confirm the transform: copies leave nothing, and what a camera
        shows alike is most of what it shows. Each view of a radar has speckle of its own.
        """
        if self.sensors is Sensors.DIFFERENT:
            return False
        is_view = self.sensors is Sensors.CAMERAS and self.sameness.is_view
        return is_view or self.sameness.is_copy

    @property
    def is_drawn(self) -> bool:
        """Whether its edges are sharper than those of one ground, and it is no copy or view."""
        same = self.sameness
        return same.has_sharp_edges and not (self.is_explained or same.is_copy_in_other_colours)

    def __call__(self, piece: Grid) -> NDArray[np.bool_]:
        """Return which pixels of a part of the matching grid lie where both are the same, (h, w).

        What is drawn ends somewhere in the windows that vary alike: all of them is taken, unless
        the surroundings are one camera's views of the ground, and what is around edges if they
        or the transform are evidence. If the transform is, what follows in other colours is, too,
        unless nearly everything does.
        """
        reach = 2 * REACH_PX
        size = piece.width + 2 * reach, piece.height + 2 * reach
        around = piece.window(-reach, -reach, *size)
        patches = Resampled(self.pair, self.to_input).read(around)
        windows = Windows.of(*patches)
        same = windows.same
        if not self.is_explained:
            if self.is_exact and not self.sameness.is_copy_in_other_colours:
                same = same | windows.related
            same = covered(same, WINDOW_PX)
            if self.sameness.has_sharp_edges or self.is_exact:
                same |= covered(drawn_edges(*patches), _EDGE_SURROUNDINGS_PX)
            if self.sameness.has_seams:
                same |= covered(seams(*patches), _SEAM_SURROUNDINGS_PX)
        return same[reach:-reach, reach:-reach]


def find_locked_content(
    pair: ImagePair,
    transform: Transform,
    places: Places,
    sensors: Sensors,
    exact_px: float,
    context: Context,
) -> LockedContent | None:
    """Return what the images repeat where they are drawn alike, and a transform has them so.

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

    Returns
    -------
    None where the transform does more, which nothing drawn into both does.
    """
    way = _nearest_way(pair, transform)
    if way is None or way.bend_px > _LARGEST_BEND_PX:
        return None
    # Chips may end a pixel beyond the grid.
    reach_px = LOOK_REACH_PX + 1
    images = Resampled.of(pair, way.to_input, places.grid, reach_px, context)

    def look(centre: NDArray[np.int_]) -> Look:
        side = places.chip_px + 2 * LOOK_REACH_PX
        corner = centre - side // 2
        piece = places.grid.window(int(corner[0]), int(corner[1]), side, side)
        return Look.of(*images.read(piece))

    sameness = sameness_of(list(context.map(look, list(places.centres))))
    if sensors is Sensors.RADARS:
        is_exact = not sameness.varies_as_ground
    else:
        is_exact = way.bend_px <= exact_px
    return LockedContent(pair, way.to_input, sameness, sensors, way.is_of_array and is_exact)


@dataclass(frozen=True)
class _Way:
    """How what is drawn may lie alike in both images, and how far off a transform has it.

    Parameters
    ----------
    to_input
        See `LockedContent`.
    is_of_array
        Whether it lies a whole number of columns and rows off; else at its nominal place, where
        the ground lies, too, if the georeferencing is right: so no transform is evidence.
    bend_px
        How far off the transform has it at most, in pixels of the matching grid.
    """

    to_input: PointFunction
    is_of_array: bool
    bend_px: float


def _nearest_way(pair: ImagePair, transform: Transform) -> _Way | None:
    """Return the way that is nearest to a transform; None: nothing drawn is alike.

    An image in the geometry of its sensor has nothing that is drawn at a place.
    """
    grid, reference = pair.grid, pair.reference.source.grid
    cols, rows = np.meshgrid(
        np.linspace(0, grid.width - 1, _LATTICE), np.linspace(0, grid.height - 1, _LATTICE)
    )
    px = np.column_stack([cols.ravel(), rows.ravel()])
    xy = grid.pixel_to_map(px)
    found = transform(xy)
    input_px = np.hypot(*(found[-1] - found[0])) / np.hypot(*(px[-1] - px[0]))

    def way(to_input: PointFunction, is_of_array: bool) -> _Way:
        bend_px = float(np.abs(found - to_input(xy)).max() / input_px)
        return _Way(to_input, is_of_array, bend_px)

    ways = []
    if np.isclose(grid.pixel_size_m, reference.pixel_size_m, rtol=1e-6):
        offset = np.rint(np.median(found - reference.map_to_pixel(xy), axis=0))
        ways.append(way(lambda xy: reference.map_to_pixel(xy) + offset, True))
    if type(pair.input.source.grid) is Grid:
        ways.append(way(pair.nominal_px, False))
    known = [one for one in ways if np.isfinite(one.bend_px)]
    return min(known, key=lambda one: one.bend_px, default=None)
