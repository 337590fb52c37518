"""The squared orientation field: structure that survives a change of modality.

Edges keep their place and direction between a SAR and an optical image when their contrast does
not keep its sign. Squaring the complex gradient makes opposite directions the same; dividing by
its magnitude makes weak and strong edges alike (orientation correlation: Fitch et al. 2002;
normalised gradient fields: Haber & Modersitzki 2006).
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ..rasters.patch import Patch

# Standard deviations of the Gaussian derivatives, in pixels; their surfaces are added up.
SCALES_PX = (0.8, 1.2, 2.0)

# A masked pixel spoils the gradient within this many standard deviations.
_REACH = 3.0

# Share of the median that is added before the logarithm, so that dark noise is not blown up.
_LOG_OFFSET = 0.1

# Gradients below this share of the largest value are rounding: where nothing varies, they would
# all point the same way.
_ROUNDING = 1e-5

# More negative values than this do not come from resampling.
_NEGATIVE_SHARE = 0.02


def compress(window: Patch) -> NDArray[np.float32]:
    """Return grey values on a logarithmic scale, on which speckle is additive.

    Images with negative values are taken to be on such a scale already (decibels); a few may
    come from resampling. Masked pixels get the median.
    """
    values = window.values[window.valid]
    if values.size == 0:
        return np.zeros_like(window.values)
    if np.mean(values < 0) > _NEGATIVE_SHARE:
        return np.where(window.valid, window.values, np.float32(np.median(values)))
    positive = values[values > 0]
    median = np.float32(np.median(positive)) if positive.size else np.float32(1)
    filled = np.where(window.valid, window.values, median)
    return np.log(np.maximum(filled, 0) / median + np.float32(_LOG_OFFSET))


def orientation_field(
    compressed: NDArray[np.float32], valid: NDArray[np.bool_], scale_px: float
) -> NDArray[np.complex64]:
    """Return the squared, soft-normalised gradient of an image, zero near masked pixels.

    Parameters
    ----------
    compressed, valid
        Grey values (see `compress`) and which of them count, shape (h, w).
    scale_px
        Standard deviation of the Gaussian derivative.
    """
    reach = int(np.ceil(4 * scale_px))
    x = np.arange(-reach, reach + 1, dtype=np.float64)
    smooth = np.exp(-(x**2) / (2 * scale_px**2))
    smooth /= smooth.sum()
    slope = x / scale_px**2 * smooth
    border = cv2.BORDER_REFLECT
    gx = cv2.sepFilter2D(compressed, cv2.CV_32F, slope, smooth, borderType=border)
    gy = cv2.sepFilter2D(compressed, cv2.CV_32F, smooth, slope, borderType=border)
    # Not cv2.magnitude, whose last digits depend on where arrays lie in memory.
    size = np.sqrt(gx * gx + gy * gy)
    rounding = np.float32(_ROUNDING * np.abs(compressed).max(initial=0))
    usable = _erode(valid, scale_px) & (size > rounding)
    typical = np.float32(np.median(size[usable])) if usable.any() else np.float32(1)
    weight = np.where(usable, 1 / ((size + typical) * np.maximum(size, 1e-12)), 0)
    field = np.empty(size.shape, np.complex64)
    field.real = (gx * gx - gy * gy) * weight
    field.imag = 2 * gx * gy * weight
    return field


def orientation_fields(window: Patch) -> list[NDArray[np.complex64]]:
    """Return the orientation fields of a window at all of `SCALES_PX`."""
    compressed = compress(window)
    return [orientation_field(compressed, window.valid, scale) for scale in SCALES_PX]


def _erode(valid: NDArray[np.bool_], scale_px: float) -> NDArray[np.bool_]:
    if valid.all():
        return valid
    size = 2 * int(np.ceil(_REACH * scale_px)) + 1
    return cv2.erode(valid.astype(np.uint8), np.ones((size, size), np.uint8)) > 0
