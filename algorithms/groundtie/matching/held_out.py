"""What is held out of everything but the check: one object that every earlier step asks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..rasters.grid import Grid
from ..rasters.kernels import REACH
from ..rasters.pair import ImagePair
from .layout import ChipLayout, lay_out_chips


@dataclass(frozen=True)
class HeldOut:
    """The blocks of the reference that nothing but check chips may see.

    Called with a grid on the map, it returns which of its pixels are to be masked.

    Parameters
    ----------
    layout
        The chips of the fit and the check chips, with the blocks between them.
    grid
        The matching grid, which the layout covers.
    reference_grid
        The reference's own pixels.
    """

    layout: ChipLayout
    grid: Grid
    reference_grid: Grid

    @classmethod
    def of(cls, pair: ImagePair) -> HeldOut:
        """Lay out a pair; errors as `lay_out_chips`."""
        return cls(lay_out_chips(pair), pair.grid, pair.reference.source.grid)

    def __call__(self, piece: Grid) -> NDArray[np.bool_]:
        """Return which pixels of a grid, of any pixel size, see a part of held-out blocks, (h, w).

        The grid is a part of the matching grid's own lattice or of a coarser one along its axes.
        """
        cols = np.arange(piece.width, dtype=float)
        rows = np.arange(piece.height, dtype=float)
        along_cols = piece.pixel_to_map(np.column_stack([cols, np.zeros_like(cols)]))
        along_rows = piece.pixel_to_map(np.column_stack([np.zeros_like(rows), rows]))
        return self.layout.held_out_mask(
            self.grid.map_to_pixel(along_cols)[:, 0],
            self.grid.map_to_pixel(along_rows)[:, 1],
            self._reach_px(piece),
        )

    def _reach_px(self, piece: Grid) -> float:
        """Return how far off a piece's pixel sees of the reference, in matching pixels."""
        size, matching, piece_size = (
            grid.pixel_size[0] for grid in (self.reference_grid, self.grid, piece)
        )
        if np.allclose([matching / size, piece_size / size], 1.0):
            return 0.0  # the reference's own pixels
        # Larger pixels are interpolated between means of the reference's: see `warping.sample`.
        averaged = max(round(piece_size / size), 1)
        return (REACH["cubic"] + 0.5) * averaged * size / matching
