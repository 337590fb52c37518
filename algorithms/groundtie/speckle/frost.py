"""The enhanced Frost filter, exact and fast.

A pixel's weight falls exponentially with its distance, with a damping that differs for each centre
pixel. With the city-block distance |x| + |y|, the weighted sum is a polynomial in exp(-damping),
whose coefficients are the sums over all pixels at each distance. They need no more additions than
a plain convolution with equal dampings.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial.polynomial import polyval
from numpy.typing import NDArray

from ..rasters.reading import FloatImage, Mask
from .statistics import LocalStatistics


def enhanced_frost(
    padded: FloatImage,
    valid: Mask,
    statistics: LocalStatistics,
    looks: float,
    damping: float = 1.0,
) -> FloatImage:
    """Filter speckle by the enhanced Frost filter [Lopes1990a].

    C is the coefficient of variation, Cu² = 1 / looks and Cmax² = 1 + 2 / looks. Where C is at most
    Cu, as of speckle alone, the result is the local mean. Where it is at least Cmax, more than
    speckle on any texture, the result is the pixel itself. Between the two, it is the mean with
    weights exp(-damping (C - Cu) / (Cmax - C) d) at the city-block distance d.

    Parameters
    ----------
    padded
        Power of the signal with half a window on each side, shape (h + w - 1, …); invalid pixels
        are 0.
    valid
        Which pixels count, same shape.
    statistics
        Statistics of that window around each pixel inside the margin, shape (h, …).
    looks
        Equivalent number of looks.
    damping
        Larger values keep more of edges and of speckle.

    Returns
    -------
    Filtered intensity of the pixels inside the margin, float32.
    """
    speckle, most = np.float32(np.sqrt(1 / looks)), np.float32(np.sqrt(1 + 2 / looks))
    variation = np.sqrt(statistics.variation2)
    # As the variation nears Cmax, the weight of a neighbour becomes 0.
    share = np.maximum(variation - speckle, 0) / np.maximum(most - variation, np.float32(1e-3))
    step = np.exp(np.float32(-damping) * share)
    step[variation >= most] = 0
    half = (padded.shape[0] - step.shape[0]) // 2
    total = _polynomial(padded, step, half)
    if valid.all():
        weight = polyval(step, _pixels_at(half))
    else:
        weight = np.maximum(_polynomial(valid.astype(np.float32), step, half), np.float32(1e-6))
    return np.asarray(total / weight)


def _polynomial(padded: FloatImage, step: FloatImage, half: int) -> FloatImage:
    """Return the sum over the window of pixels times step^distance, shape of `step`."""
    height, width = step.shape
    # Sums of the pixels k to the left and k to the right.
    pairs = [padded[:, half : half + width]]
    pairs += [
        padded[:, half - k : half - k + width] + padded[:, half + k : half + k + width]
        for k in range(1, half + 1)
    ]
    total = np.zeros_like(step)
    for distance in range(2 * half, -1, -1):
        total *= step
        for down in range(max(0, distance - half), min(distance, half) + 1):
            lines = pairs[distance - down]
            total += lines[half + down : half + down + height]
            if down:
                total += lines[half - down : half - down + height]
    return total


def _pixels_at(half: int) -> NDArray[np.float32]:
    """Return the number of pixels of a window at each city-block distance from its centre."""
    offset = np.abs(np.arange(-half, half + 1))
    return np.bincount(np.add.outer(offset, offset).ravel()).astype(np.float32)
