"""What the patch around a feature is like, in a few numbers (thesis P 5.3)."""

from __future__ import annotations

from collections.abc import Callable
from types import MappingProxyType

import cv2
import numpy as np
from numpy.typing import NDArray

from ..rasters.patch import Patch

FloatArray = NDArray[np.float64]
Means = Callable[[FloatArray], FloatArray]

PATCH_PX = 41

# What is finer than a mean over so many pixels a side is texture.
_FINE_PX = 5


def _mean_and_variance(values: FloatArray, means: Means) -> list[FloatArray]:
    mean = means(values)
    return [mean, np.maximum(means(values**2) - mean**2, 0)]


def _texture(values: FloatArray, means: Means) -> list[FloatArray]:
    mean, variance = _mean_and_variance(values, means)
    third = means(values**3) - 3 * mean * variance - mean**3
    skewness = third / np.maximum(variance, 1e-12) ** 1.5
    across, down = (cv2.Sobel(values, cv2.CV_64F, *axis, scale=1 / 8) for axis in ((1, 0), (0, 1)))
    fine = values - cv2.blur(values, (_FINE_PX, _FINE_PX))
    return [mean, variance, skewness, means(np.hypot(across, down)), means(fine**2)]


STATISTICS = MappingProxyType[str, Callable[[FloatArray, Means], list[FloatArray]]](
    {"mean-variance": _mean_and_variance, "texture": _texture}
)


def patch_statistics(name: str, window: Patch, px: FloatArray) -> FloatArray:
    """Return statistics of the patches of 41 × 41 pixels around positions.

    Parameters
    ----------
    name
        One of `STATISTICS`: "mean-variance", or "texture", which adds the skewness of the grey
        values, the mean strength of gradients and the variance of what is finer than 5 pixels.
    window
        The image; masked pixels do not count.
    px
        Positions (col, row) in the window, shape (n, 2).

    Returns
    -------
    Shape (n, k), in grey values and their powers.
    """
    last = np.array(window.valid.shape)[::-1] - 1
    cols, rows = np.clip(np.rint(px).astype(int), 0, last).T
    if len(px) == 0 or not window.valid.any():
        return np.zeros((len(px), len(STATISTICS[name](np.zeros((1, 1)), lambda v: v))))
    # Around the mean, powers of grey values lose no digits.
    centre = float(window.values[window.valid].mean())
    values = np.where(window.valid, window.values - centre, 0.0)
    counts = _sums(window.valid.astype(np.float64))

    def means(of: FloatArray) -> FloatArray:
        sums = _sums(np.where(window.valid, of, 0.0))
        return np.asarray(sums[rows, cols] / np.maximum(counts[rows, cols], 1))

    found = np.column_stack(STATISTICS[name](values, means))
    found[:, 0] += centre
    return found


def _sums(values: FloatArray) -> FloatArray:
    sums = cv2.boxFilter(
        values, cv2.CV_64F, (PATCH_PX, PATCH_PX), normalize=False, borderType=cv2.BORDER_CONSTANT
    )
    return np.asarray(sums)
