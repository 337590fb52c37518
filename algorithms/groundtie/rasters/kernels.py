"""Interpolation by a kernel, exact at any position, and the weights of B-splines.

OpenCV's `remap` is used only where it is exact: bilinear interpolation in single precision, since
OpenCV 5. Older versions round positions to 1/32 px. Its cubic kernel (a = -0.75) does not reproduce
a ramp, which moves the image by up to 0.05 px.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from .windows import Window, cut

Weights = Callable[[NDArray[Any]], list[NDArray[Any]]]

_REMAP_IS_EXACT = int(cv2.__version__.split(".")[0]) >= 5
_REMAP_SIDE = 1 << 15

# Pixels processed at a time, few enough for their working set to stay in the processor's cache.
CACHED_PIXELS = 1 << 15


def _bilinear(s: NDArray[Any]) -> list[NDArray[Any]]:
    return [1 - s, s]


def _cubic(s: NDArray[Any]) -> list[NDArray[Any]]:
    """Cubic convolution [Keys1981] with a = -1/2: exact for parabolas."""
    square = s * s
    cube = square * s
    return [
        -0.5 * cube + square - 0.5 * s,
        1.5 * cube - 2.5 * square + 1,
        -1.5 * cube + 2 * square + 0.5 * s,
        0.5 * cube - 0.5 * square,
    ]


def _lanczos(s: NDArray[Any]) -> list[NDArray[Any]]:
    """Sinc windowed by a sinc four times as wide, normalised to a sum of 1."""
    sine, slow_sine, slow_cosine = np.sin(np.pi * s), np.sin(np.pi / 4 * s), np.cos(np.pi / 4 * s)
    weights = []
    for k in range(-3, 5):
        t = s - k
        # sin(pi t) and sin(pi t / 4), from the sines and cosines of s
        product = (
            (-1) ** k
            * sine
            * (
                slow_sine * float(np.cos(np.pi / 4 * k))
                - slow_cosine * float(np.sin(np.pi / 4 * k))
            )
        )
        far = np.abs(t) > 1e-6
        square = np.where(far, t * t, 1)
        weights.append(np.where(far, product * float(4 / np.pi**2) / square, 1).astype(s.dtype))
    total = sum(weights)
    return [weight / total for weight in weights]


# Weights of the pixels at -n/2 + 1 … n/2 from the pixel on the left, for a position a fraction s of
# a pixel to the right of it.
_KERNELS: dict[str, Weights] = {"bilinear": _bilinear, "cubic": _cubic, "lanczos": _lanczos}

# Number of pixels on each side of a position that a kernel uses.
REACH = {"nearest": 1, "bilinear": 1, "cubic": 2, "lanczos": 4}


def bspline_weights(order: int, fraction: NDArray[Any] | float) -> NDArray[np.float64]:
    """Return the weights of a B-spline for the pixels around positions (de Boor 1978).

    Parameters
    ----------
    order
        Degree + 1: 2 is linear, 4 cubic.
    fraction
        Excess of position - order / 2 over a whole number n, 0 to 1, any shape.

    Returns
    -------
    Weights of the pixels n + 1 … n + order, shape (order, …); they sum to 1.
    """
    fraction = np.asarray(fraction, np.float64)
    weights = np.zeros((order, *fraction.shape))
    weights[0] = 1
    for n in range(2, order + 1):
        for j in reversed(range(n)):
            before = (n - 1 - j + fraction) * weights[j - 1] if j else 0
            weights[j] = ((j + 1 - fraction) * weights[j] + before) / (n - 1)
    return weights


def interpolate(image: NDArray[Any], px: NDArray[Any], method: str) -> NDArray[Any]:
    """Interpolate an image; beyond its borders it is 0.

    Parameters
    ----------
    image
        Shape (h, w) or (bands, h, w), floating-point or complex.
    px
        Columns and rows of the positions, shape (2, m, n), processed in their own precision.
    method
        "bilinear", "cubic" or "lanczos".

    Returns
    -------
    Shape (m, n) or (bands, m, n), dtype of the image.
    """
    bands = image.reshape(-1, *image.shape[-2:])
    if method == "bilinear" and _is_for_remap(bands[0], px):
        found = np.empty((len(bands), *px.shape[1:]), bands.dtype)
        for band, values in zip(bands, found, strict=True):
            cv2.remap(band, px[0], px[1], cv2.INTER_LINEAR, dst=values)
    elif (first := _first_of_neighbours(px)) is not None and not np.iscomplexobj(image):
        found = _by_filter(bands, first, px.shape[1:], method)
    else:
        found = _by_kernel(bands, px, method)
    return np.asarray(found.reshape(*image.shape[:-2], *px.shape[1:]))


def _first_of_neighbours(px: NDArray[Any]) -> tuple[float, float] | None:
    """Return the first (col, row) of positions spaced as adjacent pixels; None for others."""
    if px.size == 0 or np.abs(px).max() > _REMAP_SIDE:
        return None
    (x, y), (rows, cols) = px, px.shape[1:]
    first = x[0, 0], y[0, 0]
    corners = x[-1, -1] - first[0], y[-1, -1] - first[1]
    # The last position decides in most cases.
    if corners != (cols - 1, rows - 1):
        return None
    along_x, along_y = (np.arange(n, dtype=px.dtype) for n in (cols, rows))
    same = np.array_equal(x, np.broadcast_to(first[0] + along_x, x.shape)) and np.array_equal(
        y, np.broadcast_to(first[1] + along_y[:, None], y.shape)
    )
    return (float(first[0]), float(first[1])) if same else None


def _by_filter(
    bands: NDArray[Any], first: tuple[float, float], size: tuple[int, ...], method: str
) -> NDArray[Any]:
    """Return `_by_kernel` for `size` positions spaced as adjacent pixels, from `first` on.

    All positions have the same weights, so that the kernel is a filter of the image.
    """
    kernel, reach = _KERNELS[method], REACH[method]
    col, row = (math.floor(position) - reach + 1 for position in first)
    across, down = (kernel(np.array([position % 1])) for position in first)
    high, wide = (n + 2 * reach - 1 for n in size)
    found = [
        cv2.sepFilter2D(band, -1, np.concatenate(across), np.concatenate(down), anchor=(0, 0))
        for band in cut(bands, Window(col, row, wide, high))
    ]
    filtered = np.stack(found)[:, : size[0], : size[1]]
    # As in `_by_kernel`, positions more than a pixel outside are 0, though the kernel reaches them.
    x, y = (start + np.arange(n) for start, n in zip(first, size[::-1], strict=True))
    filtered[:, (y < -1) | (y > bands.shape[1])] = 0
    filtered[:, :, (x < -1) | (x > bands.shape[2])] = 0
    return filtered


def _by_kernel(bands: NDArray[Any], px: NDArray[Any], method: str) -> NDArray[Any]:
    """Return the sums of weighted pixels, shape (bands, m, n); all bands have the same weights."""
    kernel, reach = _KERNELS[method], REACH[method]
    count, height, width = bands.shape
    # Padded for positions up to a pixel outside, with all pixels of their kernels.
    padded = np.zeros((count, height + 2 * reach + 1, width + 2 * reach + 1), bands.dtype)
    padded[:, reach : reach + height, reach : reach + width] = bands
    images, stride = padded.reshape(count, -1), padded.shape[2]
    x, y = (np.asarray(axis).ravel() for axis in px)
    out = np.empty((count, len(x)), bands.dtype)
    for start in range(0, len(x), CACHED_PIXELS):
        part = slice(start, start + CACHED_PIXELS)
        left, right_share = _split(x[part], width)
        top, lower_share = _split(y[part], height)
        across = kernel(right_share.astype(bands.real.dtype, copy=False))
        down = kernel(lower_share.astype(bands.real.dtype, copy=False))
        corner = (top + 1) * stride
        corner += left + 1
        for flat, total in zip(images, out[:, part], strict=True):
            _add_weighted(flat, stride, corner, across, down, total)
    return out


def _add_weighted(
    flat: NDArray[Any],
    stride: int,
    corner: NDArray[np.intp],
    across: list[NDArray[Any]],
    down: list[NDArray[Any]],
    total: NDArray[Any],
) -> None:
    """Write the weighted sums of the pixels from `corner` on, in rows of `stride`, to `total`."""
    line, value = np.empty((2, len(corner)), flat.dtype)
    for j, weight in enumerate(down):
        for i, share in enumerate(across):
            into = value if i else line
            # Clipping is never needed here, but faster than a check.
            flat[j * stride + i :].take(corner, out=into, mode="clip")
            into *= share
            if i:
                line += value
        line *= weight
        if j:
            total += line
        else:
            total[:] = line


def _is_for_remap(image: NDArray[Any], px: NDArray[Any]) -> bool:
    single = image.dtype == np.float32 and px.dtype == np.float32
    longest = max(*image.shape, *px.shape)
    return _REMAP_IS_EXACT and single and image.size > 0 and longest < _REMAP_SIDE


def _split(x: NDArray[Any], size: int) -> tuple[NDArray[np.intp], NDArray[Any]]:
    """Return the pixels left of positions along an axis, and the positions' distances from them."""
    if x.min() < -1 or x.max() > size:
        x = np.clip(x, -1, size)
    left = np.floor(x)
    return left.astype(np.intp), x - left
