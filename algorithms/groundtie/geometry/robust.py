"""Robust fits: consensus among many wrong matches, then a mixture of right and wrong ones.

Positions are pixel positions of the matching grid here, so that distances are in pixels.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .fitting import fit_model
from .models import PARAMETERS, Frame, Model, PolynomialModel, monomials

FloatArray = NDArray[np.float64]

_SAMPLES = 600
_MIXTURE_STEPS = 40
_FIT_STEPS = 15

# Right matches are first thought to scatter by this, in pixels; starting wide would take a second
# cluster of wrong matches, as layover makes, for the tail of the right ones.
_FIRST_SIGMA = 1.0
FOLDS = 5

# A linear part this far from the identity is no misregistration of georeferenced images.
_LARGEST_DISTORTION = 0.25


@dataclass(frozen=True)
class Mixture:
    """Residuals seen as a mixture of right matches and of matches that fell anywhere.

    Parameters
    ----------
    probability
        Of each match to be right, shape (n,).
    sigma
        Standard deviation of right matches along each axis, in the residuals' unit.
    """

    probability: FloatArray
    sigma: float

    @property
    def right(self) -> NDArray[np.bool_]:
        """Which matches are more likely right than wrong."""
        return np.asarray(self.probability > 0.5)


def fit_mixture(
    residuals: FloatArray, window_area: float, sigma_range: tuple[float, float]
) -> Mixture:
    """Separate right from wrong matches by expectation maximisation.

    Right ones scatter around zero with a circular normal distribution, wrong ones fall evenly
    over their search window.

    Parameters
    ----------
    residuals
        Shape (n, 2).
    window_area
        Area of the search window, in the residuals' unit squared.
    sigma_range
        Smallest and largest standard deviation of right matches.
    """
    if len(residuals) == 0:
        return Mixture(np.zeros(0), sigma_range[1])
    squared = (residuals**2).sum(axis=1)
    lowest, highest = sigma_range
    variance, share = min(max(_FIRST_SIGMA, lowest), highest) ** 2, 0.5
    probability = np.full(len(residuals), share)
    for _ in range(_MIXTURE_STEPS):
        right = share * np.exp(-squared / (2 * variance)) / (2 * np.pi * variance)
        probability = right / (right + (1 - share) / window_area)
        total = max(float(probability.sum()), 1e-9)
        variance = float((probability * squared).sum() / (2 * total))
        variance = float(np.clip(variance, lowest**2, highest**2))
        share = float(np.clip(total / len(residuals), 0.02, 0.98))
    return Mixture(probability, float(np.sqrt(variance)))


def find_consensus(
    xy: FloatArray,
    claimed_xy: FloatArray,
    tolerance: float,
    kind: str = "affine",
    seed: int = 0,
) -> Model:
    """Return the model of degree ≤ 1 that most pairs agree with (MSAC [Torr2000]).

    Parameters
    ----------
    xy, claimed_xy
        Pairs of pixel positions, shape (n, 2), n ≥ 3.
    tolerance
        Distance within which a pair agrees, in pixels.
    kind
        "translation", "rigid", "similarity" or "affine".
    seed
        Of the random samples.
    """
    frame = Frame.around(xy)
    uv, displacement = frame.enter(xy), frame.enter(claimed_xy) - frame.enter(xy)
    candidates = _sampled_models(uv, displacement, kind, np.random.default_rng(seed))
    design = monomials(uv, 1)
    residuals = displacement[None] - design[None] @ candidates
    in_frame = tolerance / frame.to_map.a
    cost = np.minimum((residuals**2).sum(axis=2), in_frame**2).sum(axis=1)
    best: Model = PolynomialModel("affine", frame, candidates[cost.argmin()])
    for _ in range(3):
        agree = distances(best, xy, claimed_xy) < tolerance
        if agree.sum() < -(-PARAMETERS[kind] // 2) + 1:
            break
        best = fit_model(kind, xy, claimed_xy, agree.astype(float), frame)
    return best


def distances(model: Model, xy: FloatArray, claimed_xy: FloatArray) -> FloatArray:
    """Return the distances between claimed positions and the model's, shape (n,), pixels."""
    return np.asarray(np.hypot(*(claimed_xy - model(xy)).T))


def fit_robustly(
    kind: str,
    xy: FloatArray,
    claimed_xy: FloatArray,
    variances: FloatArray,
    start: Model,
    window_area: float,
    sigma_range: tuple[float, float],
) -> tuple[Model, Mixture]:
    """Fit a model to pairs of which many may be wrong.

    Fits and mixtures (see `fit_mixture`) take turns; each pair weighs by its probability to be
    right over its variance.

    Parameters
    ----------
    kind
        One of `models.KINDS`.
    xy, claimed_xy
        Pairs of positions, shape (n, 2), pixels.
    variances
        Variance of each match along an axis, shape (n,), px²; the mixture's own variance
        is added, so that no match counts for much more than its model is exact.
    start
        Model to start from, usually `find_consensus`.
    window_area
        Area of the matches' search window, px².
    sigma_range
        Smallest and largest standard deviation of right matches, pixels.

    Raises
    ------
    TooFewPointsError
        Fewer right pairs than the model needs.
    """
    model = start
    for _ in range(_FIT_STEPS):
        mixture = fit_mixture(claimed_xy - model(xy), window_area, sigma_range)
        weights = np.where(mixture.right, mixture.probability, 0.0)
        weights = weights * mixture.sigma**2 / (mixture.sigma**2 + variances)
        previous, model = model, fit_model(kind, xy, claimed_xy, weights, Frame.around(xy))
        if np.abs(model(xy) - previous(xy)).max() < 1e-4 * sigma_range[0]:
            break
    return model, fit_mixture(claimed_xy - model(xy), window_area, sigma_range)


def _sampled_models(
    uv: FloatArray, displacement: FloatArray, kind: str, random: np.random.Generator
) -> FloatArray:
    """Return coefficients of degree 1, shape (m, 3, 2), each exact on a random minimal sample."""
    size = {"translation": 1, "rigid": 2, "similarity": 2, "affine": 3}[kind]
    picks = random.random((_SAMPLES, len(uv))).argpartition(size - 1, axis=1)[:, :size]
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
        # Three places on a line tell a shift only.
        coefficients[~well_posed] = 0.0
        coefficients[~well_posed, 0] = displacement[picks[~well_posed, 0]]
    plausible = np.abs(coefficients[:, 1:]).max(axis=(1, 2)) < _LARGEST_DISTORTION
    return np.asarray(coefficients[plausible] if plausible.any() else coefficients * 0)


def blocks_of(px: FloatArray) -> NDArray[np.int_]:
    """Return the column and row of the block that each point lies in, shape (n, 2).

    The points' extent is cut into as many blocks a side as there are folds.
    """
    low, high = px.min(axis=0), px.max(axis=0)
    unit = (px - low) / np.maximum(high - low, 1e-12)
    return np.minimum((unit * FOLDS).astype(int), FOLDS - 1)


def block_folds(px: FloatArray) -> NDArray[np.int_]:
    """Return fold numbers, shape (n,), such that neighbours share one, for cross-validation.

    Each row and each column of blocks holds every fold once.
    """
    block = blocks_of(px)
    return np.asarray((block[:, 0] + 2 * block[:, 1]) % FOLDS)


def standard_errors(rise: FloatArray, px: FloatArray) -> float:
    """Return the sum of a rise in its standard errors; neighbours rise together, so by blocks.

    Parameters
    ----------
    rise
        By how much something is larger at each point, shape (n,).
    px
        Where the points lie, shape (n, 2).
    """
    block = blocks_of(px) @ [1, FOLDS]
    sums = np.array([rise[block == b].sum() for b in np.unique(block)])
    error = sums.std(ddof=1) * np.sqrt(len(sums)) if len(sums) > 1 else np.inf
    return float(sums.sum() / max(error, 1e-12))
