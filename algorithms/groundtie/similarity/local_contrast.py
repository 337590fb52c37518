"""Images without pixels that differ from their surroundings, as shadows, roofs and walls do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..rasters.patch import Patch
from .sameness import covered
from .unexplained import blurred, centred

# A pixel is dark or bright if it differs from the mean of a window of this side, as wide as the
# smallest chip of a survey, by its standard deviation. With 0.7 times as much, more than half of
# some images is masked; with 1.5 times, a correct transform has a second place as high as its own
# (suites real and margins, --classes "shadows at another hour").
_WINDOW_PX = 41


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
    differs = valid & (sign * (values - mean) > np.sqrt(variance))
    # Neighbours may be mixed pixels.
    return replace(patch, valid=valid & ~covered(differs, 3))
