"""The windows of chips in both images, resampled for a block of neighbouring chips at a time.

Windows of neighbours overlap: chip by chip, most pixels would be resampled several times.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ..context import Context
from ..rasters.grid import Grid, PointFunction
from ..rasters.held_images import HeldImage
from ..rasters.pair import ImagePair
from ..rasters.patch import Patch
from .matcher import MaskOf, Places

R = TypeVar("R")

# Takes the reference and the input, and returns what of both is compared.
PartOf = Callable[[Patch, Patch], tuple[Patch, Patch]]

_Numbers = NDArray[np.intp]

# The upper left corner of a piece of a grid, and both images there.
_Piece = tuple[NDArray[np.int_], tuple[Patch, Patch]]

# Longest side of a block that is read from files, in pixels: small enough that all threads get
# blocks, and that each block fits into the processor's cache.
_BLOCK_PX = 384

# Images of up to this many pixels are resampled as a whole: each takes 5 bytes per pixel.
_HELD_PIXELS = 4_000_000

# Windows are processed in stacks of about this many pixels. Larger ones exceed the processor's
# cache; with smaller ones threads wait more often for one another: `benchmarks/run.py --only
# kernels`.
_STACK_PIXELS = 131_072


@dataclass(frozen=True)
class Resampled:
    """The images from which windows of chips are cut, the input resampled by a model.

    Parameters
    ----------
    pair
        The images.
    to_input
        Takes map positions, shape (n, 2), to pixels of the input.
    held
        Both images held in memory, resampled on the grid of the chips; None: they are read.
    part_of
        Takes both images on a piece of the grid and returns what of them is compared; None: all.
    """

    pair: ImagePair
    to_input: PointFunction
    held: tuple[HeldImage, HeldImage] | None = None
    part_of: PartOf | None = None

    @classmethod
    def of(
        cls, pair: ImagePair, to_input: PointFunction, grid: Grid, reach_px: int, context: Context
    ) -> Resampled:
        """Resample small images as a whole; large ones are resampled around chips, when read.

        Parameters
        ----------
        pair, to_input
            See the class.
        grid
            The grid on which chips are matched.
        reach_px
            Margin by which windows of chips reach beyond the grid.
        context
            Threads.
        """
        around, quiet = grid.widened(reach_px), context.quiet()
        if around.width * around.height > _HELD_PIXELS:
            return cls(pair, to_input)
        to_reference = pair.reference.source.grid.map_to_pixel
        held = (
            HeldImage.onto(pair.reference, around, to_reference, quiet),
            HeldImage.onto(pair.input, around, to_input, quiet),
        )
        return cls(pair, to_input, held)

    def read(self, piece: Grid, hidden: MaskOf | None = None) -> tuple[Patch, Patch]:
        """Return what is compared on a piece of the grid, with hidden reference pixels masked."""
        masked = None if hidden is None else hidden(piece)
        if self.held is None:
            both = (
                self.pair.reference_patch(piece, masked),
                self.pair.input_patch(piece, self.to_input),
            )
        else:
            reference, input = self.held
            both = reference.read(piece, masked), input.read(piece)
        return both if self.part_of is None else self.part_of(*both)


@dataclass(frozen=True)
class ChipWindows:
    """Windows of chips with a margin around them, in both images of a pair.

    Parameters
    ----------
    images
        The images.
    places
        The chips.
    reach_px
        Margin around a chip on each side, in pixels.
    hidden
        Takes a piece of a grid and returns which pixels of the reference are hidden; None: none.
    """

    images: Resampled
    places: Places
    reach_px: int
    hidden: MaskOf | None

    def map(
        self,
        function: Callable[[Patch, Patch], Iterable[R]],
        context: Context,
        is_kept: Callable[[Patch, Patch], bool] | None = None,
    ) -> tuple[list[int], list[R]]:
        """Apply a function to the windows of chips; return the chips' numbers and the results.

        Both are ordered by number. `function` takes a stack of reference windows, shape (n, h, w),
        and the stack of their input windows, and returns one result for each pair. `is_kept` takes
        a chip in both images, without its margin, and returns whether to process it; None: all
        are processed.
        """
        chips = np.arange(len(self.places.centres))
        is_held = self.images.held is not None
        held = self._read(chips) if is_held and len(chips) else None

        def of_stack(piece: _Piece, stack: _Numbers) -> Iterable[tuple[int, R]]:
            windows = self._cut(piece, stack)
            if is_kept is not None:
                cores = zip(*(of.inner(self.reach_px).images for of in windows), strict=True)
                kept = [is_kept(*both) for both in cores]
                if not any(kept):
                    return ()
                stack, windows = stack[kept], (windows[0].take(kept), windows[1].take(kept))
            return zip(stack, function(*windows), strict=True)

        def of_block(block: _Numbers) -> list[tuple[int, R]]:
            piece = held or self._read(block)
            stacks = (block[k : k + self._most] for k in range(0, len(block), self._most))
            return [one for stack in stacks for one in of_stack(piece, stack)]

        found = [one for done in context.map(of_block, list(self._blocks(chips))) for one in done]
        found.sort(key=operator.itemgetter(0))
        return [number for number, _ in found], [result for _, result in found]

    @property
    def _side_px(self) -> int:
        return self.places.chip_px + 2 * self.reach_px

    @property
    def _corners(self) -> NDArray[np.int_]:
        return self.places.corners - self.reach_px

    @property
    def _most(self) -> int:
        """Most chips in a stack."""
        return max(_STACK_PIXELS // self._side_px**2, 1)

    def _blocks(self, chips: _Numbers) -> Iterator[_Numbers]:
        """Yield the numbers of chips in blocks that are read at once.

        From files, fewer pixels are read that way; from memory, a block is a stack.
        """
        if self.images.held is not None:
            yield from (chips[k : k + self._most] for k in range(0, len(chips), self._most))
            return
        if len(chips) == 0:
            return
        corners = self._corners[chips]
        size = np.ptp(corners, axis=0) + self._side_px
        is_dense = np.prod(size) <= len(chips) * self._side_px**2
        is_block = is_dense and size.max() <= max(_BLOCK_PX, 2 * self._side_px)
        if len(chips) == 1 or is_block:
            yield chips
            return
        along = corners[:, int(np.argmax(size))]
        first = along < (along.min() + along.max() + 1) / 2
        # Chips at the same position cannot be divided by position.
        if first.all():
            yield from (chips[k : k + 1] for k in range(len(chips)))
            return
        yield from self._blocks(chips[first])
        yield from self._blocks(chips[~first])

    def _read(self, block: _Numbers) -> _Piece:
        """Return both images over the area of the windows of a block's chips."""
        side, corners = self._side_px, self._corners[block]
        corner = corners.min(axis=0)
        width, height = (int(n) for n in np.ptp(corners, axis=0) + side)
        piece = self.places.grid.window(int(corner[0]), int(corner[1]), width, height)
        return corner, self.images.read(piece, self.hidden)

    def _cut(self, piece: _Piece, stack: _Numbers) -> tuple[Patch, Patch]:
        """Return the stacks of chips' reference and input windows in a piece."""
        corner, (reference, input) = piece
        corners, side = self._corners[stack] - corner, self._side_px
        inside = [np.s_[row : row + side, col : col + side] for col, row in corners]
        return _parts(reference, inside), _parts(input, inside)


def singly(function: Callable[[Patch, Patch], R]) -> Callable[[Patch, Patch], Iterable[R]]:
    """Return a function of stacks of windows that applies a function to each pair of windows."""

    def of_stacks(reference: Patch, input: Patch) -> Iterable[R]:
        return map(function, reference.images, input.images)

    return of_stacks


def _parts(patch: Patch, parts: list[tuple[slice, slice]]) -> Patch:
    """Return parts of a patch as a stack."""
    values, valid = ([of[part] for part in parts] for of in (patch.values, patch.valid))
    return Patch(np.stack(values), np.stack(valid))
