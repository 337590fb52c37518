"""Robust fits: consensus among many outliers, then a mixture of inliers and outliers.

Positions here are pixel positions of the matching grid, so that distances are in pixels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..rasters.grid import FloatArray
from .fitting import fit_model
from .models import DEGREE, Frame, Model, PolynomialModel, fewest_points, monomials

# If a fifth of the pairs are correct, this many samples of three include an all-correct one with a
# probability of 99 %.
_SAMPLES = 600

# Pairs times samples evaluated together, 16 MB of residuals: large scenes have 50 000 pairs of
# features.
_TOGETHER = 1_000_000

# Tolerance for agreement with a first model of degree 1, in pixels; larger bending is left to the
# fit that starts from this model.
CONSENSUS_PX = 3.0

# The mixture has converged after this many steps: with 10 to 300 points it changes by less than
# 1e-13.
_MIXTURE_STEPS = 40

# Fits and mixtures alternate until the model no longer moves any point, at most this many times.
_FIT_STEPS = 15

# Allowed standard deviation of inliers, in pixels.
_SIGMA_RANGE_PX = (0.2, 2.5)

# Allowed share of inliers: expectation maximisation cannot leave a share of 0 or 1.
_SHARE_RANGE = (0.02, 0.98)

# Initial standard deviation of inliers, in pixels. A wide start would take a second cluster, such
# as outliers by layover, for the tail of the inliers.
_FIRST_SIGMA = 1.0

# A linear part this far from the identity is not a misregistration of georeferenced images.
_LARGEST_DISTORTION = 0.25


@dataclass(frozen=True)
class Mixture:
    """Residuals as a mixture of inliers and uniformly distributed outliers.

    Parameters
    ----------
    probability
        Probability of each match to be an inlier, shape (n,).
    sigma
        Standard deviation of inliers along each axis, in the residuals' unit.
    """

    probability: FloatArray
    sigma: float

    @property
    def inliers(self) -> NDArray[np.bool_]:
        """Which matches are more likely inliers than outliers."""
        return np.asarray(self.probability > 0.5)


def fit_mixture(
    residuals: FloatArray,
    window_area: float,
    sigma_range: tuple[float, float] = _SIGMA_RANGE_PX,
) -> Mixture:
    """Separate inliers from outliers by expectation maximisation.

    Inliers have a circular normal distribution around zero; outliers are distributed uniformly over
    their search window.

    Parameters
    ----------
    residuals
        Shape (n, 2).
    window_area
        Area of the search window, in the residuals' unit squared.
    sigma_range
        Smallest and largest standard deviation of inliers.
    """
    if len(residuals) == 0:
        return Mixture(np.zeros(0), sigma_range[1])
    squared = (residuals**2).sum(axis=1)
    lowest, highest = sigma_range
    variance, share = min(max(_FIRST_SIGMA, lowest), highest) ** 2, 0.5
    probability = np.full(len(residuals), share)
    for _ in range(_MIXTURE_STEPS):
        inlier, outlier = densities(squared, variance, share, window_area)
        probability = inlier / (inlier + outlier)
        total = max(float(probability.sum()), 1e-9)
        variance = float((probability * squared).sum() / (2 * total))
        variance = float(np.clip(variance, lowest**2, highest**2))
        share = total / len(residuals)
    return Mixture(probability, float(np.sqrt(variance)))


def densities(
    squared: FloatArray, variance: float, share: float, window_area: float
) -> tuple[FloatArray, float]:
    """Return the density of inliers, shape (n,), and that of outliers.

    Parameters
    ----------
    squared
        Squared lengths of residuals, shape (n,).
    variance
        Variance of inliers along an axis.
    share
        Share of inliers; it is kept away from 0 and 1.
    window_area
        Area over which outliers are distributed.
    """
    share = float(np.clip(share, *_SHARE_RANGE))
    inlier = share * np.exp(-squared / (2 * variance)) / (2 * np.pi * variance)
    return np.asarray(inlier), (1 - share) / window_area


def find_consensus(
    xy: FloatArray,
    nominal_xy: FloatArray,
    tolerance: float,
    kind: str = "affine",
    seed: int = 0,
    largest_distortion: float = _LARGEST_DISTORTION,
) -> Model:
    """Return the model of degree ≤ 1 that most pairs agree with (MSAC; [Torr2000]).

    Parameters
    ----------
    xy, nominal_xy
        Pairs of pixel positions, shape (n, 2), n ≥ 3.
    tolerance
        Distance within which a pair agrees, in pixels.
    kind
        One of `models.PARAMETERS`; for more flexible kinds, "affine" is fitted.
    seed
        Seed of the random samples.
    largest_distortion
        Largest deviation of any coefficient of the linear part from the identity's.
    """
    kind = kind if DEGREE.get(kind, 2) <= 1 else "affine"
    frame = Frame.around(xy)
    uv, displacement = frame.enter(xy), frame.enter(nominal_xy) - frame.enter(xy)
    candidates = _sampled_models(uv, displacement, kind, np.random.default_rng(seed))
    distortion = np.abs(candidates[:, 1:]).max(axis=(1, 2))
    plausible = distortion < largest_distortion
    candidates = candidates[plausible] if plausible.any() else candidates * 0
    design, in_frame = monomials(uv, 1), tolerance / frame.to_map.a

    def costs(some: slice) -> FloatArray:
        residuals = displacement[None] - design[None] @ candidates[some]
        return np.asarray(np.minimum((residuals**2).sum(axis=2), in_frame**2).sum(axis=1))

    cost = np.concatenate([costs(some) for some in _parts(len(candidates), len(xy))])
    best: Model = PolynomialModel("affine", frame, candidates[cost.argmin()])
    for _ in range(3):
        agree = distances(best, xy, nominal_xy) < tolerance
        if agree.sum() <= fewest_points(kind):
            break
        best = fit_model(kind, xy, nominal_xy, agree.astype(float), frame)
    return best


def distances(model: Model, xy: FloatArray, nominal_xy: FloatArray) -> FloatArray:
    """Return the distances of nominal from predicted positions, shape (n,), pixels."""
    return np.asarray(np.hypot(*(nominal_xy - model(xy)).T))


def fit_robustly(
    kind: str,
    xy: FloatArray,
    nominal_xy: FloatArray,
    variances: FloatArray | float,
    start: Model,
    window_area: float,
) -> tuple[Model, Mixture]:
    """Fit a model to pairs, many of which may be outliers.

    Fits and mixtures (see `fit_mixture`) alternate; each pair's weight is its probability to be an
    inlier, divided by its variance.

    Parameters
    ----------
    kind
        One of `models.KINDS`.
    xy, nominal_xy
        Pairs of positions, shape (n, 2), pixels.
    variances
        Variance of each match along an axis, shape (n,), or of all, px². The variance of the
        mixture is added, so that no match gets more weight than the fit of the model justifies.
    start
        Model to start from, usually `find_consensus`.
    window_area
        Area of the matches' search window, px².

    Raises
    ------
    TooFewPointsError
        Fewer inliers than the model needs.
    """
    model = start
    for _ in range(_FIT_STEPS):
        mixture = fit_mixture(nominal_xy - model(xy), window_area)
        weights = np.where(mixture.inliers, mixture.probability, 0.0)
        weights = weights * mixture.sigma**2 / (mixture.sigma**2 + variances)
        previous, model = model, fit_model(kind, xy, nominal_xy, weights, Frame.around(xy))
        if np.abs(model(xy) - previous(xy)).max() < 1e-4 * _SIGMA_RANGE_PX[0]:
            break
    return model, fit_mixture(nominal_xy - model(xy), window_area)


def _parts(samples: int, pairs: int) -> list[slice]:
    """Return the slices of samples that are evaluated together."""
    step = max(_TOGETHER // pairs, 1)
    return [slice(first, min(first + step, samples)) for first in range(0, samples, step)]


def _sampled_models(
    uv: FloatArray, displacement: FloatArray, kind: str, random: np.random.Generator
) -> FloatArray:
    """Return coefficients of degree 1, shape (m, 3, 2), each exact on a random minimal sample."""
    size = fewest_points(kind)
    picks = np.empty((_SAMPLES, size), np.intp)
    for some in _parts(_SAMPLES, len(uv)):
        # Drawn row by row, the numbers do not depend on the size of the slices.
        drawn = random.random((some.stop - some.start, len(uv)))
        picks[some] = drawn.argpartition(size - 1, axis=1)[:, :size]
    if size == 1:
        coefficients = np.zeros((_SAMPLES, 3, 2))
        coefficients[:, 0] = displacement[picks[:, 0]]
        return coefficients
    if size == 2:
        z = uv[picks] @ [1, 1j]
        w = (uv[picks] + displacement[picks]) @ [1, 1j]
        span = z[:, 1] - z[:, 0]
        far = np.abs(span) > 0.2
        turn = np.where(far, (w[:, 1] - w[:, 0]) / np.where(far, span, 1), 1) - 1
        linear = np.stack(
            [np.stack([turn.real, turn.imag], 1), np.stack([-turn.imag, turn.real], 1)], 1
        )
        shift = displacement[picks[:, 0]] - np.einsum("mi,mij->mj", uv[picks[:, 0]], linear)
        coefficients = np.concatenate([shift[:, None], linear], axis=1)
    else:
        design = np.stack([monomials(sample, 1) for sample in uv[picks].swapaxes(0, 1)], axis=1)
        well_posed = np.abs(np.linalg.det(design)) > 0.05
        design[~well_posed] = np.eye(3)
        coefficients = np.asarray(np.linalg.solve(design, displacement[picks]), np.float64)
        # Three collinear places determine a shift only.
        coefficients[~well_posed] = 0.0
        coefficients[~well_posed, 0] = displacement[picks[~well_posed, 0]]
    return coefficients
