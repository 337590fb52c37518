"""Tie points: places found in both images."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..rasters.grid import Grid
from .transform import Transform

FloatArray = NDArray[np.float64]
USED = "used"


@dataclass(frozen=True)
class TiePoints:
    """A table of tie points, one row a point.

    Parameters
    ----------
    reference_xy
        Position on the reference map, shape (n, 2).
    input_px
        Position in the input image (col, row), pixel centres at integers, shape (n, 2).
    score
        Height of the similarity's peak in robust standard deviations of its surface, shape (n,).
    covariance_px2
        Covariance of the match (x along columns, y along rows) in matching pixels², (n, 2, 2).
    forward_backward_error_px
        Distance between the match and its match back, in matching pixels, shape (n,).
    is_check
        True for points that are held out of every fit, shape (n,).
    state
        "used" or "rejected: …" with the reason, shape (n,).
    """

    reference_xy: FloatArray
    input_px: FloatArray
    score: FloatArray
    covariance_px2: FloatArray
    forward_backward_error_px: FloatArray
    is_check: NDArray[np.bool_]
    state: NDArray[np.str_]

    def __len__(self) -> int:
        return len(self.reference_xy)

    @property
    def used(self) -> NDArray[np.bool_]:
        """Which points are not rejected, shape (n,)."""
        return np.asarray(self.state == USED)

    @property
    def role(self) -> NDArray[np.str_]:
        """The points' role, "fit" or "check", shape (n,)."""
        return np.where(self.is_check, "check", "fit")

    def residual_px(self, transform: Transform) -> FloatArray:
        """Return `input_px` minus where `transform` puts the points, in input pixels, (n, 2)."""
        return np.asarray(self.input_px - transform(self.reference_xy))

    def residual_on(self, grid: Grid, transform: Transform) -> FloatArray:
        """Return claimed minus predicted positions in pixels of a grid on the map, (n, 2)."""
        claimed = grid.map_to_pixel(transform.nominal_xy(self.input_px))
        return claimed - grid.map_to_pixel(transform.model(self.reference_xy))

    def reject(self, which: NDArray[np.bool_], reason: str) -> TiePoints:
        """Return the table in which the points `which` that were used are so no longer."""
        state = self.state.astype(object)
        state[which & self.used] = f"rejected: {reason}"
        return replace(self, state=state.astype(str))

    def take(self, which: Any) -> TiePoints:
        """Return the rows that the index or mask `which` selects."""
        return TiePoints(**{name: getattr(self, name)[which] for name in _FIELDS})

    @classmethod
    def concatenate(cls, tables: list[TiePoints]) -> TiePoints:
        """Return the rows of all tables, one after the other."""
        return cls(**{name: np.concatenate([getattr(t, name) for t in tables]) for name in _FIELDS})


_FIELDS = tuple(TiePoints.__dataclass_fields__)
