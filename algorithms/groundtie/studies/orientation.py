"""Keypoint orientations from gradients, for images that may be rotated ([Lowe2004])."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..features.keypoints import Keypoints
from ..features.sampling import sampled_gradient, square_samples
from ..features.scale_space import Gradient

# Orientation: bins of its histogram, width of its window in scales, reach of the window in widths,
# and least height of a further peak as a share of the highest.
_BINS = 36
_ORIENTATION_SCALES = 1.5
_REACH_WIDTHS = 3.0
_FURTHER_PEAK = 0.8
_ORIENTATION_SAMPLES = 19


def oriented(fields: Gradient, points: Keypoints) -> tuple[Keypoints, NDArray[np.int_]]:
    """Return keypoints, one for each orientation, and the index of each in `points`."""
    half = _REACH_WIDTHS * _ORIENTATION_SCALES
    samples = square_samples(half, _ORIENTATION_SAMPLES)
    samples = samples[np.hypot(*samples.T) <= half]
    upright = replace(points, orientation_rad=np.zeros(len(points)))
    strength, direction = sampled_gradient(fields, upright, samples)
    window = np.exp(-(samples**2).sum(axis=1) / (2 * _ORIENTATION_SCALES**2))
    bins = np.rint(direction * (_BINS / (2 * np.pi))).astype(int) % _BINS
    owner = np.arange(len(points))[:, None]
    histogram = np.bincount(
        (owner * _BINS + bins).ravel(), (strength * window).ravel(), len(points) * _BINS
    ).reshape(-1, _BINS)
    smooth = sum(
        weight * np.roll(histogram, by, axis=1)
        for by, weight in zip(range(-2, 3), np.array([1, 4, 6, 4, 1]) / 16, strict=True)
    )
    before, after = np.roll(smooth, 1, axis=1), np.roll(smooth, -1, axis=1)
    highest = smooth.max(axis=1, keepdims=True)
    peaks = (smooth > before) & (smooth >= after) & (smooth >= _FURTHER_PEAK * highest)
    index, at = np.nonzero(peaks)
    low, top, high = before[index, at], smooth[index, at], after[index, at]
    place = at + 0.5 * (low - high) / (low - 2 * top + high)
    return replace(points.take(index), orientation_rad=place * (2 * np.pi / _BINS)), index
