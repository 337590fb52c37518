"""Tie points: places found in both images."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from rasterio.crs import CRS

from ..rasters.grid import FloatArray, Grid, near_longitude
from .rows import Rows
from .transform import Transform

if TYPE_CHECKING:
    from typing import Self  # Python 3.11; annotations alone need it

USED = "used"

# Further column, 1 for points that a person moved or drew.
EDITED = "edited"

NONE_HELD_OUT = (
    "no points took no part in the fit: give check points, or tie points with the role check"
)


@dataclass(frozen=True, eq=False)
class TiePoints(Rows):
    """A table of tie points, one row a point.

    Parameters
    ----------
    reference_xy
        Position on the reference map, shape (n, 2).
    input_px
        Position in the input image (col, row), pixel centres at integers, shape (n, 2).
    score
        Height of the similarity surface's peak in robust standard deviations of it, shape (n,).
    covariance_px2
        Covariance of the match (x along columns, y along rows) in matching pixels², (n, 2, 2).
    forward_backward_error_px
        Distance between the point and its match back, in matching pixels, shape (n,).
    is_check
        True for check points, which are held out of every fit, shape (n,).
    state
        "used" or "rejected: …" with the reason, shape (n,).
    crs
        CRS of the reference map; None: that of the transform at hand, or no CRS at all.
    more
        Further columns of numbers, shape (n,) each, by name.
    states_fit
        Whether the file that the points were read from gives any point the role fit.
    """

    reference_xy: FloatArray
    input_px: FloatArray
    score: FloatArray
    covariance_px2: FloatArray
    forward_backward_error_px: FloatArray
    is_check: NDArray[np.bool_]
    state: NDArray[np.str_]
    crs: CRS | None = None
    more: dict[str, FloatArray] = field(default_factory=dict)
    states_fit: bool = False

    @property
    def used(self) -> NDArray[np.bool_]:
        """Which points are not rejected, shape (n,)."""
        return np.asarray(self.state == USED)

    @property
    def fit(self) -> NDArray[np.bool_]:
        """Which points a model is fitted to, shape (n,)."""
        return self.used & ~self.is_check

    @property
    def check(self) -> NDArray[np.bool_]:
        """Which points are check points that are not rejected, shape (n,)."""
        return self.used & self.is_check

    @property
    def has_roles(self) -> bool:
        """Whether roles, of a fit or of check points, are stated."""
        return self.states_fit or bool(self.check.any())

    @property
    def independent(self) -> NDArray[np.bool_]:
        """Which points can serve as check points of a transform fitted to others, shape (n,).

        Points with the role check, or all used points if the file states no roles.
        """
        return self.check if self.has_roles else self.used

    @property
    def located(self) -> NDArray[np.bool_]:
        """Which points have a place in the input, shape (n,).

        An image with RPCs has none where the height of the ground is not known.
        """
        return np.asarray(np.isfinite(self.input_px).all(axis=1))

    @property
    def edited(self) -> NDArray[np.bool_]:
        """Which points a person moved, added or drew, shape (n,)."""
        return np.asarray(self.more.get(EDITED, np.zeros(len(self))) > 0)

    def nominal_xy(self, transform: Transform) -> FloatArray:
        """Return the nominal positions on the reference map, shape (n, 2), by a transform's input.

        Across the antimeridian, longitudes continue those of the points. Without a CRS of the
        input, the positions are its pixels'.
        """
        nominal = transform.nominal_xy(self.input_px)
        if transform.input_grid.crs is None:
            return nominal
        return near_longitude(nominal, self.reference_xy[:, :1], transform.crs)

    def residual_px(self, transform: Transform) -> FloatArray:
        """Return `input_px` minus the positions by `transform`, in input pixels, (n, 2)."""
        return np.asarray(self.input_px - transform(self.reference_xy))

    def residual_on(self, grid: Grid, transform: Transform) -> FloatArray:
        """Return nominal minus predicted positions in pixels of a grid of the reference, (n, 2).

        The pixels are those of chips, in which the input is scaled and rotated onto the reference.
        """
        nominal = grid.map_to_pixel(self.nominal_xy(transform))
        missed = nominal - grid.map_to_pixel(transform.model(self.reference_xy))
        return np.asarray(missed @ transform.onto_reference(grid))

    def exchanged(self, reference_grid: Grid, input_grid: Grid) -> TiePoints:
        """Return points that were found with the images' roles exchanged, in the original roles.

        Parameters
        ----------
        reference_grid, input_grid
            The georeferencing of the images, in their original roles.
        """
        return replace(
            self,
            reference_xy=reference_grid.pixel_to_map(self.input_px),
            input_px=input_grid.map_to_pixel(self.reference_xy),
        )

    def reject(self, which: NDArray[np.bool_], reason: str) -> Self:
        """Return the table with the used points among `which` rejected for a reason."""
        state = self.state.astype(object)
        state[which & self.used] = f"rejected: {reason}"
        return replace(self, state=state.astype(str))

    def take(self, which: Any) -> Self:
        """Return the rows that the index or mask `which` selects."""
        more = {name: values[which] for name, values in self.more.items()}
        return replace(super().take(which), more=more)

    @classmethod
    def unmeasured(
        cls,
        reference_xy: FloatArray,
        input_px: FloatArray,
        crs: CRS | None,
        states: Sequence[str] | None = None,
    ) -> TiePoints:
        """Return points of the fit of which only positions and states (None: used) are known."""
        count = len(reference_xy)
        unknown = np.full(count, np.nan)
        return cls(
            reference_xy,
            input_px,
            unknown,
            np.full((count, 2, 2), np.nan),
            unknown,
            np.zeros(count, bool),
            np.full(count, USED) if states is None else np.array(states, str),
            crs,
        )

    @classmethod
    def none(cls) -> TiePoints:
        """Return a table without rows."""
        return cls.unmeasured(np.zeros((0, 2)), np.zeros((0, 2)), None)

    @classmethod
    def concatenate(cls, tables: Sequence[TiePoints]) -> TiePoints:
        """Return the rows of all tables, which share one map and the same further columns."""
        names = tables[0].more
        more = {name: np.concatenate([t.more[name] for t in tables]) for name in names}
        return replace(super().concatenate(tables), more=more)
