"""Estimates of a transform, their variation with the points, and the fit of thin-plate splines."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..errors import TooFewPointsError
from ..rasters.grid import FloatArray, Grid, PointFunction
from ..rasters.pair import ImagePair
from .fitting import fit_model
from .model_choice import left_out_blocks
from .models import Frame, Model, fewest_points
from .robust import fit_robustly
from .tie_points import TiePoints
from .transform import Transform


@dataclass(frozen=True)
class Fitted:
    """A model that was fitted on the matching grid.

    Parameters
    ----------
    model
        From pixel positions of the matching grid to the input's nominal positions, in pixels of
        the same grid.
    fold_models
        The same kind of model, each fitted without one block of points, for the jackknife.
    """

    model: Model
    fold_models: tuple[Model, ...]


@dataclass(frozen=True)
class Estimate:
    """A transform, and the points that it was estimated from.

    Parameters
    ----------
    transform
        The transform.
    points
        The points of the fit, rejected ones included.
    fold_models
        See `Fitted`.
    notes
        What a user should know about how the points were matched.
    """

    transform: Transform
    points: TiePoints
    fold_models: tuple[PointFunction, ...]
    notes: tuple[str, ...] = ()

    @classmethod
    def of(
        cls, kind: str, fitted: Fitted, points: TiePoints, pair: ImagePair, radius_px: float
    ) -> Estimate:
        """Return the estimate by a fitted model, or by a thin-plate spline that starts from it.

        Parameters
        ----------
        kind
            Kind of the model requested.
        fitted
            The model, or the start of the spline's fit.
        points
            Points of the fit.
        pair
            The images.
        radius_px
            See `fit_thin_plate`.

        Raises
        ------
        TooFewPointsError
            Fewer points agree than a spline needs.
        """
        grid = pair.grid
        if kind == "tps":
            nominal = Transform.nominal(grid.crs, pair.input.source.grid)
            fitted = fit_thin_plate(points, nominal, grid, fitted.model, radius_px)
        transform = pair.transform(fitted.model.on_map(grid.centre_transform))
        return cls(transform, points, fitted.fold_models)

    def folds_on(self, grid: Grid) -> tuple[PointFunction, ...]:
        """Return the folds' models in pixels of the matching grid on the reference.

        Only differences between the models are meaningful, not what is common to all of them. The
        models predict nominal pixels, which the transform may scale and rotate.
        """
        matrix = self.transform.onto_reference(grid)

        def onto(fold: PointFunction, px: FloatArray) -> FloatArray:
            return np.asarray(fold(px) @ matrix)

        return tuple(partial(onto, fold) for fold in self.fold_models)


def jackknife_spread(fold_models: Sequence[PointFunction], at_px: FloatArray) -> FloatArray:
    """Return the standard deviation of predictions, shape (n,), at positions, shape (n, 2).

    The deviation is that of both axes together, and infinite for fewer than two models. Each model
    was fitted without one block of neighbouring points, so that the deviation grows where the
    points constrain the model poorly. Source: [Efron1993], chapter 11.
    """
    if len(fold_models) < 2:
        return np.full(len(at_px), np.inf)
    deviations = jackknife_deviations([model(at_px) for model in fold_models])
    return np.asarray(np.sqrt((deviations**2).sum(axis=(0, 2))))


def jackknife_deviations(estimates: Sequence[FloatArray]) -> FloatArray:
    """Return deviations, shape (n, …), of n estimates without one block each, shape (…) each.

    Sums of their products are variances and covariances. Source: [Efron1993], chapter 11.
    """
    values = np.asarray(estimates, float)
    count = len(values)
    return np.asarray((values - values.mean(axis=0)) * np.sqrt((count - 1) / count))


def fit_without_blocks(
    kind: str, px: FloatArray, nominal_px: FloatArray, weights: FloatArray
) -> tuple[Model, ...]:
    """Return the models of a kind that each leave out one block of points.

    Parameters are those of `fit_model`, in pixels; all models have one frame.

    Raises
    ------
    TooFewPointsError
        Fewer points than the model needs are left.
    """
    if len(px) == 0:
        raise TooFewPointsError(f"the {kind} model needs points; there are none")
    frame = Frame.around(px)
    return tuple(
        fit_model(kind, px, nominal_px, np.where(block, 0.0, weights), frame)
        for block in left_out_blocks(px)
    )


def fit_thin_plate(
    points: TiePoints, nominal: Transform, grid: Grid, start: Model, radius_px: float
) -> Fitted:
    """Fit a thin-plate spline to tie points, some of which may be outliers.

    Parameters
    ----------
    points
        Points of the fit.
    nominal
        The transform by the input's own georeferencing.
    grid
        The matching grid.
    start
        A simpler model of the same displacement, between pixel positions of the grid.
    radius_px
        Largest distance of outliers from the true position, in matching pixels.

    Raises
    ------
    TooFewPointsError
        Fewer points agree than the spline needs.
    """
    used = points.take(points.used)
    px = grid.map_to_pixel(used.reference_xy)
    nominal_px = grid.map_to_pixel(used.nominal_xy(nominal))
    if len(used) < fewest_points("tps"):
        raise TooFewPointsError(f"only {len(used)} points were matched")
    variances = np.trace(used.covariance_px2, axis1=1, axis2=2) / 2
    area = (2 * radius_px + 1) ** 2
    model, mixture = fit_robustly("tps", px, nominal_px, variances, start, area)
    weights = np.where(mixture.inliers, 1 / (mixture.sigma**2 + variances), 0.0)
    return Fitted(model, fit_without_blocks("tps", px, nominal_px, weights))
