"""The squared orientation field: structure that survives a change of modality.

Between a SAR and an optical image, edges keep their place and direction even where their contrast
changes its sign. Squaring the complex gradient makes opposite directions equal; dividing by its
magnitude gives weak and strong edges the same weight (orientation correlation [Fitch2002];
normalised gradient fields [Haber2006]). The strength of edges is a measure of its own: see
`edge_strength`.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from ..rasters.grid import FloatArray
from ..rasters.patch import Patch, has_negative
from ..rasters.reading import FloatImage
from .order_statistics import median, upper_median
from .stacks import each, flat

# Standard deviations of the Gaussian derivatives, in pixels; their surfaces are added up.
SCALES_PX = (0.8, 1.2, 2.0)

# A masked pixel corrupts the gradient within this many standard deviations.
_REACH = 3.0

# Share of the median that is added before the logarithm, so that dark noise is not amplified.
_LOG_OFFSET = 0.1

# Gradients below this share of the largest value are rounding: in constant areas they would all
# point in one direction.
ROUNDING = 1e-5


def compress(window: Patch) -> NDArray[np.float32]:
    """Return grey values on a logarithmic scale, on which speckle is additive, shape (…, h, w).

    Images with negative values are assumed to be on such a scale already (decibels), except for a
    few, which may come from resampling. Masked pixels get the median.
    """
    return each(_compressed, window.values, window.valid)


def _compressed(values: NDArray[np.float32], valid: NDArray[np.bool_]) -> NDArray[np.float32]:
    known = values[valid]
    if known.size == 0:
        return np.zeros_like(values)
    if has_negative(known):
        return np.where(valid, values, median(known))
    positive = known[known > 0]
    middle = median(positive) if positive.size else np.float32(1)
    filled = np.where(valid, values, middle)
    return np.log(np.maximum(filled, 0) / middle + np.float32(_LOG_OFFSET))


def orientation_fields(window: Patch) -> NDArray[np.complex64]:
    """Return the squared gradients of a window at all of `SCALES_PX`, shape (scales, …, h, w)."""
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
        Grey values (see `compress`) and their validity, shape (…, h, w).
    scales_px
        Standard deviations of the Gaussian derivatives.

    Returns
    -------
    Shape (scales, …, h, w).
    """
    fields = np.empty((len(scales_px), *compressed.shape), np.complex64)
    largest = np.abs(compressed).max(axis=(-2, -1), keepdims=True, initial=0)
    rounding = np.float32(ROUNDING) * largest
    whole = valid.all()
    # All in place: memory access takes most of the time.
    gx, gy, product, size = np.empty((4, *compressed.shape), np.float32)
    for field, scale in zip(fields, scales_px, strict=True):
        _differentiate(compressed, scale, gx, gy)
        np.multiply(gx, gy, out=product)
        product *= 2
        gx *= gx
        gy *= gy
        # Not cv2.magnitude, whose last digits depend on where arrays lie in memory.
        np.sqrt(np.add(gx, gy, out=size), out=size)
        usable = size > rounding
        if not whole:
            usable &= _erode(valid, scale)
        gx -= gy
        divisor = np.add(size, _typical(size, usable), out=gy)
        divisor *= size
        np.copyto(divisor, np.inf, where=~usable)
        np.divide(gx, divisor, out=field.real)
        np.divide(product, divisor, out=field.imag)
    return fields


def edge_strength(finest: NDArray[np.complex64], valid: NDArray[np.bool_]) -> Patch:
    """Return the strength of edges, whatever their direction: 0 (none) to 1.

    Parameters
    ----------
    finest
        The squared gradients at the first of `SCALES_PX`, shape (…, h, w).
    valid
        Validity of the image's pixels, shape (…, h, w). Strength is valid in a few pixels less.
    """
    # Not np.abs, whose last digits may depend on where arrays lie in memory.
    strength = np.sqrt(finest.real**2 + finest.imag**2)
    return Patch(strength, valid if valid.all() else _erode(valid, SCALES_PX[0]))


def _differentiate(images: FloatImage, scale_px: float, gx: FloatImage, gy: FloatImage) -> None:
    """Write the derivatives of images, (…, h, w), along columns and along rows."""
    slope, smooth = _kernels(scale_px)
    stacks = (stack.reshape(-1, *images.shape[-2:]) for stack in (images, gx, gy))
    for image, x, y in zip(*stacks, strict=True):
        cv2.sepFilter2D(image, cv2.CV_32F, slope, smooth, dst=x, borderType=cv2.BORDER_REFLECT)
        cv2.sepFilter2D(image, cv2.CV_32F, smooth, slope, dst=y, borderType=cv2.BORDER_REFLECT)


@functools.cache
def _kernels(scale_px: float) -> tuple[FloatArray, FloatArray]:
    """Return a Gaussian's derivative, and itself."""
    reach = int(np.ceil(4 * scale_px))
    x = np.arange(-reach, reach + 1, dtype=np.float64)
    smooth = np.exp(-(x**2) / (2 * scale_px**2))
    smooth /= smooth.sum()
    return x / scale_px**2 * smooth, smooth


def _typical(sizes: FloatImage, usable: NDArray[np.bool_]) -> FloatImage:
    """Return the median of each image's usable sizes, 1 if it has none, (…, 1, 1)."""
    if usable.all():
        return upper_median(flat(sizes))[..., None, None]

    def median_of(size: FloatImage, counts: NDArray[np.bool_]) -> FloatImage:
        return upper_median(size[counts] if counts.any() else np.ones(1, np.float32))

    return each(median_of, sizes, usable)[..., None, None]


def _erode(valid: NDArray[np.bool_], scale_px: float) -> NDArray[np.bool_]:
    size = 2 * int(np.ceil(_REACH * scale_px)) + 1
    around = np.ones((size, size), np.uint8)
    return each(lambda mask: cv2.erode(mask, around), valid.view(np.uint8)) > 0
