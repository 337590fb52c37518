"""Medians, robust standard deviations and quantiles, by numpy's quick partial sorting.

Results equal those of `numpy.median` and `numpy.quantile`, which take several times as long.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

# NumPy sorts and selects by vector instructions since version 2. Before, selecting within one of
# _BUCKETS buckets is quicker from _MANY values on.
_MANY = np.inf if np.lib.NumpyVersion(np.__version__) >= "2.0.0" else 4096
_BUCKETS = 1024

# Standard deviation of a normal distribution over its median absolute deviation: 1 / Φ⁻¹(3/4).
DEVIATION_PER_MAD = 1.4826


def upper_median(values: NDArray[Any]) -> Any:
    """Return medians along the last axis; the upper of the middle two of an even number."""
    count = values.shape[-1]
    if count < _MANY:
        return np.partition(values, count // 2, axis=-1)[..., count // 2]
    rows = values.reshape(-1, count)
    found = np.array([_ordered(row, count // 2, count // 2)[0] for row in rows])
    return found.reshape(values.shape[:-1])


def median(values: NDArray[Any]) -> Any:
    """Return the median of values of any shape; the mean of the middle two of an even number."""
    middle = values.size // 2
    return np.mean(
        _ordered(values.ravel(), middle - 1 + values.size % 2, middle), dtype=values.dtype
    )


def robust_deviation(values: NDArray[Any]) -> float:
    """Return the robust standard deviation of values of any shape (by MAD)."""
    return DEVIATION_PER_MAD * float(median(np.abs(values - median(values))))


def quantiles(values: NDArray[Any], shares: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the quantiles of values, of any shape, at shares, (n,), interpolated linearly."""
    place = shares * (values.size - 1)
    below = np.floor(place).astype(int)
    above = np.minimum(below + 1, values.size - 1)
    # Not np.partition, which selects several places one by one.
    ordered = np.sort(values, axis=None)
    low, high, fraction = ordered[below], ordered[above], place - below
    # Interpolated from the nearer of the two, as numpy does.
    step = high - low
    return np.where(fraction < 0.5, low + step * fraction, high - step * (1 - fraction))


def _ordered(values: NDArray[Any], first: int, last: int) -> NDArray[Any]:
    """Return the values at ranks `first` to `last`, one or two, of values of shape (n,)."""
    if values.size < _MANY:
        return _selected(values, first, last)
    low, high = values.min(), values.max()
    if not 0 < high - low < np.inf:
        return _selected(values, first, last)
    bucket = ((values - low) * ((_BUCKETS - 1) / (high - low))).astype(np.uint16)
    up_to = np.bincount(bucket).cumsum()
    lowest, highest = up_to.searchsorted([first, last], side="right")
    among = values[(bucket >= lowest) & (bucket <= highest)]
    fewer = up_to[lowest - 1] if lowest else 0
    return _selected(among, first - fewer, last - fewer)


def _selected(values: NDArray[Any], first: int, last: int) -> NDArray[Any]:
    ordered = np.partition(values, last)
    # Selecting one place alone is quicker than two.
    return ordered[[last]] if first == last else np.array([ordered[:last].max(), ordered[last]])
