"""Gradients sampled at positions that rotate and scale with keypoints."""

from __future__ import annotations

import cv2
import numpy as np

from ..rasters.grid import FloatArray, mesh
from ..rasters.reading import FloatImage
from .keypoints import Keypoints
from .scale_space import Gradient


def square_samples(half: float, count: int) -> FloatArray:
    """Return the centres (x, y) of count² squares that divide the square of ± half."""
    side = (np.arange(count) + 0.5) * (2 * half / count) - half
    return mesh(side, side)


def samples_around(points: Keypoints, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return columns and rows, shape (n, m) each, of samples around each of n keypoints.

    Sample positions, shape (m, 2), are in units of a keypoint's scale, along and across its
    orientation.
    """
    cosine, sine = np.cos(points.orientation_rad)[:, None], np.sin(points.orientation_rad)[:, None]
    scale = points.scale_px[:, None]
    x = points.position_px[:, :1] + scale * (cosine * samples[:, 0] - sine * samples[:, 1])
    y = points.position_px[:, 1:] + scale * (sine * samples[:, 0] + cosine * samples[:, 1])
    return x, y


def sampled_gradient(
    fields: Gradient, points: Keypoints, samples: FloatArray
) -> tuple[FloatImage, FloatImage]:
    """Return strength and direction of the gradient at samples around each keypoint.

    Parameters
    ----------
    fields
        The gradient, two arrays of shape (h, w).
    points
        n keypoints, in pixels of the fields.
    samples
        Positions in units of a keypoint's scale, along and across its orientation, shape (m, 2).

    Returns
    -------
    Strength, and direction relative to the keypoint's orientation, shape (n, m) each.
    """
    x, y = samples_around(points, samples)
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
