"""From tie points to a transform: robust fit, choice of the model, and how far it can be trusted."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from affine import Affine
from numpy.typing import NDArray

from ..errors import TooFewPointsError
from ..rasters.grid import Grid
from .fitting import fit_model
from .models import DEGREE, Frame, Model
from .robust import distances, find_consensus, fit_robustly
from .selection import block_folds, choose_kind
from .tie_points import TiePoints
from .transform import Transform

FloatArray = NDArray[np.float64]
AUTO = "auto"

# Points of the fit agree with a first model of degree 1 within this, in matching pixels; local
# distortion beyond it must be left to the search.
_CONSENSUS_PX = 3.0

# Standard deviation that right matches may have, in matching pixels.
_SIGMA_RANGE_PX = (0.2, 2.5)


@dataclass(frozen=True)
class Estimate:
    """A transform fitted to tie points.

    Parameters
    ----------
    transform
        The transform.
    points
        The points of the fit, with those that it rejected.
    sigma_px
        Standard deviation of the right matches along an axis, in matching pixels.
    cross_validation_px
        For the models that were compared, RMSE at left-out points, in matching pixels.
    """

    transform: Transform
    points: TiePoints
    sigma_px: float
    cross_validation_px: dict[str, float]


def estimate_transform(
    points: TiePoints, as_claimed: Transform, grid: Grid, kind: str, radius_px: float, seed: int
) -> Estimate:
    """Fit a transform to tie points of which many may be wrong.

    Parameters
    ----------
    points
        Points of the fit.
    as_claimed
        The transform that believes the input's georeferencing.
    grid
        The matching grid: its pixels are the unit of distances.
    kind
        One of `models.KINDS`, or "auto" for the simplest that the points justify.
    radius_px
        How far wrong matches may have fallen from the truth, in matching pixels.
    seed
        Of random samples.

    Raises
    ------
    TooFewPointsError
        Fewer points agree than the model needs.
    """
    used = points.take(points.used)
    px = grid.map_to_pixel(used.reference_xy)
    claimed_px = grid.map_to_pixel(as_claimed.claimed_xy(used.input_px))
    if len(used) < 4:
        raise TooFewPointsError(f"only {len(used)} points were matched")
    first_kind = kind if DEGREE.get(kind, 2) <= 1 else "affine"
    start = find_consensus(px, claimed_px, _CONSENSUS_PX, first_kind, seed)
    variances = np.trace(used.covariance_px2, axis1=1, axis2=2) / 2
    area = (2 * radius_px + 1) ** 2
    pairs = px, claimed_px, variances
    errors: dict[str, float] = {}
    if kind == AUTO:
        affine, mixture = fit_robustly("affine", *pairs, start, area, _SIGMA_RANGE_PX)
        near = distances(affine, px, claimed_px) < 4 * mixture.sigma
        choice = choose_kind(
            px[near],
            claimed_px[near],
            1 / (mixture.sigma**2 + variances[near]),
            block_folds(px[near]),
        )
        kind, errors, start = choice.kind, choice.rmse, affine
    model, mixture = fit_robustly(kind, *pairs, start, area, _SIGMA_RANGE_PX)
    right = np.zeros(len(points), bool)
    right[points.used] = mixture.right
    return Estimate(
        Transform(_on_map(model, grid), as_claimed.crs, as_claimed.input_grid),
        points.reject(~right, "disagrees with the model"),
        mixture.sigma,
        errors,
    )


def prediction_spread_px(estimate: Estimate, grid: Grid, at_px: FloatArray) -> FloatArray:
    """Return the standard deviation of an estimate's predictions, shape (n,), matching pixels.

    By the jackknife over blocks of neighbouring points (Efron & Tibshirani 1993, chapter 11), so
    it grows where the points do not hold the model.

    Parameters
    ----------
    estimate
        The estimate.
    grid
        The matching grid.
    at_px
        Where to predict, pixel positions of the grid, shape (n, 2).
    """
    used = estimate.points.take(estimate.points.used)
    px = grid.map_to_pixel(used.reference_xy)
    claimed_px = grid.map_to_pixel(estimate.transform.claimed_xy(used.input_px))
    variances = np.trace(used.covariance_px2, axis1=1, axis2=2) / 2
    weights = 1 / (estimate.sigma_px**2 + variances)
    folds = block_folds(px)
    frame = Frame.around(px)
    predictions = []
    for fold in np.unique(folds):
        try:
            left = np.where(folds == fold, 0.0, weights)
            model = fit_model(estimate.transform.model.kind, px, claimed_px, left, frame)
        except TooFewPointsError:
            return np.full(len(at_px), np.inf)
        predictions.append(model(at_px))
    count = len(predictions)
    if count < 2:
        return np.full(len(at_px), np.inf)
    variance = np.var(predictions, axis=0).sum(axis=1) * (count - 1)
    return np.asarray(np.sqrt(variance))


def _on_map(model: Model, grid: Grid) -> Model:
    return model.on_map(grid.transform * Affine.translation(0.5, 0.5))
