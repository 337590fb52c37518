"""What two arrays have the same: windows that vary alike, and lines.

Independent views of one ground are similar, but hardly ever the same: noise, light, physics and
the phase of the pixels differ. What is drawn into both arrays is the same.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from ..rasters.patch import Patch
from ..rasters.reading import FloatImage, Mask

# Where one thing is drawn into both, their difference varies less than this share of what both
# vary, in windows of this side; independent content would have it vary as much as both.
_DIFFERING_SHARE = 0.5
WINDOW_PX = 9
REACH_PX = WINDOW_PX // 2

# Lines and dots are narrower than half of the first, and stand out from so many per cent of the
# pixels, each against those around it.
_LINE_PX, _AROUND_PX = 5, 31
_THIN_PERCENT = 90.0

# Means of a reduced image need this share of their pixels.
_LEAST_VALID = 0.25


def same_windows(one: Patch, other: Patch) -> Mask:
    """Return around which pixels two patches vary alike, shape (h, w)."""
    valid = one.valid & other.valid
    differing = _variance(one.values - other.values, valid)
    both = _variance(one.values, valid) + _variance(other.values, valid)
    return valid & (differing <= _DIFFERING_SHARE * both)


def same_lines(one: Patch, other: Patch) -> Mask:
    """Return where two patches have a thin line or dot at the same place, shape (h, w).

    Dark or bright, as the same may be drawn in other colours, and as faint as they are among what
    is around them.
    """
    both = one.valid & other.valid
    if not both.any():
        return both
    thin = [_thinness(patch) for patch in (one, other)]
    strong = [of >= np.percentile(of[both], _THIN_PERCENT) for of in thin]
    return np.asarray(both & strong[0] & strong[1])


def _thinness(patch: Patch) -> FloatImage:
    """Return how far pixels are from the median around them, against others there."""
    values = np.where(patch.valid, patch.values, 0).astype(np.float32)
    apart = np.abs(values - cv2.medianBlur(values, _LINE_PX))
    usual = cv2.blur(apart, (_AROUND_PX, _AROUND_PX))
    return np.asarray(apart / np.maximum(usual, np.finfo(np.float32).tiny), np.float32)


def covered(middles: Mask, side_px: int) -> Mask:
    """Return all pixels of windows of a side around some."""
    window = np.ones((side_px, side_px), np.uint8)
    return np.asarray(cv2.dilate(middles.astype(np.uint8), window) > 0)


def without(patch: Patch, hidden: Mask) -> Patch:
    """Return a patch of which some pixels are invalid besides."""
    return replace(patch, valid=patch.valid & ~hidden)


def reduced(patch: Patch, factor: int) -> Patch:
    """Return the means of squares of valid pixels; what remains at the right and below is cut."""
    height, width = (size // factor for size in patch.values.shape)

    def mean(of: FloatImage) -> FloatImage:
        cut = of[: height * factor, : width * factor]
        return cut.reshape(height, factor, width, factor).mean((1, 3), dtype=np.float32)

    share = mean(patch.valid.astype(np.float32))
    sums = mean(np.where(patch.valid, patch.values, 0).astype(np.float32))
    means = np.asarray(sums / np.maximum(share, np.finfo(np.float32).eps), np.float32)
    return Patch(means, share >= _LEAST_VALID)


def _variance(values: FloatImage, valid: Mask) -> FloatImage:
    """Return the variance of valid values in windows around pixels, shape (h, w)."""

    def mean(of: FloatImage) -> FloatImage:
        return np.asarray(cv2.blur(of, (WINDOW_PX, WINDOW_PX)), np.float32)

    # About a middle: of squares of large values, small differences would lose digits.
    middle = np.median(values[valid]) if valid.any() else 0.0
    known = np.where(valid, values - middle, 0).astype(np.float32)
    share = np.maximum(mean(valid.astype(np.float32)), np.finfo(np.float32).eps)
    return np.asarray(mean(known**2) / share - (mean(known) / share) ** 2, np.float32)
