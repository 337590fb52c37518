"""Estimators of the gradient of a SAR image ([Suri2010] 6.4).

All return the derivatives along columns and rows. Differences take any grey values. Ratios need
positive ones; multiplicative noise has the same effect on them in bright and dark areas.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..features.scale_space import Gradient, GradientOperator, differences
from ..rasters.reading import FloatImage
from ..speckle.isef import isef_along

# Decay of the exponential averages per pixel, [Suri2010] eq 6.2.
DECAY = 0.5

# Deriche's α: the reciprocal of the filter's width, per pixel.
_ALPHA = 1.0

_TINY = np.float32(1e-6)


def recursive_differences(image: FloatImage) -> Gradient:
    """Return Deriche's recursive differences (S eq 6.7–6.12; Deriche 1987, Paillou 1997).

    The derivative filter x·exp(−α|x|) runs along one axis and the smoothing filter
    (α|x| + 1)·exp(−α|x|) along the other; both have unit gain.
    """
    return (
        _deriche_derivative(_deriche_smoothing(image, 0), 1),
        _deriche_derivative(_deriche_smoothing(image, 1), 0),
    )


def log_ratios(image: FloatImage) -> Gradient:
    """Return the signed logarithm of the ratio of exponentially weighted averages.

    This is ROEWA ([Fjortoft1995]; S eq 6.13–6.22) with one difference: the ratio is always the
    average after the pixel over that before it, not the smaller of both ratios. Its logarithm is
    positive where the image gets brighter along the axis.

    Parameters
    ----------
    image
        Positive grey values.
    """
    return _log_ratio(image, 1), _log_ratio(image, 0)


def unsigned_log_ratios(image: FloatImage) -> Gradient:
    """Return ROEWA as in [Suri2010]: unsigned strengths, so directions of 0 … 90° only."""
    along_cols, along_rows = log_ratios(image)
    return np.abs(along_cols), np.abs(along_rows)


def average_before(image: FloatImage, decay: float, axis: int) -> FloatImage:
    """Return the exponentially weighted average of each pixel and all pixels before it.

    This is the causal filter h1 of [Suri2010] eq 6.14, 6.19 and 6.20, (1 − b) bˣ. The first pixel
    is repeated infinitely before the image.

    Parameters
    ----------
    image
        Shape (h, w), float32.
    decay
        b, from 0 to 1: ratio of a pixel's weight to that of the pixel one step nearer.
    axis
        0: along rows, 1: along columns.
    """
    return _recursive(image, np.array([1 - decay]), np.array([1, -decay]), axis)


def average_after(image: FloatImage, decay: float, axis: int) -> FloatImage:
    """Return the exponentially weighted average of each pixel and all pixels after it (h2)."""
    return np.flip(average_before(np.flip(image, axis), decay, axis), axis)


def _log_ratio(image: FloatImage, axis: int) -> FloatImage:
    across = isef_along(image, DECAY, 1 - axis)
    before = _shifted(average_before(across, DECAY, axis), 1, axis)
    after = _shifted(average_after(across, DECAY, axis), -1, axis)
    return np.asarray(np.log(np.maximum(after, _TINY) / np.maximum(before, _TINY)))


def _shifted(image: FloatImage, by: int, axis: int) -> FloatImage:
    """Return an image moved by one pixel, border repeated, so averages exclude the pixel itself."""
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
    # Unit gain: a ramp of slope one gives one.
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
    """Return `sign` · causal part + anticausal part of a second-order recursive filter."""
    decay = np.exp(-_ALPHA)
    recursion = np.array([1, -2 * decay, decay**2])
    causal = _recursive(image, before, recursion, axis)
    anticausal = np.flip(_recursive(np.flip(image, axis), after, recursion, axis), axis)
    return np.asarray(np.float32(sign) * causal + anticausal)


def _recursive(
    image: FloatImage, weights: NDArray[np.float64], recursion: NDArray[np.float64], axis: int
) -> FloatImage:
    """Return the output of a causal recursive filter along an axis.

    The first pixel is repeated infinitely before the image.
    """
    # Imported here because scipy.signal is slow to import and few features need it.
    from scipy.signal import lfilter, lfilter_zi

    shape = (-1, 1) if axis == 0 else (1, -1)
    steady = lfilter_zi(weights, recursion).astype(np.float32).reshape(shape)
    start = np.take(image, [0], axis=axis) * steady
    weights, recursion = weights.astype(np.float32), recursion.astype(np.float32)
    return np.asarray(lfilter(weights, recursion, image, axis=axis, zi=start)[0])


# The estimators by name, each with whether it needs positive grey values.
_ESTIMATORS: dict[str, tuple[GradientOperator, bool]] = {
    "differences": (differences, False),
    "recursive": (recursive_differences, False),
    "roewa": (log_ratios, True),
    "roewa-unsigned": (unsigned_log_ratios, True),
}
GRADIENTS = tuple(_ESTIMATORS)


def gradient_operator(name: str) -> GradientOperator:
    """Return the operator for a name in `GRADIENTS`."""
    return _ESTIMATORS[name][0]


def needs_positive(name: str) -> bool:
    """Return whether an operator takes ratios, and so needs positive grey values."""
    return _ESTIMATORS[name][1]
