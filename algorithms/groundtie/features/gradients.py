"""Estimators of the gradient of a SAR image ([Suri2010] 6.4).

All return the derivatives along columns and rows. Differences are taken of grey values as they
are; ratios, for which multiplicative noise is alike in bright and dark areas, of positive ones.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from ..speckle.isef import isef_along
from .recursive_filters import average_after, average_before

FloatImage = NDArray[np.float32]
Gradient = tuple[FloatImage, FloatImage]

# Decay of the exponential averages, per pixel.
_DECAY = 0.5

# Deriche's α: the reciprocal of the filter's width, per pixel.
_ALPHA = 1.0

_TINY = np.float32(1e-6)


def simple_differences(image: FloatImage) -> Gradient:
    """Return differences between the next and the previous pixel ([Suri2010] eq 6.5, 6.6)."""
    padded = cv2.copyMakeBorder(image, 1, 1, 1, 1, cv2.BORDER_REFLECT_101)
    along_cols = padded[1:-1, 2:] - padded[1:-1, :-2]
    along_rows = padded[2:, 1:-1] - padded[:-2, 1:-1]
    return np.asarray(along_cols, np.float32), np.asarray(along_rows, np.float32)


def recursive_differences(image: FloatImage) -> Gradient:
    """Return recursive differences [Deriche1987], [Paillou1997], [Suri2010] eq 6.7–6.12.

    The derivative filter x·exp(−α|x|) along one axis, its smoothing (α|x| + 1)·exp(−α|x|) along
    the other, both of unit gain.
    """
    return (
        _deriche_derivative(_deriche_smoothing(image, 0), 1),
        _deriche_derivative(_deriche_smoothing(image, 1), 0),
    )


def log_ratios(image: FloatImage) -> Gradient:
    """Return the logarithm of the ratio of exponentially weighted averages, with its sign.

    ROEWA ([Fjortoft1995]; [Suri2010] eq 6.13–6.22), but the average after the pixel over the one
    before it, not the smaller of both ratios: its logarithm is positive where it gets brighter.

    Parameters
    ----------
    image
        Positive grey values.
    """
    return _log_ratio(image, 1), _log_ratio(image, 0)


def unsigned_log_ratios(image: FloatImage) -> Gradient:
    """Return ROEWA as in [Suri2010]: strength without a sign, so directions in 0 … 90° only."""
    along_cols, along_rows = log_ratios(image)
    return np.abs(along_cols), np.abs(along_rows)


def _log_ratio(image: FloatImage, axis: int) -> FloatImage:
    across = isef_along(image, _DECAY, 1 - axis)
    before = _shifted(average_before(across, _DECAY, axis), 1, axis)
    after = _shifted(average_after(across, _DECAY, axis), -1, axis)
    return np.asarray(np.log(np.maximum(after, _TINY) / np.maximum(before, _TINY)))


def _shifted(image: FloatImage, by: int, axis: int) -> FloatImage:
    """Return an image moved by a pixel, its border repeated: averages leave the pixel out."""
    moved = np.roll(image, by, axis)
    edge = [slice(None)] * 2
    edge[axis] = slice(0, 1) if by > 0 else slice(-1, None)
    moved[tuple(edge)] = image[tuple(edge)]
    return moved


def _deriche_smoothing(image: FloatImage, axis: int) -> FloatImage:
    decay = np.exp(-_ALPHA)
    gain = (1 - decay) ** 2 / (1 + 2 * _ALPHA * decay - decay**2)
    before = gain * np.array([1, decay * (_ALPHA - 1), 0])
    after = gain * np.array([0, decay * (_ALPHA + 1), -(decay**2)])
    return _two_passes(image, before, after, 1.0, axis)


def _deriche_derivative(image: FloatImage, axis: int) -> FloatImage:
    decay = np.exp(-_ALPHA)
    # A ramp of slope one gives one.
    gain = (1 - decay) ** 3 / (2 * decay * (1 + decay))
    weights = gain * np.array([0, decay, 0])
    return _two_passes(image, weights, weights, -1.0, axis)


def _two_passes(
    image: FloatImage,
    before: NDArray[np.float64],
    after: NDArray[np.float64],
    sign: float,
    axis: int,
) -> FloatImage:
    """Return `sign`·(what the pixels before give) + (what the pixels after give), second order."""
    # Late: few features need it, and this package takes long to import.
    from scipy.signal import lfilter

    decay = np.exp(-_ALPHA)
    recursion = np.array([1, -2 * decay, decay**2], np.float32)

    def one(source: FloatImage, weights: NDArray[np.float64]) -> FloatImage:
        # The first pixel goes on forever before the image.
        steady = weights.sum() / recursion.sum()
        start = np.array([steady - weights[0], weights[2] - recursion[2] * steady], np.float32)
        shape = (2, 1) if axis == 0 else (1, 2)
        edge = np.take(source, [0], axis=axis) * start.reshape(shape)
        return np.asarray(
            lfilter(weights.astype(np.float32), recursion, source, axis=axis, zi=edge)[0]
        )

    causal = one(image, before)
    anticausal = np.flip(one(np.flip(image, axis), after), axis)
    return np.asarray(np.float32(sign) * causal + anticausal)


# What each estimator is called, and whether it needs positive grey values.
_ESTIMATORS: dict[str, tuple[Callable[[FloatImage], Gradient], bool]] = {
    "differences": (simple_differences, False),
    "recursive": (recursive_differences, False),
    "roewa": (log_ratios, True),
    "roewa-unsigned": (unsigned_log_ratios, True),
}
GRADIENTS = tuple(_ESTIMATORS)


def gradient(image: FloatImage, estimator: str) -> Gradient:
    """Return the gradient of an image by one of `GRADIENTS`."""
    return _ESTIMATORS[estimator][0](image)


def needs_positive(estimator: str) -> bool:
    """Tell whether an estimator is one of ratios."""
    return _ESTIMATORS[estimator][1]
