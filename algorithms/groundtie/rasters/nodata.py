"""Nodata: numbers that GDAL equates with the nodata value, non-measurements, and marking."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

# GDAL equates numbers that differ by less than this share of their sum, also in double precision:
# `ARE_REAL_EQUAL` of its gcore/gdal_priv.h. This allows for values that were rounded as text.
_TOLERANCE = 2 * np.finfo(np.float32).eps

# ArcGIS fills floating-point pixels with it by default, and files often lose its declaration.
_LOWEST = float(np.finfo(np.float32).min)


@lru_cache
def nodata_range(nodata: float, dtype: np.dtype[Any]) -> tuple[Any, Any]:
    """Return the smallest and the largest number that GDAL equates with a nodata value.

    Parameters
    ----------
    nodata
        The value, which `dtype` can hold.
    dtype
        Type of the pixels: integers are compared exactly, complex numbers by their real parts.
    """
    own = dtype.type(nodata).real
    if dtype.kind not in "fc" or not np.isfinite(own) or own == 0:
        return own, own
    with np.errstate(over="ignore"):
        # If the sum of equal numbers overflows, all larger numbers are equal for GDAL, too.
        beyond = np.inf if np.isinf(2 * own) else abs(own) * own.dtype.type(1 + 4 * _TOLERANCE)
    ends = [_last_same(own, end) for end in (0.0, beyond)]
    return min(ends), max(ends)


def is_nodata(values: NDArray[Any], nodata: float, dtype: np.dtype[Any]) -> NDArray[np.bool_]:
    """Return which values, of pixels of type `dtype`, GDAL equates with a nodata value.

    Complex numbers with an imaginary part are not nodata, although GDAL compares the real part
    alone: with some phase it may equal the nodata value, which is 0 in many files.
    """
    if values.dtype.kind == "c":
        return np.asarray(is_nodata(values.real, nodata, dtype) & (values.imag == 0))
    low, high = nodata_range(nodata, dtype)
    if low == high:
        return np.asarray(values == low)
    # Hardly any pixel with data lies beyond the end nearest to 0; if none does, one test suffices.
    beyond = np.asarray(values <= high if high < 0 else values >= low)
    if beyond.any():
        beyond &= values >= low if high < 0 else values <= high
    return beyond


def are_measured(values: NDArray[Any]) -> NDArray[np.bool_]:
    """Return which floating-point or complex values may be measurements, whatever a file declares.

    Not measurements are NaN, infinity, numbers that GDAL equates with the lowest number of single
    precision, and lower ones. Complex values need only be finite.
    """
    if values.dtype.kind == "c":
        return np.asarray(np.isfinite(values))
    # False for NaN, too.
    measured = np.asarray(values > nodata_range(_LOWEST, values.dtype)[1])
    measured &= values < np.inf
    return measured


def put_nodata(values: NDArray[Any], valid: NDArray[np.bool_], nodata: float | None) -> None:
    """Set invalid pixels to the nodata value, or to 0 if there is none, in place."""
    fill = values.dtype.type(0 if nodata is None else nodata)
    if nodata is not None:
        keep_apart(values, fill)
    values[~valid] = fill


def keep_apart(values: NDArray[Any], fill: Any) -> None:
    """Change values that GDAL would read as nodata by the smallest possible step, in place.

    Complex values are compared by their real parts.
    """
    part, nodata = values.real, fill.real
    if part.dtype.kind != "f":
        neighbour = nodata + 1 if nodata < np.iinfo(part.dtype).max else nodata - 1
        part[part == nodata] = neighbour
    elif np.isfinite(nodata):
        nearest_0 = min(nodata_range(float(nodata), part.dtype), key=abs)
        apart = np.nextafter(nearest_0, part.dtype.type(0 if nodata else 1))
        part[is_nodata(part, float(nodata), part.dtype)] = apart


def _last_same(own: Any, end: Any) -> Any:
    """Return the last number towards the magnitude `end` that GDAL equates with `own`."""
    # Magnitudes are ordered as their bits, which are bisected: in double precision, and if sums
    # overflow, there are too many numbers to test each.
    bits = np.dtype(f"i{own.dtype.itemsize}")
    same, other = (int(abs(own.dtype.type(value)).view(bits)) for value in (own, end))
    while abs(other - same) > 1:
        middle = (same + other) // 2
        value = np.copysign(bits.type(middle).view(own.dtype), own)
        same, other = (middle, other) if _are_same(value, own) else (same, middle)
    return np.copysign(bits.type(same).view(own.dtype), own)


def _are_same(value: Any, own: Any) -> bool:
    # As in GDAL: in the precision of the pixels, in which sums of large numbers overflow.
    with np.errstate(over="ignore"):
        return bool(abs(value - own) < own.dtype.type(_TOLERANCE) * abs(value + own))
