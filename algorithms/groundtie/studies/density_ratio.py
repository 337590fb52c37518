"""Mutual information by maximum likelihood of a density ratio (MLMI; [Patel2017] 3.2.1).

The ratio w(x, y) = p(x, y) / (p(x) p(y)) is modelled directly, without estimating densities, as a
sum of Gaussian kernels with non-negative weights. The weights maximise the likelihood Σ log w(x, y)
of the observed pairs, under the constraint that the mean of w over all combinations of x and y is
1. Mutual information is the mean of log w [Suzuki2008].
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import nnls
from scipy.stats import norm, rankdata

from ..context import Context
from ..rasters.grid import FloatArray
from ..rasters.patch import Patch
from ..similarity.binning import to_bins
from ..similarity.joint_histogram import count_joint_histograms
from .measures import mutual_information

# Candidate kernel widths, in standard deviations of the grey values' normal scores.
WIDTHS = (0.15, 0.22, 0.32, 0.47, 0.68, 1.0, 1.5)
_FOLDS = 3

# Largest shortfall of a fit's likelihood from its maximum, in nats per pixel. The rough limit is
# enough to compare widths or shifts.
TOLERANCE, _ROUGH = 1e-5, 1e-3
# For surfaces: kernels at every shift, and bins of the histograms that choose the likeliest shift.
_SURFACE_KERNELS, _ROUGH_BINS = 100, 16
_FIRST_STEPS, _LAST_STEPS = 30, 60

# Added to the Hessian, whose diagonal is about 1, because overlapping kernels make it singular.
_RIDGE = 1e-9


@dataclass(frozen=True)
class DensityRatio:
    """A fitted density ratio.

    Parameters
    ----------
    centres
        Centres (x, y) of the kernels, shape (b, 2).
    width
        Standard deviation of the kernels.
    weights
        Non-negative weights of the kernels, shape (b,).
    """

    centres: FloatArray
    width: float
    weights: FloatArray

    def __call__(self, x: ArrayLike, y: ArrayLike) -> FloatArray:
        """Return the ratio at pairs of values, shape (n,)."""
        along_x, along_y = _kernels(np.asarray(x), np.asarray(y), self.centres, self.width)
        return np.asarray((along_x * along_y) @ self.weights)


def fit_density_ratio(
    x: ArrayLike,
    y: ArrayLike,
    centres: FloatArray,
    width: float,
    tolerance: float = TOLERANCE,
) -> DensityRatio:
    """Fit the density ratio to pairs of values.

    Parameters
    ----------
    x, y
        Values, shape (n,).
    centres
        Centres (x, y) of the kernels, shape (b, 2); usually some of the pairs.
    width
        Standard deviation of the kernels.
    tolerance
        Largest shortfall of the mean of log w from its maximum.
    """
    along_x, along_y = _kernels(np.asarray(x), np.asarray(y), centres, width)
    # A kernel is separable, and so is its mean over all combinations of x and y.
    means = along_x.mean(axis=0) * along_y.mean(axis=0)
    shares = _most_likely(along_x * along_y / means, tolerance)
    return DensityRatio(centres, width, shares / means)


def choose_width(x: FloatArray, y: FloatArray, centres: FloatArray, seed: int = 0) -> float:
    """Return the width of `WIDTHS` that maximises the likelihood of held-out pairs.

    With too few pairs for cross-validation, the widest is taken because it assumes the least.
    """
    if x.size < 2 * _FOLDS:
        return WIDTHS[-1]
    fold = np.random.default_rng(seed).permutation(x.size) % _FOLDS
    likelihoods = np.zeros(len(WIDTHS))
    for k in range(_FOLDS):
        seen, held_out = fold != k, fold == k
        for i, width in enumerate(WIDTHS):
            ratio = fit_density_ratio(x[seen], y[seen], centres, width, tolerance=_ROUGH)
            likelihoods[i] += _log(ratio(x[held_out], y[held_out])).sum()
    return WIDTHS[int(likelihoods.argmax())]


def normal_scores(values: ArrayLike) -> FloatArray:
    """Return the normal quantiles of the values' ranks, shape (n,).

    Mutual information is invariant to monotone functions of either image. On normal scores, one
    kernel width suits both optical images and the long-tailed values of radar images.
    """
    values = np.asarray(values)
    return np.asarray(norm.ppf((rankdata(values) - 0.5) / max(values.size, 1)))


def maximum_likelihood_mutual_information(
    a: ArrayLike,
    b: ArrayLike,
    width: float | None = None,
    sample: int = 2000,
    kernels: int = 200,
    seed: int = 0,
    tolerance: float = TOLERANCE,
) -> float:
    """Return the mutual information of pairs of grey values in nats.

    Parameters
    ----------
    a, b
        Grey values of the pixels of two images, shape (n,).
    width
        Standard deviation of the kernels, in standard deviations of the normal scores; None:
        chosen by cross-validation.
    sample
        Largest number of pairs; they are drawn from all pairs.
    kernels
        Largest number of kernels.
    seed
        Seed of the sample and of the cross-validation.
    tolerance
        Largest shortfall of the result from the most likely one.
    """
    a, b = np.asarray(a).ravel(), np.asarray(b).ravel()
    if a.size < 2:
        return 0.0
    drawn = np.random.default_rng(seed).permutation(a.size)[:sample]
    x, y = normal_scores(a[drawn]), normal_scores(b[drawn])
    centres = np.column_stack([x, y])[:kernels]
    if width is None:
        width = choose_width(x, y, centres, seed)
    ratio = fit_density_ratio(x, y, centres, width, tolerance=tolerance)
    return float(_log(ratio(x, y)).mean())


def information_surface(
    template: Patch, search: Patch, sample: int, context: Context
) -> NDArray[np.float32]:
    """Return the mutual information of a sample of template pixels at all whole-pixel shifts.

    The kernel width is chosen once, at the shift with the most informative histogram, and used
    at all shifts.

    Parameters
    ----------
    template
        Shape (h, w).
    search
        A concentric window, larger by the radius on each side.
    sample
        Largest number of pixels; the same pixels are used at all shifts.
    context
        Provides threads; its progress receives every row, and its seed is used for the sample and
        the cross-validation.

    Returns
    -------
    Array of shape (2 radius + 1, 2 radius + 1).
    """
    seed = context.seed
    drawn = np.random.default_rng(seed).permutation(np.flatnonzero(template.valid))[:sample]
    rows, cols = np.divmod(drawn, template.values.shape[1])
    span = search.values.shape[0] - template.values.shape[0] + 1

    def pairs(dy: int, dx: int) -> tuple[NDArray[Any], NDArray[Any]]:
        shifted = rows + dy, cols + dx
        counted = search.valid[shifted]
        return template.values[rows, cols][counted], search.values[shifted][counted]

    best = _most_informative_shift(template, search)
    x, y = map(normal_scores, pairs(*best))
    width = choose_width(x, y, np.column_stack([x, y])[:_SURFACE_KERNELS], seed)

    def row(dy: int) -> list[float]:
        return [
            maximum_likelihood_mutual_information(
                *pairs(dy, dx), width, sample, _SURFACE_KERNELS, seed, _ROUGH
            )
            for dx in range(span)
        ]

    return np.array(list(context.map(row, range(span))), np.float32)


def _most_informative_shift(template: Patch, search: Patch) -> tuple[int, int]:
    """Return the shift (rows, columns), from 0, of the highest histogram mutual information."""
    first, second = (to_bins(p.values, p.valid, _ROUGH_BINS) for p in (template, search))
    information = mutual_information(count_joint_histograms(first, second, (_ROUGH_BINS,) * 2))
    dy, dx = np.unravel_index(information.argmax(), information.shape)
    return int(dy), int(dx)


def _kernels(
    x: FloatArray, y: FloatArray, centres: FloatArray, width: float
) -> tuple[FloatArray, FloatArray]:
    """Return the factors of the kernels along x and along y, each of shape (n, b)."""
    along_x, along_y = (
        np.exp(-(((values[:, None] - centre) / width) ** 2) / 2)
        for values, centre in zip((x, y), centres.T, strict=True)
    )
    return along_x, along_y


def _log(ratio: FloatArray) -> FloatArray:
    """Return logarithms; ratios that were rounded to 0 count as the smallest positive number."""
    return np.asarray(np.log(np.maximum(ratio, np.finfo(float).tiny)))


def _most_likely(kernels: FloatArray, tolerance: float) -> FloatArray:
    """Return the shares ≥ 0, with sum 1, that maximise Σ log(kernels · shares).

    The kernels, shape (n, b), have mean 1. Expectation–maximisation steps start from equal shares.
    Constrained Newton steps finish; each is a least-squares problem. The problem is convex. At the
    maximum no kernel's gradient exceeds 1, and the excess of the largest gradient bounds the
    shortfall of the likelihood.
    """
    kernels = np.maximum(kernels, np.finfo(float).tiny ** 0.5)
    shares = np.full(kernels.shape[1], 1 / kernels.shape[1])
    for _ in range(_FIRST_STEPS):
        shares = shares * _gradient(kernels, shares)
    for _ in range(_LAST_STEPS):
        gradient = _gradient(kernels, shares)
        if gradient.max() <= 1 + tolerance:
            break
        shares = _newton_step(kernels, shares, gradient)
    return shares / shares.sum()


def _gradient(kernels: FloatArray, shares: FloatArray) -> FloatArray:
    return np.asarray((1 / (kernels @ shares)) @ kernels) / len(kernels)


def _loss(kernels: FloatArray, shares: FloatArray) -> float:
    """Return a loss whose minimum over shares ≥ 0 has a sum of 1 without a constraint."""
    return float(shares.sum() - np.log(kernels @ shares).mean())


def _newton_step(kernels: FloatArray, shares: FloatArray, gradient: FloatArray) -> FloatArray:
    """Return the minimum of the quadratic model of the loss, or a lower point on the way there."""
    relative = kernels / (kernels @ shares)[:, None]
    hessian = relative.T @ relative / len(kernels)
    hessian[np.diag_indices_from(hessian)] += _RIDGE * hessian.trace() / len(hessian)
    root = scipy.linalg.cholesky(hessian)
    target = scipy.linalg.solve_triangular(root, 2 * gradient - 1, trans="T")
    step = nnls(root, target)[0] - shares
    before, slope = _loss(kernels, shares), float((1 - gradient) @ step)
    length = 1.0
    while length > 1e-9 and _loss(kernels, shares + length * step) > before + 1e-4 * length * slope:
        length /= 2
    return shares + length * step
