"""The infinite symmetric exponential filter, recursive: its cost does not depend on its width."""

from __future__ import annotations

import cv2
import numpy as np

from ..rasters.reading import FloatImage


def isef(image: FloatImage, decay: float) -> FloatImage:
    """Smooth an image by a b^|x| along both axes, with a = (1 - b) / (1 + b).

    [Shen1992]: the best linear filter for many edges near each other.

    Parameters
    ----------
    image
        Float32, shape (h, w). The outermost values continue beyond its borders.
    decay
        The b of the formula, 0 to below 1: ratio of a pixel's weight to that of its nearer
        neighbour.

    Returns
    -------
    Smoothed image, float32, shape (h, w).
    """
    return isef_along(isef_along(image, decay, 0), decay, 1)


def isef_along(image: FloatImage, decay: float, axis: int) -> FloatImage:
    """Smooth an image as `isef` does, along one axis: 0 from row to row, 1 along columns."""
    if axis == 0:
        return _along_rows(np.ascontiguousarray(image, np.float32), decay)
    transposed = np.asarray(cv2.transpose(np.asarray(image, np.float32)), np.float32)
    return np.asarray(cv2.transpose(_along_rows(transposed, decay)), np.float32)


def _along_rows(image: FloatImage, decay: float) -> FloatImage:
    """Smooth from row to row: a pass down plus a pass up, less the pixel that both count."""
    gain = 1 - decay
    down, up = image.copy(), image.copy()
    # OpenCV writes into the last argument, here a row; each row rests on the one before.
    for i in range(1, len(image)):
        cv2.addWeighted(image[i], gain, down[i - 1], decay, 0, down[i])
    for i in range(len(image) - 2, -1, -1):
        cv2.addWeighted(image[i], gain, up[i + 1], decay, 0, up[i])
    down += up
    down -= np.float32(gain) * image
    down /= np.float32(1 + decay)
    return down


def decay_for_window(window_px: float) -> float:
    """Return the decay that smooths noise as much as the mean of a square window.

    Parameters
    ----------
    window_px
        Side of the window, above 1.
    """
    from scipy.optimize import brentq  # takes 0.2 s to import; every tool imports the filters

    def excess(decay: float) -> float:
        # Sum of the squared weights of a line, less that of a mean.
        return (1 - decay) * (1 + decay**2) / (1 + decay) ** 3 - 1 / window_px

    return float(brentq(excess, 0.0, 1.0))
