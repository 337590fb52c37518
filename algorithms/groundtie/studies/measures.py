"""Joint-histogram measures that studies compare with the product's ([Suri2010] 3.3, 2.3.1)."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from ..similarity.measures import (
    NOTHING,
    FloatArray,
    HistogramMeasure,
    Histograms,
    entropy,
    normalized_mutual_information,
    tables,
)


def mutual_information(histograms: Histograms) -> FloatArray:
    """Return Shannon's H(A) + H(B) - H(A, B) in nats ([Suri2010] eq 3.19)."""
    a, b, ab = map(entropy, tables(histograms))
    return np.asarray(a + b - ab)


def renyi_mutual_information(alpha: float) -> HistogramMeasure:
    """Return the measure R(A) + R(B) - R(A, B) with Rényi's entropy ([Suri2010] eq 3.15, 3.16).

    Parameters
    ----------
    alpha
        Order of the entropy, any real number; 1 is Shannon's, as the limit. Unlike Shannon's, the
        measure of other orders may be negative.
    """
    if alpha == 1:
        return mutual_information

    def measure(histograms: Histograms) -> FloatArray:
        a, b, ab = (_log_power_sum(table, alpha) for table in tables(histograms))
        return np.asarray((a + b - ab) / (1 - alpha))

    return measure


def tsallis_mutual_information(q: float) -> HistogramMeasure:
    """Return the measure S(A) + S(B) + (1 - q) S(A) S(B) - S(A, B) ([Suri2010] eq 3.17, 3.18).

    Tsallis' entropy is not additive; the cross term makes the measure 0 for independent images.
    With S = (Σ p^q - 1) / (1 - q) the measure is (Σ p_A^q Σ p_B^q - Σ p_AB^q) / (1 - q).

    Parameters
    ----------
    q
        Index of the entropy, any real number; 1 is Shannon's, as the limit.
    """
    if q == 1:
        return mutual_information

    def measure(histograms: Histograms) -> FloatArray:
        # Far from 1, powers are infinite, and the measure is NaN.
        with np.errstate(over="ignore", invalid="ignore"):
            a, b, ab = (np.exp(_log_power_sum(table, q)) for table in tables(histograms))
            return np.asarray((a * b - ab) / (1 - q))

    return measure


def cluster_reward(histograms: Histograms) -> FloatArray:
    """Return the index of the cluster reward algorithm, 0 (independent) to 1 (one to one).

    It is (Φ / F - F / N²) / (1 - F / N²), where Φ is the sum of the squared joint counts, F² the
    product of the sums of the squared marginal counts and N the number of pixels [Inglada2004].
    """
    a, b, ab = (np.square(_shares(table)).sum(axis=-1) for table in tables(histograms))
    chance = np.sqrt(a * b)
    informative = (chance > 0) & (chance < 1 - NOTHING)
    chance = np.where(informative, chance, 0.5)
    return np.where(informative, (ab / chance - chance) / (1 - chance), 0.0)


def correlation_ratio(histograms: Histograms) -> FloatArray:
    """Return the share of A's variance that a function of B explains, 0 to 1.

    Source: [Roche1998]. The grey value of a bin is its number. A should be the template, whose
    variance is the same at all shifts. To swap the roles, transpose the histogram.
    """
    a, b, _ = tables(histograms)
    levels = np.arange(a.shape[-1], dtype=float)
    sums = levels @ histograms
    total = _at_least(a.sum(axis=-1))
    mean = (sums.sum(axis=-1) / total)[..., None]
    explained = ((sums - mean * b) ** 2 / _at_least(b)).sum(axis=-1) / total
    variance = (a * (levels - mean) ** 2).sum(axis=-1) / total
    informative = variance > NOTHING
    return np.where(informative, explained / np.where(informative, variance, 1.0), 0.0)


def _at_least(counts: FloatArray) -> FloatArray:
    """Return counts as divisors, with 1 for empty bins, whose numerators are 0 as well."""
    return np.where(counts > 0, counts, 1.0)


def _shares(table: FloatArray) -> FloatArray:
    return table / _at_least(table.sum(axis=-1))[..., None]


def _log_power_sum(table: FloatArray, power: float) -> FloatArray:
    """Return ln Σ p^power over the occupied cells; 0 for an empty or a one-cell table."""
    shares = _shares(table.astype(float))
    occupied = shares > 0
    exponents = np.where(occupied, power * np.log(np.where(occupied, shares, 1.0)), -np.inf)
    # Relative to the largest term, which a high power would otherwise round to 0.
    largest = exponents.max(axis=-1, keepdims=True, initial=-np.inf)
    largest = np.where(np.isfinite(largest), largest, 0.0)
    total = np.exp(exponents - largest).sum(axis=-1)
    return np.log(np.where(total > 0, total, 1.0)) + largest[..., 0]


# The parametrised entropies have their usual orders here.
HISTOGRAM_MEASURES: Mapping[str, HistogramMeasure] = MappingProxyType(
    {
        "nmi": normalized_mutual_information,
        "mi": mutual_information,
        "renyi": renyi_mutual_information(2.0),
        "tsallis": tsallis_mutual_information(2.0),
        "cluster-reward": cluster_reward,
        "correlation-ratio": correlation_ratio,
    }
)
