"""What one image shows beyond what another one explains of it."""

from __future__ import annotations

import cv2
import numpy as np

from ..rasters.patch import Patch
from ..rasters.reading import FloatImage, Mask
from .stacks import each

# One image explains the other by a line through their grey values in windows of this side: wide
# enough that ground which lies elsewhere is hardly explained by chance (1 / 15² of its variance
# each for slope and mean), and narrow enough for light that changes.
_WINDOW_PX = 15

# Windows that vary less than this share of their image explain nothing.
_LEAST_SHARE = 1e-6

# What is left of less than this share of the variance is rounding or noise, and shows no ground.
_LEAST_LEFT = 0.01


def unexplained(reference: Patch, input: Patch) -> Patch:
    """Return stacks of windows of an input without what those of the reference explain of it.

    Parameters
    ----------
    reference, input
        Stacks of windows, shape (n, h, w).
    """
    valid = reference.valid & input.valid
    known = np.maximum(_mean(valid.astype(np.float32)), np.finfo(np.float32).eps)
    one, other = (_centred(patch.values, valid) for patch in (input, reference))

    def mean(of: FloatImage) -> FloatImage:
        return np.asarray(_mean(of) / known, np.float32)

    means = mean(one), mean(other)
    variance = np.maximum(mean(other * other) - means[1] ** 2, 0)
    common = mean(one * other) - means[0] * means[1]
    least = _LEAST_SHARE * float(variance.max(initial=0.0)) + np.finfo(np.float32).tiny
    left = one - means[0] - common / np.maximum(variance, least) * (other - means[1])
    left = np.where(valid, left, 0).astype(np.float32)
    own = np.maximum(mean(one * one) - means[0] ** 2, 0)
    shown = valid & (mean(left * left) > _LEAST_LEFT * own)
    return Patch(np.where(shown, left, 0), shown)


def _mean(stack: FloatImage) -> FloatImage:
    return each(lambda image: cv2.blur(image, (_WINDOW_PX, _WINDOW_PX)), stack)


def _centred(values: FloatImage, valid: Mask) -> FloatImage:
    """Return values about a middle: of squares of large ones, small differences lose digits."""
    middle = np.median(values[valid]) if valid.any() else 0.0
    return np.where(valid, values - middle, 0).astype(np.float32)
