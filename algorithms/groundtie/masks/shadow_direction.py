"""The direction in which shadows fall: cast shadow in a camera image, radar shadow in a radar one.

It is inferred from the image itself: dark pixels lie more often on one side of bright ones than on
the other.
"""

from __future__ import annotations

import cv2
import numpy as np
import scipy.fft

from ..rasters.patch import Patch
from ..rasters.reading import FloatImage

# Least distance of dark pixels from bright ones, in pixels.
_NEAR_PX = 2


def shadow_azimuth_deg(patch: Patch, outer_percent: float, far_px: int) -> float:
    """Return the direction in which shadows fall, clockwise from the top of the image.

    Parameters
    ----------
    patch
        An image with tall objects: a camera image, or a despeckled radar image, in which shadows
        fall away from the sensor.
    outer_percent
        Percentage of the pixels at each end of the histogram that count as dark, or as bright.
    far_px
        Largest distance of dark pixels from bright ones.
    """
    level = cv2.GaussianBlur(patch.values, (0, 0), 1.0)
    low, high = np.percentile(level[patch.valid], [outer_percent, 100 - outer_percent])
    dark, bright = (level <= low) & patch.valid, (level >= high) & patch.valid
    # Number of dark pixels at each offset from bright ones.
    counts = products_at_shifts(bright.astype(np.float32), dark.astype(np.float32), far_px)
    y, x = np.mgrid[-far_px : far_px + 1, -far_px : far_px + 1]
    distance = np.hypot(x, y)
    near = (distance > _NEAR_PX) & (distance <= far_px)
    weight = counts[near] / distance[near]
    right, up = (weight * x[near]).sum(), -(weight * y[near]).sum()
    return float(np.degrees(np.arctan2(right, up)) % 360)


def products_at_shifts(image: FloatImage, other: FloatImage, reach_px: int) -> FloatImage:
    """Return the sums of products of two images' pixels at each offset of the other one.

    Shape (2 r + 1, 2 r + 1): offsets along rows and columns of up to `reach_px` pixels.
    """
    size = [scipy.fft.next_fast_len(n + reach_px, real=True) for n in image.shape]
    here, there = (scipy.fft.rfft2(one, size, workers=2) for one in (image, other))
    sums = scipy.fft.irfft2(np.conj(here) * there, size, workers=2)
    shifts = np.arange(-reach_px, reach_px + 1)
    return np.asarray(sums[np.ix_(shifts, shifts)])
