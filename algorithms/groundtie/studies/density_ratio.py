"""Mutual information by maximum likelihood of a density ratio (MLMI; [Patel2017] 3.2.1).

The ratio w(x, y) = p(x, y) / (p(x) p(y)) is modelled as it is, without densities: as a sum of
Gaussian kernels with weights that are not negative. They maximise the likelihood Σ log w(x, y) of
the pairs seen, with the mean of w over all x and y combined freely held at 1. Mutual information
is the mean of log w [Suzuki2008].
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

# Kernel widths to choose from, in standard deviations of the grey values' normal scores.
WIDTHS = (0.15, 0.22, 0.32, 0.47, 0.68, 1.0, 1.5)
_FOLDS = 3

# How near the likelihood of a fit is to its maximum, in nats a pixel; to compare widths or shifts,
# less will do.
TOLERANCE, _ROUGH = 1e-5, 1e-3
# Of surfaces: kernels at every shift, and bins of the histograms that choose the likeliest shift.
_SURFACE_KERNELS, _ROUGH_BINS = 100, 16
_FIRST_STEPS, _LAST_STEPS = 30, 60

# Added to the Hessian, whose diagonal is about 1: kernels that overlap make it singular.
_RIDGE = 1e-9


@dataclass(frozen=True)
class DensityRatio:
    """A fitted ratio of densities.

    Parameters
    ----------
    centres
        Centres (x, y) of the kernels, shape (b, 2).
    width
        Standard deviation of the kernels.
    weights
        Weights of the kernels, shape (b,), none of them negative.
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
    """Fit the ratio of densities to pairs of values.

    Parameters
    ----------
    x, y
        Values, shape (n,).
    centres
        Centres (x, y) of the kernels, shape (b, 2); usually some of the pairs.
    width
        Standard deviation of the kernels.
    tolerance
        By how much the mean of log w may fall short of its maximum.
    """
    along_x, along_y = _kernels(np.asarray(x), np.asarray(y), centres, width)
    # The mean of a kernel over all combinations of x and y is a product, too.
    means = along_x.mean(axis=0) * along_y.mean(axis=0)
    shares = _most_likely(along_x * along_y / means, tolerance)
    return DensityRatio(centres, width, shares / means)


def choose_width(x: FloatArray, y: FloatArray, centres: FloatArray, seed: int = 0) -> float:
    """Return the width of `WIDTHS` under which pairs that took no part in a fit are likeliest.

    Too few pairs to hold some out take the widest, which assumes the least.
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

    Mutual information does not change under monotone functions of either image; with normal scores
    one kernel width fits optical images as well as the long tails of radar images.
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
        Standard deviation of the kernels in those of the normal scores; None: chosen by
        cross-validation.
    sample
        Most pairs that are used; they are drawn from all.
    kernels
        Most kernels that are used.
    seed
        Of the sample and of the cross-validation.
    tolerance
        By how much the result may fall short of the most likely one.
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
    """Return the mutual information of a sample of a template's pixels over all whole shifts.

    The width of the kernels is chosen once, at the shift of the most informative
    histogram, and is then the same for all.

    Parameters
    ----------
    template
        Shape (h, w).
    search
        A window with the same centre, larger by the radius on each side.
    sample
        Most pixels that are used; they are the same at all shifts.
    context
        Threads to work in; its progress receives every row, its seed is that of the sample and of
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
    """Return the shift (rows, columns), from 0, of the highest mutual information of histograms."""
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
    """Return logarithms, those of ratios that were rounded to 0 as of the smallest number."""
    return np.asarray(np.log(np.maximum(ratio, np.finfo(float).tiny)))


def _most_likely(kernels: FloatArray, tolerance: float) -> FloatArray:
    """Return shares ≥ 0 of kernels of mean 1, shape (n, b), that maximise Σ log(kernels · shares).

    Their sum is 1. Steps of expectation and maximisation start, from equal shares; Newton's steps
    within the constraint, each a problem of least squares, finish. The problem is convex. No
    kernel's gradient may exceed 1 at the maximum, and by what it does the likelihood falls short of
    it at most.
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
    """Return a function whose minimum over shares ≥ 0 has a sum of 1 by itself."""
    return float(shares.sum() - np.log(kernels @ shares).mean())


def _newton_step(kernels: FloatArray, shares: FloatArray, gradient: FloatArray) -> FloatArray:
    """Return the minimum of the loss' parabola at `shares`, or a point on the way that is lower."""
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
