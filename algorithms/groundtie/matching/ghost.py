"""A second place that is left when what the reference repeats of itself is taken out.

A surface is similar to how the reference matches itself: what repeats shows in both. An input that
shows its ground elsewhere, beneath a copy of the reference or what is drawn into both, has a peak
there that the reference has not.
"""

from __future__ import annotations

import cv2
import numpy as np

from ..similarity.surface import Surface

# Nearer to the peak, surfaces differ as its shape does: between two radar images up to 8 px off.
_NEAREST_PX = 9.0

# A ghost is the highest place in a window of this side; slopes of the peak are none.
_WINDOW_PX = 5


def ghost_height(mean: Surface, own: Surface) -> float:
    """Return how high a surface is elsewhere, in robust standard deviations of what is not own.

    Parameters
    ----------
    mean
        Mean surface of chips in the input, around where a model has them, shape (2 r + 1, 2 r + 1).
    own
        That of the same chips in the reference.
    """
    radius = len(mean) // 2
    shift = np.arange(-radius, radius + 1)
    far = np.hypot(*np.meshgrid(shift, shift)) >= _NEAREST_PX
    design = np.column_stack([own.ravel(), np.ones(own.size)])
    share = np.linalg.lstsq(design[far.ravel()], mean[far], rcond=None)[0]
    left = mean - (design @ share).reshape(mean.shape)
    # What is highest at the border may be higher beyond.
    inside = np.maximum(*np.meshgrid(abs(shift), abs(shift))) < radius
    tops = left[far & inside & (left >= cv2.dilate(left, np.ones((_WINDOW_PX,) * 2)))]
    spread = 1.4826 * float(np.median(np.abs(left[far] - np.median(left[far]))))
    return float(tops.max(initial=0.0)) / max(spread, 1e-9)
