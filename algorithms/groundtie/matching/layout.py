"""Layout of chips in the matching grid, and of the blocks held out for the verdict.

The scene is divided into cells. In the middle of each cell, a block of 60 % of its side is held
out: the reference pixels in it take no part in the coarse search, the tie points of the fit, the
choice of the model or the removal of outliers. Check chips lie inside the blocks, chips of the fit
on the lines between the cells.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..errors import NoOverlapError
from ..rasters.grid import mesh
from ..rasters.pair import ImagePair

# Share of a cell's side that is held out. Check chips must match on their own, so they get the
# larger part; chips of the fit share the rest of the cell and support each other.
_HELD_OUT = 0.6

# Number of cells along a scene's shorter side: the first, plus one for every `_CELL_PX` pixels.
_FIRST_CELLS, _CELL_PX = 2.2, 300
_FEWEST_CELLS, _MOST_CELLS = 3, 6

# Sides of chips, in pixels.
_CHIP_RANGE_PX = (24, 80)
_LARGEST_CHECK_CHIP_PX = 112

# Two cells and the rim, with the smallest chips.
_LEAST_OVERLAP_PX = round(_CHIP_RANGE_PX[0] * (1 + 2 / (1 - _HELD_OUT)))

# Above this number, chips of the fit are laid out half as densely.
_MANY_CHIPS = 200


def default_chip_px(width: int, height: int) -> int:
    """Return the side of a chip of the fit for a scene of this size, in pixels."""
    shorter = min(width, height)
    cells = int(np.clip(_FIRST_CELLS + shorter / _CELL_PX, _FEWEST_CELLS, _MOST_CELLS))
    between = 1 - _HELD_OUT
    return int(np.clip(between * shorter / (cells + between), *_CHIP_RANGE_PX))


@dataclass(frozen=True)
class Axis:
    """The cells along one side of the scene; `size` and `chip` are in matching pixels."""

    size: int
    chip: int
    cells: int

    @property
    def pitch(self) -> float:
        """Distance between the lines on which chips of the fit lie."""
        return (self.size - self.chip) / self.cells

    @property
    def first(self) -> float:
        """Centre of the first chip."""
        return (self.chip - 1) / 2

    @property
    def block(self) -> float:
        """Side of the held-out block in the middle of each cell."""
        return _HELD_OUT * self.pitch

    def held_out(self, positions: NDArray[np.float64], reach_px: float = 0.0) -> NDArray[np.bool_]:
        """Return which positions lie in the held-out part of their cell, or within reach of it."""
        phase = ((positions - self.first) / self.pitch) % 1.0
        inside = (positions >= self.first) & (positions <= self.first + self.cells * self.pitch)
        # A chip of the fit may end exactly at the block, whatever rounding does to the last digit.
        half = _HELD_OUT / 2 + reach_px / self.pitch - 1e-9
        return np.asarray(inside & (np.abs(phase - 0.5) < half))

    def divided(self, parts: int) -> NDArray[np.float64]:
        """Return positions that divide each cell into equal parts, cell borders included."""
        return np.asarray(self.first + np.arange(self.cells * parts + 1) * self.pitch / parts)

    def check_centres(self, check_chip: int) -> NDArray[np.float64]:
        """Return the centres of chips inside the held-out blocks, one or two per block."""
        middles = np.asarray(self.first + (np.arange(self.cells) + 0.5) * self.pitch)
        # Rounding a centre moves a chip by half a pixel; it must stay inside its block.
        half = (self.block - check_chip) / 2 - 1
        if half < check_chip / 2:
            return middles
        return np.sort(np.concatenate([middles - half, middles + half]))


@dataclass(frozen=True)
class ChipLayout:
    """Chips of the fit and check chips over the matching grid.

    Parameters
    ----------
    columns, rows
        The cells along both sides.
    parts
        Number of parts into which chips of the fit divide a cell's side, 2 or 4.
    """

    columns: Axis
    rows: Axis
    parts: int

    @property
    def chip_px(self) -> int:
        """Side of a chip of the fit."""
        return self.columns.chip

    @property
    def check_chip_px(self) -> int:
        """Side of a check chip."""
        # Rounding a centre moves a chip by half a pixel; it must stay inside its block.
        largest = int(min(self.columns.block, self.rows.block)) - 2
        return min(largest, _LARGEST_CHECK_CHIP_PX)

    @property
    def spacing_px(self) -> float:
        """Distance between neighbouring chips of the fit."""
        return max(self.columns.pitch, self.rows.pitch) / self.parts

    @cached_property
    def fit_centres(self) -> NDArray[np.int_]:
        """Centres (col, row) of the chips of the fit, shape (n, 2)."""
        cols, rows = self.columns.divided(self.parts), self.rows.divided(self.parts)
        on_line_col = np.arange(len(cols)) % self.parts == 0
        on_line_row = np.arange(len(rows)) % self.parts == 0
        on_line = on_line_row[:, None] | on_line_col[None, :]
        return _middle_pixels(mesh(cols, rows)[on_line.ravel()], self.chip_px)

    @cached_property
    def check_centres(self) -> NDArray[np.int_]:
        """Centres (col, row) of the check chips, shape (n, 2)."""
        chip = self.check_chip_px
        sides = (axis.check_centres(chip) for axis in (self.columns, self.rows))
        return _middle_pixels(mesh(*sides), chip)

    def neighbourhoods(self, centres_px: NDArray[np.int_]) -> NDArray[np.int_]:
        """Return the number of the square of 2 × 2 cells that holds each (col, row), (n, 2)."""
        col, row = (
            ((centres_px[:, k] - axis.first) // (2 * axis.pitch)).astype(int)
            for k, axis in enumerate((self.columns, self.rows))
        )
        return np.asarray(row * self.columns.cells + col)

    def held_out(
        self, cols: NDArray[np.float64], rows: NDArray[np.float64], reach_px: float = 0.0
    ) -> NDArray[np.bool_]:
        """Return which positions on the matching grid are held out; shapes broadcast.

        A sample that depends on its surroundings, such as an interpolated pixel, is held out, too,
        if it lies within `reach_px` of a held-out block.
        """
        return self.columns.held_out(cols, reach_px) & self.rows.held_out(rows, reach_px)


def _middle_pixels(centres: NDArray[np.float64], chip_px: int) -> NDArray[np.int_]:
    """Return the middle pixels of the chips whose pixels are best centred on positions."""
    corners = np.round(centres - (chip_px - 1) / 2).astype(int)
    return np.asarray(corners + chip_px // 2)


def lay_out_chips(pair: ImagePair) -> ChipLayout:
    """Lay chips out over the matching grid of a pair, by the size of its overlap.

    Raises
    ------
    NoOverlapError
        The overlap is too small for two cells of chips along each side.
    """
    if min(pair.overlap_px) < _LEAST_OVERLAP_PX:
        raise NoOverlapError(
            f"{pair.input.source.path} and {pair.reference.source.path} overlap by "
            f"{pair.overlap_px[0]} × {pair.overlap_px[1]} matching pixels; at least "
            f"{_LEAST_OVERLAP_PX} × {_LEAST_OVERLAP_PX} are needed"
        )
    chip = default_chip_px(*pair.overlap_px)
    smallest_pitch = chip / (1 - _HELD_OUT)

    def layout(parts: int) -> ChipLayout:
        axes = []
        for size, overlap in zip(pair.grid.size, pair.overlap_px, strict=True):
            most = max(int((size - chip) / smallest_pitch + 1e-6), 1)
            cells = round(_MOST_CELLS * size / overlap)
            axes.append(Axis(size, chip, int(np.clip(cells, 1, most))))
        return ChipLayout(axes[0], axes[1], parts)

    dense = layout(4)
    return dense if len(dense.fit_centres) <= _MANY_CHIPS else layout(2)
