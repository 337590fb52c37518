"""Medians and quantiles of chips, by the quick ways that numpy has to order single values.

They have the digits of `numpy.median` and `numpy.quantile`, which take several times as long.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

# Of so many values and more, a sample of so many shows where the median lies.
_LARGE, _SAMPLE = 4096, 512


def upper_median(values: NDArray[Any]) -> Any:
    """Return medians along the last axis; of an even number the upper of the middle two."""
    size = values.shape[-1]
    if size < _LARGE:
        return np.partition(values, size // 2, axis=-1)[..., size // 2]
    found = [ordered[k] for ordered, k in map(_middle, values.reshape(-1, size))]
    return np.array(found, values.dtype).reshape(values.shape[:-1])


def median(values: NDArray[Any]) -> Any:
    """Return the median of values of any shape; of an even number the mean of the middle two."""
    ordered, middle = _middle(values.ravel())
    if values.size % 2:
        return ordered[middle]
    return np.mean([ordered[:middle].max(), ordered[middle]], dtype=values.dtype)


def _middle(values: NDArray[Any]) -> tuple[NDArray[Any], int]:
    """Return values, (n,), parted by the upper median, and where it is; of many only the nearest.

    A sample shows between which two values it lies, which leaves few to order [Floyd1975].
    """
    middle = len(values) // 2
    if len(values) >= _LARGE:
        sample = np.sort(values[:: len(values) // _SAMPLE])
        apart = 2 * math.isqrt(len(sample))
        low, high = sample[len(sample) // 2 - apart], sample[len(sample) // 2 + apart]
        place = middle - int(np.count_nonzero(values < low))
        near = values[(values >= low) & (values <= high)]
        if 0 < place < len(near):
            return np.partition(near, place), place
    return np.partition(values, middle), middle


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
