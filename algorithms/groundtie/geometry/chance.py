"""Probability that random matches agree as well as the observed ones (a contrario reasoning).

A random match is distributed uniformly over its search window. It falls within the tolerance of a
model with probability p = tolerance area / window area. The probability that at least k of n such
matches agree is a binomial tail ([Moisan2004]).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln, logsumexp, xlog1py, xlogy

from ..rasters.grid import FloatArray
from ..rasters.lattice import ON_PIXELS


def agreement_probability(tolerance_px: float, radius_px: int) -> float:
    """Return the probability that a random match agrees with a model.

    Parameters
    ----------
    tolerance_px
        Distance within which a match agrees.
    radius_px
        Largest shift of the search window, a square.
    """
    return min(math.pi * tolerance_px**2 / (2 * radius_px + 1) ** 2, 1.0)


def log10_chance(agreeing: int, total: int, probability: float) -> float:
    """Return log10 of the probability that `agreeing` or more of `total` random matches agree."""
    if total == 0 or agreeing == 0:
        return 0.0
    count = np.arange(agreeing, total + 1)
    terms = _log_binomial(total, count) + xlogy(count, probability)
    return float(logsumexp(terms + xlog1py(total - count, -probability)) / math.log(10))


def log10_false_alarms(agreeing: int, total: int, probability: float, sample: int) -> float:
    """Return log10 of the expected number of random models with at least as many agreeing matches.

    Parameters
    ----------
    agreeing, total
        Numbers of agreeing matches and of all matches, each with those that define the model.
    probability
        Probability that a random match agrees.
    sample
        Number of matches that define a model; each such subset counts as a model tried.
    """
    if agreeing <= sample:
        return math.inf
    log_subsets = float(_log_binomial(total, np.array(sample)))
    chance = log10_chance(agreeing - sample, total - sample, probability)
    return float(log_subsets / math.log(10) + chance)


def log10_least_false_alarms(lengths_px: FloatArray, area_px2: float, sample: int) -> float:
    """Return `log10_false_alarms` at the tolerance radius that minimises it.

    The number of radii tried is accounted for. Matches with a length of NaN agree at no radius, and
    no radius is smaller than the last digit of positions.

    Parameters
    ----------
    lengths_px
        Lengths of the residuals, shape (n,), n > `sample`.
    area_px2
        Area over which random matches are distributed.
    sample
        See `log10_false_alarms`.
    """
    radii = np.nan_to_num(np.sort(lengths_px)[sample:], nan=np.inf).clip(min=ON_PIXELS)
    probabilities = np.minimum(math.pi * radii**2 / area_px2, 1.0).tolist()
    alarms = [
        log10_false_alarms(agreeing, len(lengths_px), probability, sample)
        for agreeing, probability in enumerate(probabilities, start=sample + 1)
    ]
    return min(alarms) + math.log10(len(alarms))


def _log_binomial(total: int, count: NDArray[np.int_]) -> NDArray[np.float64]:
    return np.asarray(gammaln(total + 1) - gammaln(count + 1) - gammaln(total - count + 1))
