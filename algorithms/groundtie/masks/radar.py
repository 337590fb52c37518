"""Which image of a pair is the radar's."""

from __future__ import annotations

import numpy as np

from ..rasters.pair import Image
from ..rasters.patch import Patch
from ..rasters.radar_tags import is_known_radar
from ..rasters.reading import Window
from ..speckle.statistics import FloatImage, homogeneous_variation2

# Looked at in the middle of an image, at full resolution: averaging would take speckle away.
_SAMPLE_PX = 1024

# Relative variance of the power in the calmest windows of radar images, and how many times that of
# a camera's it is. Measured at pixels of few metres: 0.09 to 0.24, 12 to 300 times; two radar
# images of one place: 7 times at most.
_RADAR, _BESIDE_CAMERA = 0.05, 9.0


def is_rather_radar(image: Image, other: Image) -> bool:
    """Tell whether an image is a radar's rather than another: by metadata, or else by speckle.

    Parameters
    ----------
    image, other
        The images; their grey values are taken for amplitudes.
    """
    known, other_known = _is_known(image), _is_known(other)
    return known if known != other_known else _calm(image) >= _calm(other)


def is_radar_and_camera(image: Image, other: Image) -> bool:
    """Tell whether an image is a radar's, and another is not.

    It has the speckle of a radar's, and the other far less than it; or its metadata tell, and the
    other has no speckle.
    """
    if _is_known(other):
        return False
    calm, other_calm = _calm(image), _calm(other)
    if _is_known(image):
        return other_calm < _RADAR
    return calm >= _RADAR and calm >= _BESIDE_CAMERA * other_calm


def are_both_radar(image: Image, other: Image) -> bool:
    """Tell whether both images have the speckle of a radar's, or metadata that tell it."""
    return all(_is_known(one) or has_speckle(one) for one in (image, other))


def has_speckle(image: Image) -> bool:
    """Tell whether an image has the speckle of a radar's."""
    return _calm(image) >= _RADAR


def power(patch: Patch) -> FloatImage:
    """Return the power of amplitudes, 0 where invalid."""
    return np.where(patch.valid, patch.values * patch.values, np.float32(0))


def _is_known(image: Image) -> bool:
    return is_known_radar(image.source)


def _calm(image: Image) -> float:
    grid = image.source.grid
    width, height = min(grid.width, _SAMPLE_PX), min(grid.height, _SAMPLE_PX)
    middle = Window((grid.width - width) // 2, (grid.height - height) // 2, width, height)
    patch = Patch(*image.source.read(middle, image.band))
    return homogeneous_variation2(power(patch), patch.valid)
