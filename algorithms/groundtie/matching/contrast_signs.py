"""Signs of the contrast between a radar and a camera image, in windows all over a pair.

A field, a forest, a roof or water may be brighter or darker than its surroundings in either image.
Grey values of one ground therefore correlate positively in some windows and negatively in others. A
layer that is drawn half transparent over both images correlates positively everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from ..context import Context
from ..rasters.patch import Patch, reduced_patch
from ..rasters.reading import FloatImage
from .chip_windows import ChipWindows, Resampled, singly
from .matcher import Places

# Structure that is compared is coarser than speckle and finer than a window: a Gaussian mean of
# blocks of 4 × 4 pixels less a wider one, by their standard deviations in blocks.
_BLOCK_PX, _FINE_BLOCKS, _TREND_BLOCKS = 4, 1.0, 3.0

# Margin of windows, which the means need.
_REACH_PX = 24

# Correlation that counts. Noise reaches it with either sign, in 2 to 4 % of windows of 64 px and in
# 12 to 14 % of windows of 40 px (tests/matching/test_contrast_signs.py).
_CORRELATED = 0.25


@dataclass(frozen=True)
class ContrastSigns:
    """Shares of the windows in which grey values correlate.

    Parameters
    ----------
    positive, negative
        With the same sign of contrast, and with the opposite one; 0 to 1 each.
    """

    positive: float
    negative: float


def survey_signs(images: Resampled, places: Places, context: Context) -> ContrastSigns:
    """Correlate the grey values of a pair in the windows of chips all over it.

    Parameters
    ----------
    images
        The pair's, resampled on the grid of the chips by the transform that was found.
    places
        The chips.
    context
        Threads.
    """
    windows = ChipWindows(images, places, _REACH_PX, None)
    _, found = windows.map(singly(_correlation), context)
    correlation = np.array(found)
    return ContrastSigns(
        float(np.mean(correlation > _CORRELATED)), float(np.mean(correlation < -_CORRELATED))
    )


def _correlation(reference: Patch, input: Patch) -> float:
    """Return the correlation coefficient in the middle of two windows; 0 if either is constant."""
    border = _REACH_PX // _BLOCK_PX
    one, other = (reduced_patch(patch, _BLOCK_PX, 0.5) for patch in (reference, input))
    valid = (one.valid & other.valid)[border:-border, border:-border]
    if np.count_nonzero(valid) < valid.size / 2:
        return 0.0
    grey, other_grey = (
        _structure(patch)[border:-border, border:-border][valid] for patch in (one, other)
    )
    if grey.std() == 0 or other_grey.std() == 0:
        return 0.0
    return float(np.corrcoef(grey, other_grey)[0, 1])


def _structure(patch: Patch) -> FloatImage:
    """Return the mean of the valid grey values around each pixel less their mean farther around."""
    weight = patch.valid.astype(np.float32)
    values = np.where(patch.valid, patch.values, np.float32(0))

    def mean(deviation: float) -> FloatImage:
        sums, share = (cv2.GaussianBlur(each, (0, 0), deviation) for each in (values, weight))
        return np.asarray(sums / np.maximum(share, np.float32(1e-6)))

    return mean(_FINE_BLOCKS) - mean(_TREND_BLOCKS)
