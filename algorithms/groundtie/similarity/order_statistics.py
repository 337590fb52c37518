"""Medians and quantiles of chips, by the quick ways that numpy has to order single values.

They have the digits of `numpy.median` and `numpy.quantile`, which take several times as long.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def upper_median(values: NDArray[Any]) -> Any:
    """Return medians along the last axis; of an even number the upper of the middle two."""
    middle = values.shape[-1] // 2
    return np.partition(values, middle, axis=-1)[..., middle]


def median(values: NDArray[Any]) -> Any:
    """Return the median of values of any shape; of an even number the mean of the middle two."""
    middle = values.size // 2
    ordered = np.partition(values, middle, axis=None)
    if values.size % 2:
        return ordered[middle]
    return np.mean([ordered[:middle].max(), ordered[middle]], dtype=values.dtype)


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
