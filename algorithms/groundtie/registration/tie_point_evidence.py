"""Evidence for tie points that a transform is fitted to: their distribution and agreement."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np
from affine import Affine
from numpy.typing import NDArray

from ..errors import ParameterError, TooFewPointsError
from ..geometry.chance import log10_least_false_alarms
from ..geometry.fitting import ROUNDING, fit_model
from ..geometry.models import DEGREE, SHAPE_PRESERVING, Frame, fewest_points, monomials
from ..geometry.tie_points import TiePoints
from ..geometry.transform import Transform
from ..rasters.grid import FloatArray, Grid, apply_affine, metres_per_unit_at
from ..wording import counted
from .evidence import TIE_POINTS

# Models that do not mirror.
_SHAPES = ("translation", *SHAPE_PRESERVING)


@dataclass(frozen=True)
class TiePointFit:
    """How the transform that was fitted to tie points fits them.

    Parameters
    ----------
    points
        Number of points that it was fitted to.
    rmse_px
        Root mean square of their residuals in input pixels: no measure of accuracy.
    check_points
        Number of points that were held out.
    check_rmse_px
        Root mean square of their residuals; None if there are none.
    border_spread_px
        By how much the border of the raster moves, at most, if points err by 1 px.
    log10_chance
        log10 of the expected number of models that random points would fit as well; None: there are
        no more points than the model needs, so that any would fit.
    edited
        Number of points that a person moved or drew, by their lines or the column of that name.
    """

    points: int
    rmse_px: float
    check_points: int
    check_rmse_px: float | None
    border_spread_px: float
    log10_chance: float | None
    edited: int

    def lines(self) -> list[str]:
        """Return the fit as lines of text."""
        residuals = f"residuals of {self.rmse_px:.2f} px (RMSE)"
        lines = [f"fitted to {self.points} tie points with {residuals}"]
        if self.log10_chance is None:
            lines.append("warning: the model needs all of these points; none is left to check it")
        if self.check_rmse_px is not None:
            error = f"{self.check_rmse_px:.2f} px (RMSE)"
            lines.append(f"error at {self.check_points} check points: {error}")
        if self.edited:
            edited = f"edited by hand: {counted(self.edited, 'point')}"
            lines.append(f"{edited}; of lines the ends count, not the columns")
        return lines


@dataclass(frozen=True)
class TiePointEvidence:
    """Tie points that a person or a program set, and the model that is fitted to them.

    Parameters
    ----------
    points
        All points, with the CRS of their map.
    kind
        The model, one of `models.KINDS`.
    input_grid
        The raster's own grid.
    """

    points: TiePoints
    kind: str
    input_grid: Grid

    stages: ClassVar = (TIE_POINTS,)

    @classmethod
    def of(cls, points: TiePoints, kind: str, input_grid: Grid) -> TiePointEvidence:
        """Return the evidence of points.

        Raises
        ------
        TooFewPointsError
            They are fewer than the model needs.
        ParameterError
            The model can neither scale nor mirror pixels without a map, as a map needs.
        """
        is_scan = not input_grid.is_georeferenced and points.crs is not None
        if is_scan and kind in _SHAPES:
            raise ParameterError(
                f"the {kind} model cannot take a raster without georeferencing to a map, whose "
                "rows run downwards: give model affine, or one that bends"
            )
        found = cls(points, kind, input_grid)
        if found.count < found.needed:
            raise TooFewPointsError(
                f"the {kind} model needs at least {found.needed} points; there are {found.count}"
            )
        return found

    @property
    def needed(self) -> int:
        """How many points determine the model."""
        return fewest_points(self.kind)

    @cached_property
    def taken(self) -> NDArray[np.bool_]:
        """Which points the model is fitted to, shape (n,)."""
        return self.points.fit

    @property
    def count(self) -> int:
        """How many points the model is fitted to."""
        return int(self.taken.sum())

    @property
    def judged_by(self) -> str:
        """The model that agreement is judged by: a spline fits any points, its affine part not."""
        return "affine" if self.kind == "tps" else self.kind

    @property
    def side_px(self) -> int:
        """The raster's longer side."""
        return max(self.input_grid.size)

    @cached_property
    def border_spread_px(self) -> float:
        """By how much the raster's border moves, at most, if points err by 1 px; may be infinite.

        The square root of the largest leverage ([Hastie2009] 3.2) of the border; of a spline, that
        of its affine part.
        """
        places = self.points.input_px[self.taken]
        if not np.isfinite(places).all():
            return math.inf
        frame = Frame.around(places)
        uv, border = frame.enter(places), frame.enter(self.input_grid.outline())
        if self.kind in SHAPE_PRESERVING:
            design, at = (np.column_stack([np.ones(len(p)), p @ [1, 1j]]) for p in (uv, border))
        else:
            design, at = (monomials(p, DEGREE[self.judged_by]) for p in (uv, border))
        _, sizes, axes = np.linalg.svd(design, full_matrices=False)
        if sizes[-1] <= ROUNDING * sizes[0]:
            return math.inf
        leverage = (np.abs(at @ axes.conj().T / sizes) ** 2).sum(axis=1)
        return float(np.sqrt(leverage.max()))

    @cached_property
    def transform(self) -> Transform:
        """The transform, fitted by least squares."""
        return self._fitted(self.kind)

    def residuals_px(self, transform: Transform) -> FloatArray:
        """Return the residuals of all points, shape (n,), in input pixels."""
        with np.errstate(all="ignore"):
            return np.asarray(np.hypot(*self.points.residual_px(transform).T))

    @cached_property
    def log10_chance(self) -> float | None:
        """log10 of the expected number of models that random points fit as well; None: any fit.

        Points agree within whatever radius is the least likely ([Moisan2004]).
        """
        if self.count <= self.needed:
            return None
        sample = fewest_points(self.judged_by)
        residuals = self.residuals_px(self._fitted(self.judged_by))[self.taken]
        area = self.input_grid.width * self.input_grid.height
        return log10_least_false_alarms(residuals, area, sample)

    def fit(self) -> TiePointFit:
        """Return how the transform fits the points."""
        squared = self.residuals_px(self.transform) ** 2
        check = self.points.check
        return TiePointFit(
            points=self.count,
            rmse_px=float(np.sqrt(squared[self.taken].mean())),
            check_points=int(check.sum()),
            check_rmse_px=float(np.sqrt(squared[check].mean())) if check.any() else None,
            border_spread_px=self.border_spread_px,
            log10_chance=self.log10_chance,
            edited=int(self.points.edited.sum()),
        )

    @cached_property
    def _nominal_xy(self) -> FloatArray:
        return self.points.nominal_xy(Transform.nominal(self.points.crs, self.input_grid))

    def _fitted(self, kind: str) -> Transform:
        """Fit a model in metres, so that rigid ones preserve shapes also on maps in degrees."""
        reference_xy = self.points.reference_xy[self.taken]
        centre = reference_xy.mean(axis=0)
        width, height = metres_per_unit_at(centre, self.points.crs)[0]
        metres = Affine(1 / width, 0, centre[0], 0, 1 / height, centre[1])
        xy, nominal_xy = (
            apply_affine(~metres, places) for places in (reference_xy, self._nominal_xy[self.taken])
        )
        model = fit_model(kind, xy, nominal_xy).on_map(metres)
        return Transform(model, self.points.crs, self.input_grid)
