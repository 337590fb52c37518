"""Estimating the bias of RPCs from ground control that may contain blunders."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import TooFewPointsError
from ..geometry.estimation import jackknife_spread
from ..geometry.model_choice import (
    CONTROL_PER_PARAMETER,
    choose_simplest,
    left_out_blocks,
)
from ..geometry.robust import CONSENSUS_PX, densities, find_consensus, fit_mixture
from ..geometry.rows import Rows
from ..kinds import AUTO
from ..rasters.grid import FloatArray
from .bias import KINDS, SHIFT, TERMS, Bias, design

# Range of the standard deviation of inlier residuals, an axis, in pixels.
_SIGMA_RANGE_PX = (0.1, 2.5)

# Most alternations of fitting and separating blunders; they end when the inliers stay the same.
_STEPS = 30

# Least standard deviation assumed of image measurements.
SMALLEST_SIGMA_PX = 1e-3

# Least distance within which blunders are taken to be uniformly distributed, in pixels.
LEAST_REACH_PX = 50

# Points support a model whose standard deviation, an axis, is smaller all over the image, in px.
_LARGEST_SIGMA_PX = 1.0


@dataclass(frozen=True)
class Control(Rows):
    """Ground control with its image positions by RPCs, one row a point.

    Parameters
    ----------
    expected_px
        Image positions of the points by the RPCs, shape (n, 2).
    found_px
        Measured image positions, shape (n, 2).
    covariance_px2
        Covariance of `found_px`, shape (n, 2, 2).
    size
        Width and height of the image.
    """

    expected_px: FloatArray
    found_px: FloatArray
    covariance_px2: FloatArray
    size: tuple[int, int]

    def residuals_px(self, bias: Bias | None) -> FloatArray:
        """Return found minus corrected positions, shape (n, 2); None: of RPCs as delivered."""
        correction = 0.0 if bias is None else bias(self.expected_px)
        return np.asarray(self.found_px - self.expected_px - correction)


@dataclass(frozen=True)
class Adjustment:
    """An estimated bias.

    Parameters
    ----------
    bias
        The bias, with the covariance of its parameters.
    used
        Which points are inliers, shape (n,).
    sigma_px
        Standard deviation, an axis, of inliers beyond their covariances.
    fold_biases
        The biases estimated without one block of points each.
    left_out_px
        Residuals of the points from an estimate without them, shape (n, 2).
    left_out_rmse_px
        Root mean square of the inliers' left-out residuals, for each model that was considered.
    """

    bias: Bias
    used: NDArray[np.bool_]
    sigma_px: float
    fold_biases: tuple[Bias, ...]
    left_out_px: FloatArray
    left_out_rmse_px: dict[str, float]


def adjust(control: Control, kind: str = AUTO) -> Adjustment:
    """Estimate the bias of RPCs by weighted least squares, without blunders.

    Parameters
    ----------
    control
        The points.
    kind
        One of `bias.KINDS`, or "auto": the simplest model that left-out points justify and that
        the points' number and spread support.

    Raises
    ------
    TooFewPointsError
        Fewer points, or fewer consistent points, than the model needs.
    """
    if kind != AUTO:
        return _adjust(control, kind)

    def fit(each: str) -> tuple[Adjustment, FloatArray]:
        tried = _adjust(control, each)
        return tried, _log_likelihoods(tried)

    chosen, fitted = choose_simplest(
        KINDS, fit, control.expected_px, is_held=lambda tried: _is_carried(tried, control)
    )
    errors = {kind: rmse for each in fitted for kind, rmse in each.left_out_rmse_px.items()}
    return replace(chosen, left_out_rmse_px=errors)


def _is_carried(tried: Adjustment, control: Control) -> bool:
    """Return whether the points determine a model well enough all over the image."""
    corners = np.array([[0, 0], [1, 0], [0, 1], [1, 1]]) * control.size
    spread = np.median(jackknife_spread(tried.fold_biases, corners))
    return bool(max(tried.bias.sigma_px(corners).max(), spread) < _LARGEST_SIGMA_PX * np.sqrt(2))


def _log_likelihoods(adjustment: Adjustment) -> FloatArray:
    """Return the log density of each left-out residual, of inliers and blunders, shape (n,)."""
    squared = (adjustment.left_out_px**2).sum(axis=1)
    variance = max(float(squared[adjustment.used].mean()) / 2, _SIGMA_RANGE_PX[0] ** 2)
    share, area = float(adjustment.used.mean()), (2 * LEAST_REACH_PX) ** 2
    inlier, blunder = densities(squared, variance, share, area)
    return np.asarray(np.log(inlier + blunder))


def _adjust(control: Control, kind: str) -> Adjustment:
    needed = round(CONTROL_PER_PARAMETER * 2 * TERMS[kind])
    if len(control) < needed:
        raise TooFewPointsError(
            f"the model {kind} needs at least {needed} control points; there are {len(control)}"
        )
    used, sigma = _without_improbable(control, kind)
    if used.sum() < needed:
        raise TooFewPointsError(
            f"only {used.sum()} of {len(control)} control points agree; the model {kind} needs "
            f"at least {needed}"
        )
    kept = control.take(used)
    bias = _fit(kept, kind, sigma)
    left_out = control.residuals_px(bias)
    biases = []
    inside = np.flatnonzero(used)
    for block in left_out_blocks(kept.expected_px):
        if (~block).sum() < TERMS[kind]:
            raise TooFewPointsError(
                f"{block.sum()} of {len(kept)} control points lie side by side: the model {kind} "
                "cannot be made without them"
            )
        biases.append(_fit(kept.take(~block), kind, sigma))
        left_out[inside[block]] = kept.take(block).residuals_px(biases[-1])
    rmse = float(np.sqrt(np.mean((left_out[used] ** 2).sum(axis=1))))
    return Adjustment(bias, used, sigma, tuple(biases), left_out, {kind: rmse})


def _without_improbable(control: Control, kind: str) -> tuple[NDArray[np.bool_], float]:
    """Return which points are more probably inliers than blunders, and the inliers' excess."""
    first = "translation" if kind == SHIFT else "affine"
    start = find_consensus(control.expected_px, control.found_px, CONSENSUS_PX, first)
    residuals = control.found_px - start(control.expected_px)
    reach = reach_px(float(np.abs(residuals).max()), control.size)
    used, sigma = np.zeros(len(control), bool), _SIGMA_RANGE_PX[0]
    for _ in range(_STEPS):
        mixture = fit_mixture(residuals, (2 * reach) ** 2, _SIGMA_RANGE_PX)
        same = np.array_equal(used, mixture.inliers)
        used = mixture.inliers
        sigma = _excess(control.take(used), mixture.sigma, TERMS[kind])
        if same or used.sum() < TERMS[kind]:
            break
        residuals = control.residuals_px(_fit(control.take(used), kind, sigma))
    return used, sigma


def reach_px(farthest_px: float, size: tuple[int, int]) -> float:
    """Return the distance within which blunders are taken to be uniformly distributed.

    It is that of the farthest point, but at most the image's longer side: a single point beyond,
    as of swapped coordinates, would make nearer blunders seem to agree.
    """
    return float(np.clip(farthest_px, LEAST_REACH_PX, max(LEAST_REACH_PX, *size)))


def _excess(control: Control, residual_px: float, terms: int) -> float:
    """Return the standard deviation of points beyond their covariances, an axis.

    `residual_px` is that of residuals of a fit with `terms` parameters an axis. They are smaller
    than the points' errors: n points leave n - terms of them free.
    """
    count = len(control)
    stated = np.trace(control.covariance_px2, axis1=1, axis2=2).mean() / 2 if count else 0.0
    variance = residual_px**2 * count / max(count - terms, 1)
    return float(np.sqrt(max(variance - stated, 0.0)))


def _fit(control: Control, kind: str, sigma_px: float) -> Bias:
    """Fit a model by least squares, weighted by the points' covariances and a common variance."""
    terms = design(kind, control.size, control.expected_px)
    common = max(sigma_px, SMALLEST_SIGMA_PX) ** 2
    weights = np.linalg.inv(control.covariance_px2 + common * np.eye(2))
    normal = np.einsum("ni,nab,nj->iajb", terms, weights, terms).reshape(2 * terms.shape[1], -1)
    right = np.einsum(
        "ni,nab,nb->ia", terms, weights, control.found_px - control.expected_px
    ).ravel()
    covariance = np.linalg.pinv(normal, hermitian=True)
    coefficients = (covariance @ right).reshape(-1, 2)
    return Bias(kind, control.size, coefficients, covariance)
