"""Interpolation by a kernel, exact at any position.

OpenCV's `remap` is not used: its cubic kernel (a = -0.75) does not reproduce a ramp, which moves
the image by up to 0.05 px, and until OpenCV 5 it rounds positions to 1/32 px.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

Weights = Callable[[NDArray[Any]], list[NDArray[Any]]]

# Pixels that are worked at a time: what they need stays in the processor's cache.
_BLOCK_PIXELS = 1 << 14


def _bilinear(s: NDArray[Any]) -> list[NDArray[Any]]:
    return [1 - s, s]


def _cubic(s: NDArray[Any]) -> list[NDArray[Any]]:
    """Keys 1981, doi:10.1109/TASSP.1981.1163711, with a = -1/2: exact for parabolas."""
    square = s * s
    cube = square * s
    return [
        -0.5 * cube + square - 0.5 * s,
        1.5 * cube - 2.5 * square + 1,
        -1.5 * cube + 2 * square + 0.5 * s,
        0.5 * cube - 0.5 * square,
    ]


def _lanczos(s: NDArray[Any]) -> list[NDArray[Any]]:
    """Sinc windowed by a sinc four times as wide, the sum made 1."""
    sine, slow_sine, slow_cosine = np.sin(np.pi * s), np.sin(np.pi / 4 * s), np.cos(np.pi / 4 * s)
    weights = []
    for k in range(-3, 5):
        t = s - k
        # sin(pi t) and sin(pi t / 4) from those of s
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


# For the pixels at -n/2 + 1 … n/2 from the one on the left, at the fraction s of the way from it.
_KERNELS: dict[str, Weights] = {"bilinear": _bilinear, "cubic": _cubic, "lanczos": _lanczos}

# How many pixels on each side of a position a kernel takes.
REACH = {"nearest": 1, "bilinear": 1, "cubic": 2, "lanczos": 4}


def interpolate(image: NDArray[Any], px: NDArray[np.float64], method: str) -> NDArray[Any]:
    """Interpolate an image; beyond its borders it is 0.

    Parameters
    ----------
    image
        Shape (h, w), floating-point or complex.
    px
        Columns and rows of the positions, shape (2, m, n).
    method
        "bilinear", "cubic" or "lanczos".

    Returns
    -------
    Shape (m, n), dtype of the image.
    """
    kernel, reach = _KERNELS[method], REACH[method]
    # Positions up to a pixel outside, with all that their kernels take.
    padded = np.pad(image, ((reach, reach + 1), (reach, reach + 1)))
    width, flat = padded.shape[1], padded.ravel()
    out = np.empty(px.shape[1:], image.dtype)
    lines = max(_BLOCK_PIXELS // max(out.shape[1], 1), 1)
    for first in range(0, len(out), lines):
        rows = slice(first, first + lines)
        x = np.clip(px[0, rows], -1, image.shape[1])
        y = np.clip(px[1, rows], -1, image.shape[0])
        left, top = np.floor(x), np.floor(y)
        across = kernel((x - left).astype(image.real.dtype))
        down = kernel((y - top).astype(image.real.dtype))
        corner = (top.astype(np.intp) + 1) * width + left.astype(np.intp) + 1
        total = np.zeros(x.shape, image.dtype)
        for j in range(2 * reach):
            line = np.zeros(x.shape, image.dtype)
            for i in range(2 * reach):
                line += across[i] * flat.take(corner + (j * width + i))
            total += down[j] * line
        out[rows] = total
    return out
