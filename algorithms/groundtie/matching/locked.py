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
from ..similarity.sameness import all_of_windows, reduced, same_windows, without
from .matcher import FloatArray, Places

# A transform that moves all of the overlap by whole pixels, but for this, may be content's.
_LARGEST_BEND_PX = 1.5

# One sensor's views of one ground vary alike where nothing is drawn, too, on images that are so
# much smaller. Measured on the shared pairs at their true places: 35 % of what is left and more; of
# different ground 0 to 25 %. Less than a tenth of the area shows nothing.
_REDUCTION = 4
_GROUND_SHARE = 0.35
_LEAST_LEFT = 0.1

# Nothing is left to be judged of copies: this share is the same, and more of reduced images. Snow
# of one shape over two places: up to 77 %; a shared pair that is one sensor's: from 98 % on.
_COPY_SHARE = 0.9

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
    def is_explained(self) -> bool:
        """Whether one image is a copy of the other, or both are one sensor's views of one ground.

        What is left of them need not confirm the transform, as copies leave nothing, and what one
        sensor shows alike is most of what it shows. Reduced images of one ground are more alike, as
        noise averages out; under a pattern that both have, ground that lies elsewhere comes out.
        """
        is_copy = self.reduced_area >= self.area >= _COPY_SHARE
        return is_copy or self.ground >= _GROUND_SHARE


@dataclass(frozen=True)
class LockedContent:
    """Which pixels of the reference the input repeats at an offset of whole columns and rows.

    Called with a part of the matching grid, it returns them, shape (h, w), as `HeldOut` does.

    Parameters
    ----------
    pair
        The images, with pixels of one size.
    offset_px
        Input (col, row) − reference (col, row).
    """

    pair: ImagePair
    offset_px: tuple[int, int]

    def __call__(self, piece: Grid) -> NDArray[np.bool_]:
        """Return which pixels of a part of the matching grid are in windows that vary alike."""
        return all_of_windows(same_windows(*self._patches(piece)))

    def sameness(self, places: Places, context: Context) -> Sameness:
        """Return how much is the same in chips; `context` has the threads."""
        half, side = places.chip_px // 2, places.chip_px

        def count(centre: NDArray[np.int_]) -> tuple[_Count, _Count, _Count]:
            col, row = (int(at) - half for at in centre)
            piece = places.grid.window(col, row, side, side)
            return _counts(*self._patches(piece))

        counts = np.array(list(context.map(count, list(places.centres))), int).sum(axis=0)
        least = _LEAST_LEFT * counts[1, 1]
        area, reduced_area, ground = counts[:, 0] / np.maximum(counts[:, 1], [1, 1, max(least, 1)])
        return Sameness(float(area), float(reduced_area), float(ground))

    def _patches(self, piece: Grid) -> tuple[Patch, Patch]:
        """Return both images' own pixels on a part of the grid, the input's moved by the offset."""
        to_reference = self.pair.reference.source.grid.map_to_pixel

        def to_input(xy: FloatArray) -> FloatArray:
            return to_reference(xy) + self.offset_px

        return self.pair.reference_patch(piece), self.pair.input_patch(piece, to_input)


_Count = tuple[int, int]


def _counts(reference: Patch, input: Patch) -> tuple[_Count, _Count, _Count]:
    """Return (same, all) pixels, in the order of `Sameness`."""
    same = same_windows(reference, input)
    return (
        (int(same.sum()), int((reference.valid & input.valid).sum())),
        _count_reduced(reference, input),
        _count_reduced(without(reference, same), without(input, same)),
    )


def _count_reduced(reference: Patch, input: Patch) -> _Count:
    smaller = reduced(reference, _REDUCTION), reduced(input, _REDUCTION)
    return int(same_windows(*smaller).sum()), int((smaller[0].valid & smaller[1].valid).sum())


@dataclass(frozen=True)
class Offset:
    """By how many whole columns and rows a transform moves an array, and by how much it does not.

    Parameters
    ----------
    px
        Input (col, row) − reference (col, row), rounded.
    bend_px
        The most by which the transform departs from it, along columns or rows.
    """

    px: tuple[int, int]
    bend_px: float


def find_offset(pair: ImagePair, transform: Transform) -> Offset | None:
    """Return by how many columns and rows a transform moves the input's array.

    None where it does more than move the array, which nothing drawn into both does.
    """
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
    bend = float(np.abs(moved - offset).max())
    if not bend <= _LARGEST_BEND_PX:
        return None
    return Offset((int(offset[0]), int(offset[1])), bend)
