"""Filling the voids of a raster of heights from their rims."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

_RELAXATIONS = 300


def fill_voids(values: NDArray[np.float32], valid: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Return values, shape (h, w), in which a membrane through their rims spans the voids.

    From coarse to fine: voids take what a raster of half the size has there, and are relaxed, so
    that each pixel becomes the mean of its neighbours. A slope goes on through a void.

    Raises
    ------
    ValueError
        Nothing is valid.
    """
    if valid.all():
        return values
    if not valid.any():
        raise ValueError("nothing is valid")
    height, width = valid.shape
    size = ((width + 1) // 2, (height + 1) // 2)
    share = cv2.resize(valid.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    known = np.where(valid, values, np.float32(0))
    sums = cv2.resize(known, size, interpolation=cv2.INTER_AREA)
    coarse = fill_voids((sums / np.maximum(share, 1e-6)).astype(np.float32), share > 1e-6)
    filled = np.where(valid, values, cv2.resize(coarse, (width, height)))
    cross = np.array([[0, 1, 0], [1, 0, 1], [0, 1, 0]], np.float32) / 4
    for _ in range(_RELAXATIONS):
        relaxed = cv2.filter2D(filled, -1, cross, borderType=cv2.BORDER_REPLICATE)
        filled = np.where(valid, values, relaxed)
    return filled
