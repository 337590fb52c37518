"""The windows of chips in both images, resampled for a block of neighbouring chips at a time.

Windows of neighbours overlap: resampled chip by chip, most pixels would be made several times.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ..context import Context
from ..geometry.models import Model
from ..rasters.grid import Grid, PointFunction
from ..rasters.held_images import held_onto
from ..rasters.pair import ImagePair
from ..rasters.patch import Patch
from .matcher import MaskOf, Places

R = TypeVar("R")

# Returns what of the input is looked at, given the reference and the input.
LeftOf = Callable[[Patch, Patch], Patch]

_Numbers = NDArray[np.intp]

# The upper left corner of a piece of a grid, and both images there.
_Piece = tuple[NDArray[np.int_], tuple[Patch, Patch]]

# Longest side of a block that is read from files, in pixels: enough of them for all threads, and
# each in the processor's cache.
_BLOCK_PX = 384

# Images of so many pixels are resampled as a whole: 5 bytes each are held for either.
_HELD_PIXELS = 4_000_000

# Windows are worked in stacks of about so many pixels. Larger ones leave the processor's cache; of
# smaller ones, threads wait more often for one another: `benchmarks/run.py --only kernels`.
_STACK_PIXELS = 131_072


@dataclass(frozen=True)
class Resampled:
    """Two images, the input where a model has it: what windows of chips are cut out of.

    Parameters
    ----------
    pair
        The images.
    to_input
        Takes map positions, shape (n, 2), to the pixels of the input that are shown there.
    is_held
        Whether both lie in memory on the grid of the chips.
    """

    pair: ImagePair
    to_input: PointFunction
    is_held: bool = False

    @classmethod
    def by_model(
        cls, pair: ImagePair, model: Model, grid: Grid, reach_px: int, context: Context
    ) -> Resampled:
        """Resample images by the misregistration on the map; parameters as `of`."""
        return cls.of(pair, pair.transform(model), grid, reach_px, context)

    @classmethod
    def of(
        cls, pair: ImagePair, to_input: PointFunction, grid: Grid, reach_px: int, context: Context
    ) -> Resampled:
        """Resample images as a whole if they are small; of large ones chips show a part alone.

        Parameters
        ----------
        pair, to_input
            See the class.
        grid
            The grid on which chips are matched.
        reach_px
            How far windows of chips reach beyond it.
        context
            Threads.
        """
        width, height = grid.width + 2 * reach_px, grid.height + 2 * reach_px
        if width * height > _HELD_PIXELS:
            return cls(pair, to_input)
        around, quiet = grid.window(-reach_px, -reach_px, width, height), context.quiet()
        to_reference = pair.reference.source.grid.map_to_pixel
        held = replace(
            pair,
            reference=held_onto(pair.reference, around, to_reference, quiet),
            input=held_onto(pair.input, around, to_input, quiet),
        )
        return cls(held, around.map_to_pixel, is_held=True)

    def read(self, piece: Grid, hidden: MaskOf | None = None) -> tuple[Patch, Patch]:
        """Return both images on a piece of the grid, the reference without what is hidden."""
        reference = self.pair.reference_patch(piece, None if hidden is None else hidden(piece))
        return reference, self.pair.input_patch(piece, self.to_input)


@dataclass(frozen=True)
class ChipWindows:
    """Windows of chips, and of so many pixels around them, of both images of a pair.

    Parameters
    ----------
    images
        The images.
    places
        The chips.
    reach_px
        Pixels around a chip on each side.
    hidden
        Returns for a piece of a grid which pixels of the reference must not be seen; None: all
        may be.
    left_of
        What of the input is looked at; None: all is.
    """

    images: Resampled
    places: Places
    reach_px: int
    hidden: MaskOf | None
    left_of: LeftOf | None = None

    def map(
        self,
        function: Callable[[Patch, Patch], Iterable[R]],
        context: Context,
        is_kept: Callable[[Patch, Patch], bool] | None = None,
    ) -> tuple[list[int], list[R]]:
        """Return what `function` makes of chips' windows, and the numbers of these chips, in order.

        It takes a stack of reference windows, shape (n, h, w), and that of their input windows, and
        returns what it makes of each. `is_kept` takes a chip in both images, without what is around
        it, and returns whether its windows are looked at; None: all are.
        """
        chips = np.arange(len(self.places.centres))
        held = self._read(chips) if self.images.is_held and len(chips) else None

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
        return self.places.centres - self.places.chip_px // 2 - self.reach_px

    @property
    def _most(self) -> int:
        """How many chips a stack has."""
        return max(_STACK_PIXELS // self._side_px**2, 1)

    def _blocks(self, chips: _Numbers) -> Iterator[_Numbers]:
        """Yield chips, by number, in blocks that are read as one.

        In files, that reads fewer pixels; from memory, a block is a stack.
        """
        if self.images.is_held:
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
        # Chips at one place cannot be parted.
        if first.all():
            yield from (chips[k : k + 1] for k in range(len(chips)))
            return
        yield from self._blocks(chips[first])
        yield from self._blocks(chips[~first])

    def _read(self, block: _Numbers) -> _Piece:
        """Return both images where the windows of a block's chips lie."""
        side, corners = self._side_px, self._corners[block]
        corner = corners.min(axis=0)
        width, height = (int(n) for n in np.ptp(corners, axis=0) + side)
        piece = self.places.grid.window(int(corner[0]), int(corner[1]), width, height)
        reference, input = self.images.read(piece, self.hidden)
        left = input if self.left_of is None else self.left_of(reference, input)
        return corner, (reference, left)

    def _cut(self, piece: _Piece, stack: _Numbers) -> tuple[Patch, Patch]:
        """Return the stacks of chips' reference and input windows in a piece."""
        corner, (reference, input) = piece
        corners, side = self._corners[stack] - corner, self._side_px
        inside = [np.s_[row : row + side, col : col + side] for col, row in corners]
        return _parts(reference, inside), _parts(input, inside)


def singly(function: Callable[[Patch, Patch], R]) -> Callable[[Patch, Patch], Iterable[R]]:
    """Return the function of stacks of windows that a function of single windows makes."""

    def of_stacks(reference: Patch, input: Patch) -> Iterable[R]:
        return map(function, reference.images, input.images)

    return of_stacks


def _parts(patch: Patch, parts: list[tuple[slice, slice]]) -> Patch:
    """Return the stack of a patch's parts."""
    values, valid = ([of[part] for part in parts] for of in (patch.values, patch.valid))
    return Patch(np.stack(values), np.stack(valid))
