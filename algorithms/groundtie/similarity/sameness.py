"""What two arrays have the same: gradients, lines, and windows that vary alike.

Independent views of one ground are similar, but hardly ever the same: noise, light, physics and
the phase of the pixels differ. What is drawn into both arrays is the same.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np

from ..rasters.patch import Patch
from ..rasters.reading import FloatImage, Mask

# Two gradients are the same if they differ by no more than this share of the larger one.
_SAME_SHARE = 0.25

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


@dataclass(frozen=True)
class Gradients:
    """Differences along columns and rows, and where they are known, each shape (h, w)."""

    x: FloatImage
    y: FloatImage
    valid: Mask

    @classmethod
    def of(cls, patch: Patch) -> Gradients:
        """Return the central differences of a patch."""
        x, y = (
            np.asarray(cv2.Sobel(patch.values, cv2.CV_32F, *order, ksize=1), np.float32)
            for order in ((1, 0), (0, 1))
        )
        valid = cv2.erode(patch.valid.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        return cls(x, y, np.asarray(valid))

    def part(self, col: int, row: int, shape: tuple[int, ...]) -> Gradients:
        """Return a part of a shape from a column and row on."""
        window = np.s_[row : row + shape[0], col : col + shape[1]]
        return Gradients(self.x[window], self.y[window], self.valid[window])

    @property
    def length(self) -> FloatImage:
        """Their lengths."""
        return np.asarray(np.hypot(self.x, self.y), np.float32)


def count_same(one: Gradients, other: Gradients, strong: tuple[float, float]) -> tuple[int, int]:
    """Return how many gradients are the same, and how many there are, of those that are strong.

    Parameters
    ----------
    one, other
        Of the same shape.
    strong
        The length from which a gradient is strong in the one and in the other.
    """
    lengths = one.length, other.length
    is_strong = one.valid & other.valid & ((lengths[0] > strong[0]) | (lengths[1] > strong[1]))
    apart = np.hypot(one.x - other.x, one.y - other.y)
    is_same = apart <= _SAME_SHARE * np.maximum(*lengths)
    return int((is_strong & is_same).sum()), int(is_strong.sum())


def same_windows(one: Patch, other: Patch) -> Mask:
    """Return around which pixels two patches vary alike, shape (h, w)."""
    valid = one.valid & other.valid
    differing = _variance(one.values - other.values, valid)
    both = _variance(one.values, valid) + _variance(other.values, valid)
    return valid & (differing <= _DIFFERING_SHARE * both)


def lines(patch: Patch) -> Mask:
    """Return where a patch has a thin line or dot, shape (h, w).

    Dark or bright, as the same may be drawn in other colours, and as faint as they are among what
    is around them.
    """
    if not patch.valid.any():
        return patch.valid
    thin = _thinness(patch)
    return np.asarray(patch.valid & (thin >= np.percentile(thin[patch.valid], _THIN_PERCENT)))


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
