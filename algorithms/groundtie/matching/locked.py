"""Pixel-locked content: structure that is the same in both arrays, wherever the ground lies.

Labels, frames, watermarks, clouds of one deck, tiles of one mosaic and the pattern of one sensor
are drawn at a column and row, not at a place. Two images that share them match at that offset of
columns and rows, whatever ground they show.
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
from .matcher import FloatArray, Places

# A transform that moves all of the overlap by whole pixels, but for this, may be content's.
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
    """Which pixels of the reference the input repeats at an offset of whole columns and rows.

    Called with a part of the matching grid, it returns their surroundings, as `HeldOut` does.

    Parameters
    ----------
    pair
        The images, with pixels of one size.
    offset_px
        Input (col, row) − reference (col, row).
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
    offset_px: tuple[int, int]
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
        patches = Resampled(self.pair, _to_input(self.pair, self.offset_px)).read(around)
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
    """Return what the images repeat where a transform puts the input's array.

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
    None where the transform does more than move the array, which nothing drawn into both does.
    """
    moved = _moved_px(pair, transform)
    if moved is None:
        return None
    offset = np.rint(np.median(moved, axis=0))
    # Not a number, where the transform has none, is no small bend either.
    if not np.abs(moved - offset).max() <= _LARGEST_BEND_PX:
        return None
    found = int(offset[0]), int(offset[1])
    # Chips may end a pixel beyond the grid.
    reach_px = LOOK_REACH_PX + 1
    images = Resampled.of(pair, _to_input(pair, found), places.grid, reach_px, context)

    def look(centre: NDArray[np.int_]) -> Look:
        side = places.chip_px + 2 * LOOK_REACH_PX
        corner = centre - side // 2
        piece = places.grid.window(int(corner[0]), int(corner[1]), side, side)
        return Look.of(*images.read(piece))

    sameness = sameness_of(list(context.map(look, list(places.centres))))
    if sensors is Sensors.RADARS:
        is_exact = not sameness.varies_as_ground
    else:
        is_exact = bool(np.abs(moved - offset).max() <= exact_px)
    return LockedContent(pair, found, sameness, sensors, is_exact)


def _to_input(pair: ImagePair, offset_px: tuple[int, int]) -> PointFunction:
    """Return the function from map positions to the input's pixels at an offset in the array."""
    to_reference = pair.reference.source.grid.map_to_pixel
    return lambda xy: to_reference(xy) + offset_px


def _moved_px(pair: ImagePair, transform: Transform) -> FloatArray | None:
    """Return by how many columns and rows a transform moves the input, on a lattice, (n, 2).

    None where pixels differ in size.
    """
    grid, reference = pair.grid, pair.reference.source.grid
    if not np.isclose(grid.pixel_size_m, reference.pixel_size_m, rtol=1e-6):
        return None
    cols, rows = np.meshgrid(
        np.linspace(0, grid.width - 1, _LATTICE), np.linspace(0, grid.height - 1, _LATTICE)
    )
    xy = grid.pixel_to_map(np.column_stack([cols.ravel(), rows.ravel()]))
    return np.asarray(transform(xy) - reference.map_to_pixel(xy))
