"""How likely matches that fell anywhere would agree as well as these do (a contrario reasoning).

A match by chance falls anywhere in its search window, and within the tolerance of a model
with probability p = tolerance area / window area. That at least k of n such matches agree is a
binomial tail ([Moisan2004]).
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaln, logsumexp, xlog1py, xlogy

from ..rasters.grid import FloatArray


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
    """Return log10 of the probability that so many of `total` random matches agree, or more."""
    if total == 0 or agreeing == 0:
        return 0.0
    count = np.arange(agreeing, total + 1)
    terms = _log_binomial(total, count) + xlogy(count, probability)
    return float(logsumexp(terms + xlog1py(total - count, -probability)) / math.log(10))


def log10_false_alarms(agreeing: int, total: int, probability: float, sample: int) -> float:
    """Return log10 of the expected number of random models that so many matches would agree with.

    Parameters
    ----------
    agreeing, total
        Matches that agree, and all matches, those that define the model included.
    probability
        That a random match agrees.
    sample
        Matches that define a model; each such subset is a model that was tried.
    """
    if agreeing <= sample:
        return math.inf
    log_subsets = float(_log_binomial(total, np.array(sample)))
    chance = log10_chance(agreeing - sample, total - sample, probability)
    return float(log_subsets / math.log(10) + chance)


def log10_least_false_alarms(lengths_px: FloatArray, area_px2: float, sample: int) -> float:
    """Return that of matches with residuals of some lengths, shape (n,), n > `sample`.

    They agree within whatever radius is the least likely, of all that were tried; those of NaN
    within none.

    Parameters
    ----------
    lengths_px
        Lengths of the residuals.
    area_px2
        Area in which matches by chance fall anywhere.
    sample
        See `log10_false_alarms`.
    """
    radii = np.nan_to_num(np.sort(lengths_px)[sample:], nan=np.inf)
    probabilities = np.minimum(math.pi * radii**2 / area_px2, 1.0).tolist()
    alarms = [
        log10_false_alarms(agreeing, len(lengths_px), probability, sample)
        for agreeing, probability in enumerate(probabilities, start=sample + 1)
    ]
    return min(alarms) + math.log10(len(alarms))


def _log_binomial(total: int, count: NDArray[np.int_]) -> NDArray[np.float64]:
    return np.asarray(gammaln(total + 1) - gammaln(count + 1) - gammaln(total - count + 1))
