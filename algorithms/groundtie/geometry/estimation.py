"""An estimate of a transform, how it varies with its points, and the thin-plate spline's fit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import TooFewPointsError
from ..rasters.grid import Grid
from .fitting import fit_model
from .models import Frame, Model
from .robust import block_folds, fit_robustly
from .tie_points import TiePoints
from .transform import Transform

FloatArray = NDArray[np.float64]

# Standard deviation that right matches may have, in matching pixels.
SIGMA_RANGE_PX = (0.2, 2.5)


@dataclass(frozen=True)
class Estimate:
    """A transform, and what it was estimated from.

    Parameters
    ----------
    transform
        The transform.
    points
        The points of the fit, with those that it rejected.
    fold_models
        The model fitted again without one block of points after the other, from pixel positions
        of the matching grid to where the input claims them to be, in pixels of this grid.
    """

    transform: Transform
    points: TiePoints
    fold_models: tuple[Callable[[FloatArray], FloatArray], ...]

    def spread_px(self, at_px: FloatArray) -> FloatArray:
        """Return the standard deviation of predictions, shape (n,), in matching pixels.

        By the jackknife over blocks of neighbouring points ([Efron1993], chapter 11),
        so it grows where the points do not hold the model.

        Parameters
        ----------
        at_px
            Where to predict, pixel positions of the matching grid, shape (n, 2).
        """
        return jackknife_spread(self.fold_models, at_px)


def jackknife_spread(
    fold_models: Sequence[Callable[[FloatArray], FloatArray]], at_px: FloatArray
) -> FloatArray:
    """Return the standard deviation of predictions, shape (n,), at positions, shape (n, 2).

    Infinite for fewer than two models, each of which was fitted without one block of points.
    """
    count = len(fold_models)
    if count < 2:
        return np.full(len(at_px), np.inf)
    predictions = [model(at_px) for model in fold_models]
    return np.asarray(np.sqrt(np.var(predictions, axis=0).sum(axis=1) * (count - 1)))


def fit_thin_plate(
    points: TiePoints, as_claimed: Transform, grid: Grid, start: Model, radius_px: float
) -> tuple[Model, tuple[Model, ...]]:
    """Fit a thin-plate spline to tie points of which some may be wrong.

    Parameters
    ----------
    points
        Points of the fit.
    as_claimed
        The transform that believes the input's georeferencing.
    grid
        The matching grid.
    start
        A simpler model of the same, between pixel positions of the grid.
    radius_px
        How far wrong matches may have fallen from the truth, in matching pixels.

    Returns
    -------
    model, fold_models
        The spline, and those without one block of points after the other (see `Estimate`).

    Raises
    ------
    TooFewPointsError
        Fewer points agree than the spline needs.
    """
    used = points.take(points.used)
    px = grid.map_to_pixel(used.reference_xy)
    claimed_px = grid.map_to_pixel(as_claimed.claimed_xy(used.input_px))
    if len(used) < 4:
        raise TooFewPointsError(f"only {len(used)} points were matched")
    variances = np.trace(used.covariance_px2, axis1=1, axis2=2) / 2
    area = (2 * radius_px + 1) ** 2
    model, mixture = fit_robustly("tps", px, claimed_px, variances, start, area, SIGMA_RANGE_PX)
    weights = np.where(mixture.right, 1 / (mixture.sigma**2 + variances), 0.0)
    folds = block_folds(px)
    fold_models = [
        fit_model("tps", px, claimed_px, np.where(folds == fold, 0.0, weights), Frame.around(px))
        for fold in np.unique(folds)
    ]
    return model, tuple(fold_models)
