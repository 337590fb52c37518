"""Two small images that are the same smooth function of the ground, and the truth between them."""

from __future__ import annotations

import numpy as np
from raster_files import waves

# Input (col, row) = MATRIX · reference (col, row, 1): turned, scaled and moved.
MATRIX = np.array([[0.95, 0.12, 6.0], [-0.1, 1.04, 9.0]])
SIZES = {"reference": (90, 80), "input": (96, 84)}
CHECK_POINT_ERROR_PX = 0.5


def ground(px: np.ndarray) -> np.ndarray:
    """Grey value of reference positions, shape (n, 2)."""
    return waves(px, 30.0)


def to_input(px: np.ndarray) -> np.ndarray:
    """Input positions of reference positions by the truth."""
    return px @ MATRIX[:, :2].T + MATRIX[:, 2]


def to_reference(px: np.ndarray) -> np.ndarray:
    """Reference positions of input positions by the truth."""
    return (px - MATRIX[:, 2]) @ np.linalg.inv(MATRIX[:, :2]).T


def pixels(size: tuple[int, int]) -> np.ndarray:
    """All pixel positions (col, row) of an image, in the order of its values."""
    return np.stack(np.meshgrid(*map(np.arange, size)), axis=-1).reshape(-1, 2).astype(float)


def image(which: str) -> np.ndarray:
    """Grey values, shape (1, rows, columns), of the reference or the input."""
    size = SIZES[which]
    px = pixels(size) if which == "reference" else to_reference(pixels(size))
    return ground(px).reshape(1, size[1], size[0]).astype(np.float32)
