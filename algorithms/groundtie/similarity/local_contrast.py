"""Images without pixels that differ from their surroundings, as shadows, roofs and walls do."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from ..rasters.patch import Patch
from .unexplained import blurred, centred

# A pixel is dark or bright if it differs from the mean of a window of this side, as wide as the
# smallest chip of a survey, by so many standard deviations. Its neighbours may be mixed pixels.
# At 0.7, more than half of some images is masked; at 1.5, a correct transform has a second place as
# high as its own (suites real and margins, --classes "shadows at another hour").
_WINDOW_PX, _DEVIATIONS = 41, 1.0
_NEIGHBOURS = np.ones((3, 3), np.uint8)


def without_dark(patch: Patch) -> Patch:
    """Return an image, shape (h, w), with the pixels masked that cast shadows may darken."""
    return _without(patch, -1)


def without_bright(patch: Patch) -> Patch:
    """Return an image, shape (h, w), with bright pixels masked, such as roofs and walls."""
    return _without(patch, 1)


def _without(patch: Patch, sign: int) -> Patch:
    valid = patch.valid
    values = centred(patch.values, valid)
    known = np.maximum(blurred(valid, _WINDOW_PX), np.finfo(np.float32).eps)
    mean = blurred(values, _WINDOW_PX) / known
    variance = np.maximum(blurred(values * values, _WINDOW_PX) / known - mean * mean, 0)
    differs = valid & (sign * (values - mean) > np.float32(_DEVIATIONS) * np.sqrt(variance))
    around = cv2.dilate(differs.astype(np.uint8), _NEIGHBOURS) > 0
    return replace(patch, valid=valid & ~around)
