"""Distinction of radar from camera images, by the variation of their most homogeneous windows."""

from __future__ import annotations

import numpy as np

from ..rasters.pair import Image
from ..rasters.patch import Patch, has_negative, sample_of
from ..rasters.reading import FloatImage, Window
from ..speckle.statistics import homogeneous_variation2

# Least squared coefficient of variation of the power in the most homogeneous windows of a radar
# image, and its least ratio to that of a camera image. Measured in pixels of a few metres: 0.09 to
# 0.24, ratio 12 to 300; two radar images of one place: ratio 7 at most.
LEAST_VARIATION2, LEAST_VARIATION2_RATIO = 0.05, 9.0

# Backscatter in decibels: from the noise of a radar to corner reflectors, and the least range of
# the middle 98 % of the values. Real images have 8 dB and more between 10 and 90 % (suite
# radar_likeness); standardised images have 4.7 between 1 and 99 %.
_LEAST_DB, _MOST_DB, _LEAST_RANGE_DB = -60.0, 40.0, 10.0

# Stated decibels are smaller: 20 log10 of the largest amplitude of 16 bits is 96.3. Others are
# scaled, or the statement is wrong.
_MOST_STATED_DB = 100.0


def variation2_of(image: Image, part: Window | None = None) -> float:
    """Return the squared coefficient of variation in an image's most homogeneous windows.

    Grey values are assumed to be amplitudes, or decibels; `part` is asked for, by default the whole
    image.
    """
    patch = _sample(image, part)
    amplitude = to_amplitude(patch) if _holds_decibels(image, patch) else patch
    return homogeneous_variation2(power(amplitude), patch.valid)


def is_in_decibels(image: Image, part: Window | None = None) -> bool:
    """Whether an image has decibels: by a band's unit or name, else by its values.

    Many values of backscatter are negative, and none is beyond a range. Other images with as many
    negative values, such as indices and standardised ones, have a larger or a much smaller range.
    Decibels that are all positive cannot be told from grey values. `part` is asked for, by default
    the whole image.
    """
    may_be = image.source.dtype.kind != "u" or _states_decibels(image)
    return may_be and _holds_decibels(image, _sample(image, part))


def to_amplitude(patch: Patch) -> Patch:
    """Return the amplitudes of decibels."""
    return Patch(np.float32(10) ** (patch.values / np.float32(20)), patch.valid)


def power(patch: Patch) -> FloatImage:
    """Return the power of amplitudes, 0 where invalid."""
    return np.where(patch.valid, patch.values * patch.values, np.float32(0))


def _sample(image: Image, part: Window | None) -> Patch:
    source = image.source

    def read(window: Window) -> Patch:
        return Patch(*source.read(window, image.band))

    return sample_of(read, source.grid, part)


def _states_decibels(image: Image) -> bool:
    source = image.source
    numbers = source.image_bands if image.band is None else (image.band,)
    return any(source.bands[number - 1].is_in_decibels for number in numbers)


def _holds_decibels(image: Image, patch: Patch) -> bool:
    known = patch.values[patch.valid]
    if _states_decibels(image) and np.abs(known).max(initial=0) <= _MOST_STATED_DB:
        return True
    if not has_negative(known) or known.min() < _LEAST_DB or known.max() > _MOST_DB:
        return False
    low, high = np.percentile(known, (1, 99))
    return bool(high - low >= _LEAST_RANGE_DB)
