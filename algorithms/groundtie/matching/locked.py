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
from ..similarity.sameness import (
    REACH_PX,
    WINDOW_PX,
    covered,
    reduced,
    same_lines,
    same_windows,
    without,
)
from .matcher import FloatArray, Places

# One sensor's views of one ground vary alike where nothing is drawn, too, on images that are so
# much smaller. Measured as above: 25 % of what is left and more; of different ground 0 to 21 %, of
# ground that was displaced up to 43 %, which is left to the rules on a second place. Less than a
# tenth of the area shows nothing.
_REDUCTION = 4
_GROUND_SHARE = 0.23
_LEAST_LEFT = 0.1

# Shares differ, but by chance with 5 %, if they are so many standard errors apart.
_STANDARD_ERRORS = 1.645

# Nothing is left to be judged of copies: this share is the same, in the images and reduced ones.
_COPY_SHARE = 0.75

_LATTICE = 9

# A transform that moves all of the overlap by whole pixels, but for this, may be content's.
_LARGEST_BEND_PX = 1.5

# Around a line, chips see it this far off.
_LINE_SURROUNDINGS_PX = 5


@dataclass(frozen=True)
class Sameness:
    """How much two arrays have the same at an offset of whole columns and rows.

    Parameters
    ----------
    area, reduced_area
        Share of the area that varies alike, in the images and in reduced ones.
    ground
        The latter, of what does not vary alike in the images.
    windows
        How many windows of the reduced images do not overlap.
    """

    area: float
    reduced_area: float
    ground: float
    windows: float

    @property
    def is_explained(self) -> bool:
        """Whether one image is a copy of the other, or both are one sensor's views of one ground.

        What is left of them need not confirm the transform, as copies leave nothing, and what one
        sensor shows alike is most of what it shows. Ground is no less alike in reduced images,
        where noise has averaged out; noise that is the same in both is.
        """
        error = np.sqrt(self.area * (1 - self.area) / max(self.windows, 1.0))
        if self.reduced_area < self.area - _STANDARD_ERRORS * error:
            return False
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

        What is drawn ends somewhere in the windows that vary alike: all of them is taken, and what
        is around lines, unless the surroundings are one sensor's views of the ground.
        """
        reach = 2 * REACH_PX
        size = piece.width + 2 * reach, piece.height + 2 * reach
        around = piece.window(-reach, -reach, *size)
        patches = _patches(self.pair, around, self.offset_px)
        same = same_windows(*patches)
        if not self.sameness.is_explained:
            same = covered(same, WINDOW_PX) | covered(same_lines(*patches), _LINE_SURROUNDINGS_PX)
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
    moved = _moved_px(pair, transform)
    if moved is None:
        return None
    offset = np.rint(np.median(moved, axis=0))
    # Not a number, where the transform has none, is no small bend either.
    if not np.abs(moved - offset).max() <= _LARGEST_BEND_PX:
        return None
    found = int(offset[0]), int(offset[1])

    def count(centre: NDArray[np.int_]) -> tuple[_Count, _Count, _Count]:
        corner = centre - places.chip_px // 2
        piece = places.grid.window(int(corner[0]), int(corner[1]), *[places.chip_px] * 2)
        return _counts(*_patches(pair, piece, found))

    return LockedContent(pair, found, _sameness(list(context.map(count, list(places.centres)))))


# How many pixels are the same, and all.
_Count = tuple[int, int]


def _sameness(counts: list[tuple[_Count, _Count, _Count]]) -> Sameness:
    area, reduced_area = (_share([one[k] for one in counts]) for k in (0, 1))
    every = sum(one[1][1] for one in counts)
    ground = _share([one[2] for one in counts], int(_LEAST_LEFT * every))
    return Sameness(area, reduced_area, ground, every / WINDOW_PX**2)


def _counts(reference: Patch, input: Patch) -> tuple[_Count, _Count, _Count]:
    """Return what varies alike in two windows, on reduced ones, and there of the rest."""
    same = same_windows(reference, input)
    return (
        (int(same.sum()), int((reference.valid & input.valid).sum())),
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
