"""Gradients sampled on lattices that turn and grow with features."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from .gradients import FloatImage, Gradient
from .keypoints import Keypoints

FloatArray = NDArray[np.float64]

# Orientation: bins of its histogram, width of its window in scales, how far it reaches in widths,
# and how high a further peak must be.
_BINS = 36
_ORIENTATION_SCALES = 1.5
_REACH_WIDTHS = 3.0
_FURTHER_PEAK = 0.8
_ORIENTATION_SAMPLES = 19


def square_lattice(half: float, count: int) -> FloatArray:
    """Return a lattice of count² positions (x, y) in the middle of the squares of ± half."""
    side = (np.arange(count) + 0.5) * (2 * half / count) - half
    x, y = np.meshgrid(side, side)
    return np.column_stack([x.ravel(), y.ravel()])


def sampled_gradient(
    fields: Gradient, points: Keypoints, lattice: FloatArray
) -> tuple[FloatImage, FloatImage]:
    """Return strength and direction of the gradient on a lattice around each feature.

    Parameters
    ----------
    fields
        The gradient, two arrays of shape (h, w).
    points
        n features, in pixels of the fields.
    lattice
        In scales of a feature, along and across its orientation, shape (m, 2).

    Returns
    -------
    Strength and direction against the feature's orientation, shape (n, m) each.
    """
    cosine, sine = np.cos(points.orientation_rad)[:, None], np.sin(points.orientation_rad)[:, None]
    scale = points.scale_px[:, None]
    x = points.position_px[:, :1] + scale * (cosine * lattice[:, 0] - sine * lattice[:, 1])
    y = points.position_px[:, 1:] + scale * (sine * lattice[:, 0] + cosine * lattice[:, 1])
    at = np.asarray(x, np.float32), np.asarray(y, np.float32)
    gx, gy = (
        cv2.remap(f, *at, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=0)
        for f in fields
    )
    direction = np.arctan2(gy, gx) - points.orientation_rad[:, None].astype(np.float32)
    return np.hypot(gx, gy), np.asarray(direction, np.float32)


def unit_rows(rows: FloatImage) -> FloatImage:
    """Return rows scaled to unit length; rows of zeros stay so."""
    length = np.linalg.norm(rows, axis=1, keepdims=True)
    return np.asarray(rows / np.maximum(length, 1e-12), np.float32)


def oriented(fields: Gradient, points: Keypoints) -> tuple[Keypoints, NDArray[np.int_]]:
    """Return features once for each of their orientations, and which of `points` each one is."""
    half = _REACH_WIDTHS * _ORIENTATION_SCALES
    lattice = square_lattice(half, _ORIENTATION_SAMPLES)
    lattice = lattice[np.hypot(*lattice.T) <= half]
    upright = points.with_orientation(np.zeros(len(points)))
    strength, direction = sampled_gradient(fields, upright, lattice)
    window = np.exp(-(lattice**2).sum(axis=1) / (2 * _ORIENTATION_SCALES**2))
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
    return points.take(index).with_orientation(place * (2 * np.pi / _BINS)), index
