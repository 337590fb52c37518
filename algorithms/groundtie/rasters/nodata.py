"""Which numbers hold no data: those that GDAL takes for the nodata value, and no measurements."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

# Numbers that differ by less than this share of their sum, also of double precision, are the same
# for GDAL: `ARE_REAL_EQUAL` of its gcore/gdal_priv.h. It meets values that were rounded as text.
_TOLERANCE = 2 * np.finfo(np.float32).eps

# ArcGIS fills pixels of floating-point numbers with it by default, and files lose the statement.
_LOWEST = float(np.finfo(np.float32).min)


@lru_cache
def nodata_range(nodata: float, dtype: np.dtype[Any]) -> tuple[Any, Any]:
    """Return the least and the greatest number that GDAL takes for a nodata value.

    Parameters
    ----------
    nodata
        The value, which `dtype` can hold.
    dtype
        Type of the pixels: integers are compared exactly, of complex numbers the real parts.
    """
    own = dtype.type(nodata).real
    if dtype.kind not in "fc" or not np.isfinite(own) or own == 0:
        return own, own
    with np.errstate(over="ignore"):
        # Where the sum of equal numbers is infinite, all greater ones are the same, too.
        beyond = np.inf if np.isinf(2 * own) else abs(own) * own.dtype.type(1 + 4 * _TOLERANCE)
    ends = [_last_same(own, end) for end in (0.0, beyond)]
    return min(ends), max(ends)


def is_nodata(values: NDArray[Any], nodata: float, dtype: np.dtype[Any]) -> NDArray[np.bool_]:
    """Return which values, of pixels of type `dtype`, GDAL takes for a nodata value.

    Complex numbers with an imaginary part are none, though their real part alone counts for GDAL:
    any phase may turn it to the value, which is 0 in many files.
    """
    if values.dtype.kind == "c":
        return np.asarray(is_nodata(values.real, nodata, dtype) & (values.imag == 0))
    low, high = nodata_range(nodata, dtype)
    if low == high:
        return np.asarray(values == low)
    # Beyond the end next to 0 lies hardly a pixel with data, and often none: then that is all.
    beyond = np.asarray(values <= high if high < 0 else values >= low)
    if beyond.any():
        beyond &= values >= low if high < 0 else values <= high
    return beyond


def are_measured(values: NDArray[Any]) -> NDArray[np.bool_]:
    """Return which floating-point or complex values may be measurements, whatever a file states.

    NaN and infinity are none, nor is what GDAL takes for the lowest number of single precision, nor
    what lies below.
    """
    if values.dtype.kind == "c":
        return np.asarray(np.isfinite(values))
    # Also false where they are NaN.
    measured = np.asarray(values > nodata_range(_LOWEST, values.dtype)[1])
    measured &= values < np.inf
    return measured


def _last_same(own: Any, end: Any) -> Any:
    """Return the number towards the magnitude `end` that is the last to be the same as `own`."""
    # Magnitudes have the order of their bits. They are bisected: of double precision, and where
    # sums are infinite, there are too many to go through.
    bits = np.dtype(f"i{own.dtype.itemsize}")
    same, other = (int(abs(own.dtype.type(value)).view(bits)) for value in (own, end))
    while abs(other - same) > 1:
        middle = (same + other) // 2
        value = np.copysign(bits.type(middle).view(own.dtype), own)
        same, other = (middle, other) if _are_same(value, own) else (same, middle)
    return np.copysign(bits.type(same).view(own.dtype), own)


def _are_same(value: Any, own: Any) -> bool:
    # As GDAL: in the precision of the pixels, where sums of large numbers are infinite.
    with np.errstate(over="ignore"):
        return bool(abs(value - own) < own.dtype.type(_TOLERANCE) * abs(value + own))
