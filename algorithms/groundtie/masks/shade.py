"""The side on which an image's shadows fall, and the ground that is out of them.

The camera shows ground beside tall objects dark, and the radar does not. Shadows make grey values
of one kind of ground differ, always on the same side of what casts them, and so pull every match
of the ground to one side. Which it is, is told from the image itself: dark lies beside bright more
often on the one side than on the other.
"""

from __future__ import annotations

import cv2
import numpy as np
import scipy.fft
from numpy.typing import NDArray

from ..rasters.patch import Patch
from ..rasters.reading import Mask

# Dark and bright are the outer parts of the histogram.
_OUTER_PERCENT = 15.0

# Distances at which dark is looked for beside bright, in pixels.
_NEAR_PX, _FAR_PX = 2, 14

# How far from what stands beside it ground may lie in shadow.
SHADE_M = 12.0


def shade_azimuth_deg(patch: Patch) -> float:
    """Return the direction in which shadows fall, clockwise from the top of the image.

    Parameters
    ----------
    patch
        An image of a camera, which shows tall objects.
    """
    level = cv2.GaussianBlur(patch.values, (0, 0), 1.0)
    low, high = np.percentile(level[patch.valid], [_OUTER_PERCENT, 100 - _OUTER_PERCENT])
    dark, bright = (level <= low) & patch.valid, (level >= high) & patch.valid
    size = [scipy.fft.next_fast_len(n + _FAR_PX, real=True) for n in level.shape]
    spectra = [scipy.fft.rfft2(m.astype(np.float32), size, workers=2) for m in (bright, dark)]
    # How often dark lies at an offset from bright.
    together = scipy.fft.irfft2(np.conj(spectra[0]) * spectra[1], size, workers=2)
    y, x = np.mgrid[-_FAR_PX : _FAR_PX + 1, -_FAR_PX : _FAR_PX + 1]
    distance = np.hypot(x, y)
    near = (distance > _NEAR_PX) & (distance <= _FAR_PX)
    says = together[y[near], x[near]] / distance[near]
    return float(np.degrees(np.arctan2((says * x[near]).sum(), -(says * y[near]).sum())) % 360)


def out_of_shade(ground: Mask, azimuth_deg: float, pixel_m: float) -> Mask:
    """Return what of the ground is so far from what stands beside it that it is out of its shade.

    Parameters
    ----------
    ground
        What is known to be ground, shape (h, w); all else may be tall.
    azimuth_deg
        Direction in which shadows fall, clockwise from the top of the image.
    pixel_m
        Size of a pixel.
    """
    reach = max(round(SHADE_M / pixel_m), 1)
    along = np.deg2rad(azimuth_deg)
    steps = np.arange(1, reach + 1)
    # Looking back from a place to what may shade it.
    cols, rows = (np.rint(f * steps).astype(int) for f in (np.sin(along), -np.cos(along)))
    window: NDArray[np.uint8] = np.zeros((2 * reach + 1,) * 2, np.uint8)
    window[reach - rows, reach - cols] = 1
    window[reach, reach] = 1
    return np.asarray(cv2.erode(ground.astype(np.uint8), window) > 0)
