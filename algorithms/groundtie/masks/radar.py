"""Distinction of radar from camera images, by the variation of their most homogeneous windows."""

from __future__ import annotations

import numpy as np

from ..rasters.pair import Image
from ..rasters.patch import Patch, middle_window
from ..rasters.reading import FloatImage
from ..speckle.statistics import homogeneous_variation2

# Side of the sample in the middle of an image, at full resolution: averaging would remove speckle.
SAMPLE_PX = 1024

# Least squared coefficient of variation of the power in the most homogeneous windows of a radar
# image, and its least ratio to that of a camera image. Measured in pixels of a few metres: 0.09 to
# 0.24, ratio 12 to 300; two radar images of one place: ratio 7 at most.
LEAST_VARIATION2, LEAST_VARIATION2_RATIO = 0.05, 9.0


def variation2_of(image: Image) -> float:
    """Return the squared coefficient of variation in an image's most homogeneous windows.

    Grey values are assumed to be amplitudes.
    """
    middle = middle_window(image.source.grid, SAMPLE_PX)
    patch = Patch(*image.source.read(middle, image.band))
    return homogeneous_variation2(power(patch), patch.valid)


def power(patch: Patch) -> FloatImage:
    """Return the power of amplitudes, 0 where invalid."""
    return np.where(patch.valid, patch.values * patch.values, np.float32(0))
