"""The mask of pixels held out of every step before the check."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..rasters.grid import POSITION_ERROR_PX, FloatArray, Grid, compose, mesh
from ..rasters.kernels import REACH
from ..rasters.pair import ImagePair
from .layout import ChipLayout, lay_out_chips


@dataclass(frozen=True)
class HeldOut:
    """The blocks of the reference that only check chips may see.

    Called with a grid on the map, it returns which of its pixels to mask.

    Parameters
    ----------
    layout
        The chips of the fit, the check chips, and the held-out blocks.
    grid
        The matching grid, which the layout covers.
    reference_grid
        The reference's own grid.
    """

    layout: ChipLayout
    grid: Grid
    reference_grid: Grid

    @classmethod
    def of(cls, pair: ImagePair) -> HeldOut:
        """Lay out a pair; errors as `lay_out_chips`."""
        return cls(lay_out_chips(pair), pair.grid, pair.reference.source.grid)

    def __call__(self, piece: Grid) -> NDArray[np.bool_]:
        """Return which pixels of a grid, of any pixel size, depend on held-out blocks, (h, w).

        The grid is mostly a part of the matching grid or of a coarser one along its axes, which is
        evaluated by whole columns and rows; other grids are evaluated pixel by pixel.
        """
        cols, rows = np.arange(piece.width, dtype=float), np.arange(piece.height, dtype=float)
        reach = self._reach_px(piece)
        if not self._has_axes_of(piece):
            x, y = self._matching_px(piece, mesh(cols, rows)).T
            return self.layout.held_out(x, y, reach).reshape(piece.height, piece.width)
        along_cols = self._matching_px(piece, np.column_stack([cols, np.zeros_like(cols)]))
        along_rows = self._matching_px(piece, np.column_stack([np.zeros_like(rows), rows]))
        return self.layout.held_out(along_cols[:, 0], along_rows[:, 1:], reach)

    def _matching_px(self, piece: Grid, px: FloatArray) -> FloatArray:
        return self.grid.map_to_pixel(piece.pixel_to_map(px))

    def _has_axes_of(self, piece: Grid) -> bool:
        """Return whether columns and rows of a piece are parallel to those of the matching grid."""
        across = compose(~self.grid.transform, piece.transform)
        off_px = max(abs(across.d) * piece.width, abs(across.b) * piece.height)
        return bool(off_px < POSITION_ERROR_PX)

    def _reach_px(self, piece: Grid) -> float:
        """Return how far a piece's pixel reaches into the reference, in matching pixels."""
        size, matching, piece_size = (
            grid.pixel_size[0] for grid in (self.reference_grid, self.grid, piece)
        )
        if np.allclose([matching / size, piece_size / size], 1.0) and self._has_axes_of(piece):
            return 0.0  # the reference's own pixels
        # Other pixels are interpolated between the reference's pixels, and larger ones between
        # means of these, along the reference's axes: see `warping.sample`.
        averaged = max(round(piece_size / size), 1)
        return (REACH["cubic"] + 0.5) * averaged * size / matching
