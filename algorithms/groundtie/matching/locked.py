"""Pixel-locked content: structure that is the same in both arrays, wherever the ground lies.

Labels, frames, watermarks, clouds of one deck, tiles of one mosaic and the pattern of one sensor
are drawn at a column and row, not at a place. Two images that share them match at that offset of
columns and rows, whatever ground they show.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..context import Context
from ..geometry.transform import Transform
from ..rasters.grid import Grid
from ..rasters.pair import ImagePair
from ..rasters.patch import Patch
from ..similarity.sameness import REACH_PX, covered, reduced, same_windows, without
from .matcher import FloatArray, Places

# A transform that moves all of the overlap by whole pixels, but for this, may be content's.
_LARGEST_BEND_PX = 1.5

# More of the area varies alike than two sensors show of one ground; what else they show is asked
# then. Measured on the shared pairs at their true places: up to 1.6 % of different sensors and
# physics. With content drawn into both: 3 to 80 %.
_LEAST_AREA = 0.02

# One sensor's views of one ground vary alike where nothing is drawn, too, on images that are so
# much smaller. Measured as above: 35 % of what is left and more; of different ground 0 to 25 %.
# Less than a tenth of the area shows nothing.
_REDUCTION = 4
_GROUND_SHARE = 0.35
_LEAST_LEFT = 0.1

# Nothing is left to be judged of copies: this share is the same, in the images and reduced ones.
_COPY_SHARE = 0.75

_LATTICE = 9


@dataclass(frozen=True)
class Sameness:
    """How much two arrays have the same at an offset of whole columns and rows.

    Parameters
    ----------
    area, reduced_area
        Share of the area that varies alike, in the images and in reduced ones.
    ground
        The latter, of what does not vary alike in the images.
    """

    area: float
    reduced_area: float
    ground: float

    @property
    def is_evident(self) -> bool:
        """Whether more is the same than two views show of one ground."""
        return self.area >= _LEAST_AREA

    @property
    def is_explained(self) -> bool:
        """Whether one image is a copy of the other, or both are one sensor's views of one ground.

        What is left of them need not confirm the transform, as copies leave nothing, and what one
        sensor shows alike is most of what it shows.
        """
        is_copy = min(self.area, self.reduced_area) >= _COPY_SHARE
        return is_copy or self.ground >= _GROUND_SHARE


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
    """

    pair: ImagePair
    offset_px: tuple[int, int]
    sameness: Sameness

    def __call__(self, piece: Grid) -> NDArray[np.bool_]:
        """Return which pixels of a part of the matching grid lie where both are the same, (h, w).

        All of a window that varies alike does, not only its middle: what is drawn ends there.
        """
        reach = 2 * REACH_PX
        size = piece.width + 2 * reach, piece.height + 2 * reach
        around = piece.window(-reach, -reach, *size)
        same = covered(same_windows(*_patches(self.pair, around, self.offset_px)))
        return same[reach:-reach, reach:-reach]


def find_locked_content(
    pair: ImagePair, transform: Transform, places: Places, context: Context
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
    context
        Threads.

    Returns
    -------
    None where the transform does more than move the array, which nothing drawn into both does.
    """
    offset = _whole_offset(pair, transform)
    if offset is None:
        return None

    def count(centre: NDArray[np.int_]) -> _Counts:
        corner, side = centre - places.chip_px // 2, places.chip_px
        piece = places.grid.window(int(corner[0]), int(corner[1]), side, side)
        return _count(*_patches(pair, piece, offset))

    counts = list(context.map(count, list(places.centres)))
    return LockedContent(pair, offset, _sameness(counts))


def _sameness(counts: list[_Counts]) -> Sameness:
    area, reduced_area = (_share([one[k] for one in counts]) for k in (0, 1))
    least = int(_LEAST_LEFT * sum(one[1][1] for one in counts))
    return Sameness(area, reduced_area, _share([one[2] for one in counts], least))


# How many pixels are the same, and how many there are: of the images, of reduced ones, and of what
# is left of the latter without what is the same in the former.
_Count = tuple[int, int]
_Counts = tuple[_Count, _Count, _Count]


def _count(reference: Patch, input: Patch) -> _Counts:
    same = same_windows(reference, input)
    every = int((reference.valid & input.valid).sum())
    return (
        (int(same.sum()), every),
        _count_reduced(reference, input),
        _count_reduced(without(reference, same), without(input, same)),
    )


def _count_reduced(reference: Patch, input: Patch) -> _Count:
    smaller = reduced(reference, _REDUCTION), reduced(input, _REDUCTION)
    return int(same_windows(*smaller).sum()), int((smaller[0].valid & smaller[1].valid).sum())


def _share(counts: list[_Count], least: int = 1) -> float:
    """Return the share of what is the same, of at least so many."""
    same, every = np.sum(counts, axis=0) if counts else (0, 0)
    return float(same / max(every, least, 1))


def _patches(pair: ImagePair, piece: Grid, offset_px: tuple[int, int]) -> tuple[Patch, Patch]:
    """Return both images' own pixels on a part of the grid, the input's moved by an offset."""
    to_reference = pair.reference.source.grid.map_to_pixel

    def to_input(xy: FloatArray) -> FloatArray:
        return to_reference(xy) + offset_px

    return pair.reference_patch(piece), pair.input_patch(piece, to_input)


def _whole_offset(pair: ImagePair, transform: Transform) -> tuple[int, int] | None:
    """Return by how many columns and rows a transform moves the input; None: it does more."""
    grid, reference = pair.grid, pair.reference.source.grid
    if not np.isclose(grid.pixel_size_m, reference.pixel_size_m, rtol=1e-6):
        return None
    cols, rows = np.meshgrid(
        np.linspace(0, grid.width - 1, _LATTICE), np.linspace(0, grid.height - 1, _LATTICE)
    )
    xy = grid.pixel_to_map(np.column_stack([cols.ravel(), rows.ravel()]))
    moved = transform(xy) - reference.map_to_pixel(xy)
    offset = np.rint(np.median(moved, axis=0))
    # Not a number, where the transform has none, is no small bend either.
    if not np.abs(moved - offset).max() <= _LARGEST_BEND_PX:
        return None
    return int(offset[0]), int(offset[1])
