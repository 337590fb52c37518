"""Medians and quantiles of chips, by the quick ways that numpy has to order single values.

They have the digits of `numpy.median` and `numpy.quantile`, which take several times as long.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

# From so many values on, it is quicker to select among those of a bucket alone, of so many.
_MANY, _BUCKETS = 4096, 1024


def upper_median(values: NDArray[Any]) -> Any:
    """Return medians along the last axis; of an even number the upper of the middle two."""
    count = values.shape[-1]
    if count < _MANY:
        return np.partition(values, count // 2, axis=-1)[..., count // 2]
    rows = values.reshape(-1, count)
    found = np.array([_ordered(row, count // 2, count // 2)[0] for row in rows])
    return found.reshape(values.shape[:-1])


def median(values: NDArray[Any]) -> Any:
    """Return the median of values of any shape; of an even number the mean of the middle two."""
    middle = values.size // 2
    return np.mean(
        _ordered(values.ravel(), middle - 1 + values.size % 2, middle), dtype=values.dtype
    )


def quantiles(values: NDArray[Any], shares: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the values, (n,), below which shares of values lie, interpolated linearly, (n,)."""
    place = shares * (values.size - 1)
    below = np.floor(place).astype(int)
    above = np.minimum(below + 1, values.size - 1)
    ordered = np.partition(values, np.union1d(below, above), axis=None)
    low, high, fraction = ordered[below], ordered[above], place - below
    # From the nearer of the two, as numpy has it.
    step = high - low
    return np.where(fraction < 0.5, low + step * fraction, high - step * (1 - fraction))


def _ordered(values: NDArray[Any], first: int, last: int) -> NDArray[Any]:
    """Return the values at places `first` to `last` when all, (n,), are in rising order."""
    places = np.arange(first, last + 1)
    low, high = values.min(), values.max()
    if values.size < _MANY or not 0 < high - low < np.inf:
        return np.partition(values, places)[places]
    bucket = ((values - low) * ((_BUCKETS - 1) / (high - low))).astype(np.uint16)
    up_to = np.bincount(bucket).cumsum()
    lowest, highest = up_to.searchsorted([first, last], side="right")
    among = values[(bucket >= lowest) & (bucket <= highest)]
    places -= up_to[lowest - 1] if lowest else 0
    return np.partition(among, places)[places]
