"""The squared orientation field: structure that survives a change of modality.

Edges keep their place and direction between a SAR and an optical image when their contrast does
not keep its sign. Squaring the complex gradient makes opposite directions the same; dividing by
its magnitude makes weak and strong edges alike (orientation correlation [Fitch2002];
normalised gradient fields [Haber2006]). The strength of edges is a measure of its own: see
`edge_strength`.
"""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from ..rasters.patch import Patch
from .order_statistics import median, upper_median

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
    if is_logarithmic(window):
        return np.where(window.valid, window.values, median(values))
    positive = values[values > 0]
    middle = median(positive) if positive.size else np.float32(1)
    filled = np.where(window.valid, window.values, middle)
    return np.log(np.maximum(filled, 0) / middle + np.float32(_LOG_OFFSET))


def is_logarithmic(window: Patch) -> bool:
    """Return whether grey values are in decibels already: many are negative."""
    values = window.values[window.valid]
    return values.size > 0 and bool(np.mean(values < 0) > _NEGATIVE_SHARE)


def orientation_fields(window: Patch) -> NDArray[np.complex64]:
    """Return the squared gradients of a window at all of `SCALES_PX`, shape (scales, h, w)."""
    return squared_gradients(compress(window), window.valid)


def squared_gradients(
    compressed: NDArray[np.float32],
    valid: NDArray[np.bool_],
    scales_px: Sequence[float] = SCALES_PX,
) -> NDArray[np.complex64]:
    """Return the squared, soft-normalised gradients of an image, zero near masked pixels.

    Parameters
    ----------
    compressed, valid
        Grey values (see `compress`) and which of them count, shape (h, w).
    scales_px
        Standard deviations of the Gaussian derivatives.

    Returns
    -------
    Shape (scales, h, w).
    """
    gradients = np.stack([_gradient(compressed, scale) for scale in scales_px])
    gx, gy = gradients[:, 0], gradients[:, 1]
    square_x, square_y = gx * gx, gy * gy
    # Not cv2.magnitude, whose last digits depend on where arrays lie in memory.
    size = np.sqrt(square_x + square_y)
    rounding = np.float32(_ROUNDING * np.abs(compressed).max(initial=0))
    usable = size > rounding
    if not valid.all():
        usable &= np.stack([_erode(valid, scale) for scale in scales_px])
    typical = np.array([_typical(s[u]) for s, u in zip(size, usable, strict=True)], np.float32)
    divisor = (size + typical[:, None, None]) * size
    weight = np.zeros_like(size)
    np.divide(1, divisor, out=weight, where=usable)
    real, imaginary = (square_x - square_y) * weight, 2 * gx * gy * weight
    fields = np.empty((*size.shape, 2), np.float32)
    for field, *parts in zip(fields, real, imaginary, strict=True):
        cv2.merge(parts, field)
    return fields.view(np.complex64)[..., 0]


def edge_strength(finest: NDArray[np.complex64], valid: NDArray[np.bool_]) -> Patch:
    """Return how strong edges are, whatever their direction: 0 (none) to 1.

    Parameters
    ----------
    finest
        The squared gradients at the first of `SCALES_PX`, shape (h, w).
    valid
        Which pixels of the image count, shape (h, w). Strength counts a few pixels less.
    """
    # Not np.abs, whose last digits may depend on where arrays lie in memory.
    strength = np.sqrt(finest.real**2 + finest.imag**2)
    return Patch(strength, valid if valid.all() else _erode(valid, SCALES_PX[0]))


def _gradient(image: NDArray[np.float32], scale_px: float) -> NDArray[np.float32]:
    """Return the derivatives of an image along columns and rows, shape (2, h, w)."""
    reach = int(np.ceil(4 * scale_px))
    x = np.arange(-reach, reach + 1, dtype=np.float64)
    smooth = np.exp(-(x**2) / (2 * scale_px**2))
    smooth /= smooth.sum()
    slope = x / scale_px**2 * smooth
    border = cv2.BORDER_REFLECT
    along_cols = cv2.sepFilter2D(image, cv2.CV_32F, slope, smooth, borderType=border)
    along_rows = cv2.sepFilter2D(image, cv2.CV_32F, smooth, slope, borderType=border)
    return np.stack([along_cols, along_rows])


def _typical(sizes: NDArray[np.float32]) -> np.float32:
    return np.float32(upper_median(sizes)) if sizes.size else np.float32(1)


def _erode(valid: NDArray[np.bool_], scale_px: float) -> NDArray[np.bool_]:
    size = 2 * int(np.ceil(_REACH * scale_px)) + 1
    return cv2.erode(valid.astype(np.uint8), np.ones((size, size), np.uint8)) > 0
