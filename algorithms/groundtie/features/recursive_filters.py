"""Exponential averages of one side, recursive: however far they reach, they cost the same."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatImage = NDArray[np.float32]


def average_before(image: FloatImage, decay: float, axis: int) -> FloatImage:
    """Return the exponentially weighted average of each pixel and all before it.

    The causal filter h1 of [Suri2010] eq 6.14, 6.19 and 6.20, (1 − b) bˣ; the first pixel goes on
    forever before the image.

    Parameters
    ----------
    image
        Shape (h, w), float32.
    decay
        b, from 0 to 1: the weight of a pixel against its neighbour's.
    axis
        0: along rows, 1: along columns.
    """
    # Late: few features need it, and this package takes long to import.
    from scipy.signal import lfilter

    first = np.take(image, [0], axis=axis)
    numerator, denominator = (np.array(c, image.dtype) for c in ([1 - decay], [1, -decay]))
    start = first * image.dtype.type(decay)
    return np.asarray(lfilter(numerator, denominator, image, axis=axis, zi=start)[0])


def average_after(image: FloatImage, decay: float, axis: int) -> FloatImage:
    """Return the exponentially weighted average of each pixel and all after it (h2)."""
    turned = average_before(np.flip(image, axis), decay, axis)
    return np.flip(turned, axis)
