"""Residual of one image after a local linear regression on another one."""

from __future__ import annotations

import cv2
import numpy as np

from ..rasters.patch import Patch
from ..rasters.reading import FloatImage, Mask
from .stacks import each

# The regression is a line through both images' grey values in windows of this side: wide enough
# that displaced ground is hardly explained by chance (1 / 15² of its variance each for slope and
# mean), and narrow enough to follow changes of light.
WINDOW_PX = 15

# Windows of windows reach this far. Strips of so many rows, unlike whole images, fit into the
# processor's cache.
_REACH_PX, _STRIP_ROWS = 2 * (WINDOW_PX // 2), 128

# A variance below this share of the mean square is rounding, and explains nothing.
_LEAST_SHARE = 1e-6

# A residual below this share of the variance is rounding or noise, and shows no ground.
_LEAST_LEFT = 0.01


def unexplained(reference: Patch, input: Patch) -> Patch:
    """Return windows of an input without the content that the reference's windows explain.

    Parameters
    ----------
    reference, input
        Windows, shape (h, w), or stacks of them, (n, h, w).
    """
    height = reference.values.shape[-2]
    strips = [
        _unexplained(reference, input, range(top, min(top + _STRIP_ROWS, height)))
        for top in range(0, height, _STRIP_ROWS)
    ]
    values, valid = ([getattr(one, of) for one in strips] for of in ("values", "valid"))
    return Patch(np.concatenate(values, axis=-2), np.concatenate(valid, axis=-2))


def _unexplained(whole_reference: Patch, whole_input: Patch, rows: range) -> Patch:
    """Return some rows of `unexplained`."""
    first = max(rows.start - _REACH_PX, 0)
    around = np.s_[..., first : rows.stop + _REACH_PX, :]
    reference, input = (
        Patch(of.values[around], of.valid[around]) for of in (whole_reference, whole_input)
    )
    valid = reference.valid & input.valid
    known = 1 if valid.all() else np.maximum(blurred(valid), np.finfo(np.float32).eps)
    one, other = (centred(patch.values, valid) for patch in (input, reference))

    def mean(of: FloatImage) -> FloatImage:
        return np.asarray(blurred(of) / known, np.float32)

    means, square = (mean(one), mean(other)), mean(other * other)
    least = _LEAST_SHARE * square + np.finfo(np.float32).tiny
    variance = np.maximum(square - means[1] ** 2, least)
    common = mean(one * other) - means[0] * means[1]
    left = one - means[0] - common / variance * (other - means[1])
    left = np.where(valid, left, 0)
    own = np.maximum(mean(one * one) - means[0] ** 2, 0)
    shown = valid & (mean(left * left) > _LEAST_LEFT * own)
    inner = np.s_[..., rows.start - first : rows.stop - first, :]
    return Patch(np.where(shown[inner], left[inner], 0), shown[inner])


def blurred(stack: FloatImage | Mask, side_px: int = WINDOW_PX) -> FloatImage:
    """Return the means in square windows around pixels, shape (…, h, w)."""
    size = side_px, side_px
    return each(lambda image: cv2.blur(image, size), stack.astype(np.float32, copy=False))


def centred(values: FloatImage, valid: Mask) -> FloatImage:
    """Return values less a common middle, 0 if masked: squares of large ones lose small contrast.

    Parameters
    ----------
    values, valid
        Grey values and which of them count, shape (…, h, w).
    """
    some = (..., slice(None, None, WINDOW_PX), slice(None, None, WINDOW_PX))
    sample = values[some][valid[some]]
    middle = np.median(sample) if sample.size else 0.0
    return np.where(valid, values - np.float32(middle), 0)
