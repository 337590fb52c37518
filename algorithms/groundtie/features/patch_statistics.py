"""Statistics of the patch around a keypoint ([Patel2017] 5.3)."""

from __future__ import annotations

from collections.abc import Callable
from types import MappingProxyType

import cv2
import numpy as np

from ..rasters.grid import FloatArray
from ..rasters.patch import Patch, window_sums
from ..rasters.reading import FloatImage
from .hog import PATCH_PX

Means = Callable[[FloatArray], FloatArray]

# Side of the window whose mean separates texture from coarser structure; gradients reach less far.
_FINE_PX = 5

# Pixels of the image that statistics need around a position.
REACH_PX = PATCH_PX // 2 + _FINE_PX // 2


def _mean_and_variance(values: FloatArray, bands: FloatImage, means: Means) -> list[FloatArray]:
    mean = means(values)
    return [mean, np.maximum(means(values**2) - mean**2, 0)]


def _band_ratios(values: FloatArray, bands: FloatImage, means: Means) -> list[FloatArray]:
    of_bands = [means(band.astype(np.float64)) for band in bands]
    total = np.sum(of_bands, axis=0)
    # In black patches, all bands have equal shares.
    black = np.abs(total) < 1e-9
    total[black] = 1.0
    shares = [np.where(black, 1 / len(bands), mean / total) for mean in of_bands]
    return [*_mean_and_variance(values, bands, means), *shares]


def _texture(values: FloatArray, bands: FloatImage, means: Means) -> list[FloatArray]:
    mean, variance = _mean_and_variance(values, bands, means)
    third = means(values**3) - 3 * mean * variance - mean**3
    skewness = third / np.maximum(variance, 1e-12) ** 1.5
    across, down = (cv2.Sobel(values, cv2.CV_64F, *axis, scale=1 / 8) for axis in ((1, 0), (0, 1)))
    fine = values - cv2.blur(values, (_FINE_PX, _FINE_PX))
    return [mean, variance, skewness, means(np.hypot(across, down)), means(fine**2)]


BAND_RATIOS = "band-ratios"
STATISTICS = MappingProxyType[str, Callable[[FloatArray, FloatImage, Means], list[FloatArray]]](
    {"mean-variance": _mean_and_variance, BAND_RATIOS: _band_ratios, "texture": _texture}
)

NO_BANDS: FloatImage = np.zeros((0, 1, 1), np.float32)


def patch_statistics(
    name: str, window: Patch, px: FloatArray, bands: FloatImage = NO_BANDS
) -> FloatArray:
    """Return statistics of the patches of 41 × 41 pixels around positions.

    Parameters
    ----------
    name
        One of `STATISTICS`: "mean-variance"; "band-ratios", which adds the share of each band in
        the sum of all bands, as clouds have no colour; or "texture", which adds the skewness of the
        grey values, the mean strength of gradients and the variance of detail finer than 5 pixels.
    window
        The image; masked pixels do not count.
    px
        Positions (col, row) in the window, shape (n, 2).
    bands
        All bands of the window, shape (bands, h, w); only "band-ratios" uses them.

    Returns
    -------
    Shape (n, k), in grey values and their powers.
    """
    last = np.array(window.valid.shape)[::-1] - 1
    cols, rows = np.clip(np.rint(px).astype(int), 0, last).T
    if len(px) == 0 or not window.valid.any():
        nothing = STATISTICS[name](np.zeros((1, 1)), bands[:, :1, :1], lambda v: v)
        return np.zeros((len(px), len(nothing)))
    # Grey values are centred, so that their powers lose no digits.
    centre = float(window.values[window.valid].mean())
    values = np.where(window.valid, window.values - centre, 0.0)
    # What texture sees beside valid pixels must not depend on what else the window holds.
    ones = window.valid.astype(np.float64)
    around = window_sums(values, _FINE_PX) / np.maximum(window_sums(ones, _FINE_PX), 1)
    values = np.where(window.valid, values, around)
    counts = window_sums(ones, PATCH_PX)

    def means(of: FloatArray) -> FloatArray:
        sums = window_sums(np.where(window.valid, of, 0.0).astype(np.float64), PATCH_PX)
        return np.asarray(sums[rows, cols] / np.maximum(counts[rows, cols], 1))

    found = np.column_stack(STATISTICS[name](values, bands, means))
    found[:, 0] += centre
    return found
