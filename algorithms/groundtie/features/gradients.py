"""The gradient of an image by differences of its grey values."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

from ..rasters.reading import FloatImage

# Derivatives along columns and rows, shape (h, w) each, and what estimates them.
Gradient = tuple[FloatImage, FloatImage]
GradientOperator = Callable[[FloatImage], Gradient]


def differences(image: FloatImage) -> Gradient:
    """Return differences between the next and the previous pixel ([Suri2010] eq 6.5, 6.6)."""
    padded = cv2.copyMakeBorder(image, 1, 1, 1, 1, cv2.BORDER_REFLECT_101)
    along_cols = padded[1:-1, 2:] - padded[1:-1, :-2]
    along_rows = padded[2:, 1:-1] - padded[:-2, 1:-1]
    return np.asarray(along_cols, np.float32), np.asarray(along_rows, np.float32)
