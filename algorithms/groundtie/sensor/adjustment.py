"""Estimating the bias of RPCs from ground control of which some may be wrong."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..errors import TooFewPointsError
from ..geometry.robust import block_folds, find_consensus, fit_mixture
from .bias import KINDS, TERMS, Bias, design

FloatArray = NDArray[np.float64]
AUTO = "auto"

# How blunders are found: all at once, by what is probable, or one after the other, the worst
# first ([Suri2010] section 5.4.1).
ROBUST, WORST_FIRST = "robust", "worst-first"
METHODS = (ROBUST, WORST_FIRST)

# Standard deviation that right points may have beyond their own, in pixels.
_SIGMA_RANGE_PX = (0.1, 2.5)
_STEPS = 30

# No image is measured better than this.
SMALLEST_SIGMA_PX = 1e-3

# Points agree with a first model within this, in pixels.
_CONSENSUS_PX = 3.0

# Wrong points lie anywhere within this distance at least, in pixels.
_LEAST_REACH_PX = 50.0

# A model needs so many points for each of its terms; fewer control nothing.
_POINTS_PER_TERM = 3
_FEWEST_POINTS = 3

# A model is carried by points that leave it uncertain by less, over the image, in pixels.
_LARGEST_SIGMA_PX = 1.0

# A more flexible model must make left-out points more probable, and one of its further
# coefficients must be larger than so many standard deviations.
_SIGMAS = 3.5


@dataclass(frozen=True)
class Control:
    """Ground control as seen by RPCs.

    Parameters
    ----------
    expected_px
        Where the RPCs see the points, shape (n, 2).
    found_px
        Where they are in the image, shape (n, 2).
    covariance_px2
        Covariance of `found_px`, shape (n, 2, 2).
    size
        Width and height of the image.
    """

    expected_px: FloatArray
    found_px: FloatArray
    covariance_px2: FloatArray
    size: tuple[int, int]

    def __len__(self) -> int:
        return len(self.expected_px)

    def take(self, which: NDArray[np.bool_]) -> Control:
        """Return some of the points."""
        return Control(
            self.expected_px[which], self.found_px[which], self.covariance_px2[which], self.size
        )

    def residuals_px(self, bias: Bias | None) -> FloatArray:
        """Return found minus corrected positions, shape (n, 2); without a bias as delivered."""
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
        Which points are not taken for blunders, shape (n,).
    sigma_px
        Standard deviation, an axis, of right points beyond what their covariances tell.
    fold_biases
        The bias estimated again without one block of points after the other.
    left_out_px
        Residuals of the points by an estimate that has not seen them, shape (n, 2).
    left_out_rmse_px
        For each model that was considered, the root mean square of these, of right points.
    """

    bias: Bias
    used: NDArray[np.bool_]
    sigma_px: float
    fold_biases: tuple[Bias, ...]
    left_out_px: FloatArray
    left_out_rmse_px: dict[str, float]

    def spread_px(self, px: FloatArray) -> FloatArray:
        """Return how far corrections vary with the points, shape (n,): the blocks' jackknife."""
        count = len(self.fold_biases)
        if count < 2:
            return np.full(len(px), np.inf)
        values = [bias(px) for bias in self.fold_biases]
        return np.asarray(np.sqrt(np.var(values, axis=0).sum(axis=1) * (count - 1)))


def adjust(
    control: Control,
    kind: str = AUTO,
    method: str = ROBUST,
    largest_residual_px: float = 2.0,
    seed: int = 0,
) -> Adjustment:
    """Estimate the bias of RPCs by weighted least squares without the blunders.

    Parameters
    ----------
    control
        The points.
    kind
        One of `bias.KINDS`, or "auto": the simplest model that left-out points justify and that
        the points' number and spread carry.
    method
        One of `METHODS`.
    largest_residual_px
        For the method worst-first: points with larger residuals are blunders.
    seed
        Of random samples.

    Raises
    ------
    TooFewPointsError
        Fewer points, or fewer that agree, than the model needs.
    """
    if kind != AUTO:
        return _adjust(control, kind, method, largest_residual_px, seed)
    found: list[Adjustment] = []
    failed: list[TooFewPointsError] = []
    for each in KINDS:
        try:
            found.append(_adjust(control, each, method, largest_residual_px, seed))
        except TooFewPointsError as error:
            failed.append(error)
    if not found:
        raise failed[0]
    chosen = found[0]
    for tried in found[1:]:
        if _is_carried(tried, control) and _is_better(tried, chosen):
            chosen = tried
    errors = {kind: rmse for each in found for kind, rmse in each.left_out_rmse_px.items()}
    return replace(chosen, left_out_rmse_px=errors)


def _is_carried(tried: Adjustment, control: Control) -> bool:
    """Tell whether points hold a model all over the image."""
    corners = np.array([[0, 0], [1, 0], [0, 1], [1, 1]]) * control.size
    return bool(
        max(tried.bias.sigma_px(corners).max(), np.median(tried.spread_px(corners)))
        < _LARGEST_SIGMA_PX * np.sqrt(2)
    )


def _is_better(tried: Adjustment, chosen: Adjustment) -> bool:
    """Tell whether points want the terms that a model has and a simpler one has not."""
    gain = float((_log_likelihoods(tried) - _log_likelihoods(chosen)).sum())
    more = slice(len(chosen.bias.coefficients), None)
    by_points = np.diag(tried.bias.covariance).reshape(-1, 2)
    count = len(tried.fold_biases)
    folds = np.array([bias.coefficients for bias in tried.fold_biases])
    by_blocks = folds.var(axis=0) * (count - 1)  # the jackknife: neighbours err together
    sigma = np.sqrt(np.maximum(by_points, by_blocks))[more]
    return gain > 0 and bool((np.abs(tried.bias.coefficients[more]) > _SIGMAS * sigma).any())


def _log_likelihoods(adjustment: Adjustment) -> FloatArray:
    """Return the logarithm of the density of each point, right or wrong, shape (n,)."""
    squared = (adjustment.left_out_px**2).sum(axis=1)
    share = float(np.clip(adjustment.used.mean(), 0.02, 0.98))
    variance = max(float(squared[adjustment.used].mean()) / 2, _SIGMA_RANGE_PX[0] ** 2)
    right = share * np.exp(-squared / (2 * variance)) / (2 * np.pi * variance)
    return np.asarray(np.log(right + (1 - share) / (2 * _LEAST_REACH_PX) ** 2))


def _adjust(
    control: Control, kind: str, method: str, largest_residual_px: float, seed: int
) -> Adjustment:
    needed = max(_FEWEST_POINTS, _POINTS_PER_TERM * TERMS[kind])
    if len(control) < needed:
        raise TooFewPointsError(
            f"the model {kind} needs at least {needed} control points; there are {len(control)}"
        )
    if method == WORST_FIRST:
        used, sigma = _without_worst(control, kind, largest_residual_px)
    else:
        used, sigma = _without_improbable(control, kind, seed)
    if used.sum() < needed:
        raise TooFewPointsError(
            f"only {used.sum()} of {len(control)} control points agree; the model {kind} needs "
            f"at least {needed}"
        )
    kept = control.take(used)
    folds = block_folds(kept.expected_px)
    biases = []
    left_out = control.residuals_px(_fit(kept, kind, sigma))
    inside = np.flatnonzero(used)
    for each in np.unique(folds):
        others = folds != each
        if others.sum() < TERMS[kind]:
            continue
        biases.append(_fit(kept.take(others), kind, sigma))
        left_out[inside[~others]] = kept.take(~others).residuals_px(biases[-1])
    rmse = float(np.sqrt(np.mean((left_out[used] ** 2).sum(axis=1))))
    return Adjustment(_fit(kept, kind, sigma), used, sigma, tuple(biases), left_out, {kind: rmse})


def _without_improbable(control: Control, kind: str, seed: int) -> tuple[NDArray[np.bool_], float]:
    """Return which points are more probably right than wrong, and the spread of the right ones."""
    first = "translation" if kind == "shift" else "affine"
    start = find_consensus(control.expected_px, control.found_px, _CONSENSUS_PX, first, seed)
    residuals = control.found_px - start(control.expected_px)
    reach = max(float(np.abs(residuals).max()), _LEAST_REACH_PX)
    used, sigma = np.zeros(len(control), bool), _SIGMA_RANGE_PX[0]
    for _ in range(_STEPS):
        mixture = fit_mixture(residuals, (2 * reach) ** 2, _SIGMA_RANGE_PX)
        same = np.array_equal(used, mixture.right)
        used, sigma = mixture.right, _excess(control.take(mixture.right), mixture.sigma)
        if same or used.sum() < TERMS[kind]:
            break
        residuals = control.residuals_px(_fit(control.take(used), kind, sigma))
    return used, sigma


def _without_worst(
    control: Control, kind: str, largest_residual_px: float
) -> tuple[NDArray[np.bool_], float]:
    """Take the point with the largest residual out until none exceeds the largest allowed."""
    used = np.ones(len(control), bool)
    while used.sum() > TERMS[kind]:
        bias = _fit(control.take(used), kind, 0.0)
        distance = np.where(used, np.hypot(*control.residuals_px(bias).T), 0.0)
        if distance.max() <= largest_residual_px:
            break
        used[distance.argmax()] = False
    kept = control.take(used)
    residuals = kept.residuals_px(_fit(kept, kind, 0.0))
    return used, _excess(kept, float(np.sqrt(np.mean(residuals**2))))


def _excess(control: Control, sigma_px: float) -> float:
    """Return the standard deviation of points beyond what their covariances tell, an axis."""
    told = np.trace(control.covariance_px2, axis1=1, axis2=2).mean() / 2 if len(control) else 0.0
    return float(np.sqrt(max(sigma_px**2 - told, 0.0)))


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
