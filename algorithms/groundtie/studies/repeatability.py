"""Repeatability of a detector's features in two registered images ([Suri2010] 6.6.2).

As in [Mikolajczyk2005], features are circles whose radii are their scales. Two features correspond
if their circles overlap enough, after both are scaled so that the first's radius is 30 pixels.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..features.keypoints import Keypoints
from ..rasters.grid import FloatArray

# Upper limits of the classes of overlap errors; the last class holds all larger errors.
CLASS_LIMITS = (0.1, 0.2, 0.3, 0.4)
CLASS_NAMES = ("0–10 %", "10–20 %", "20–30 %", "30–40 %", "> 40 %")

_RADIUS_PX = 30.0


def overlap_error(first: Keypoints, second: Keypoints) -> FloatArray:
    """Return 1 − intersection / union of the circles of paired features, shape (n,).

    Parameters
    ----------
    first, second
        n features each, in the pixels of the first image. Both circles of a pair are scaled alike,
        so that the first has a radius of 30 pixels.
    """
    grow = _RADIUS_PX / first.scale_px
    # The distance of the centres is not scaled: [Mikolajczyk2005] normalises only the regions.
    apart = np.hypot(*(second.position_px - first.position_px).T)
    a, b = np.full(len(first), _RADIUS_PX), second.scale_px * grow
    shared = _lens(a, b, apart)
    return np.asarray(1 - shared / (np.pi * (a**2 + b**2) - shared))


def _lens(a: FloatArray, b: FloatArray, apart: FloatArray) -> FloatArray:
    """Return the intersection area of circles of radii a and b whose centres are `apart`."""
    inside = np.pi * np.minimum(a, b) ** 2
    with np.errstate(divide="ignore", invalid="ignore"):
        at_a = np.arccos(np.clip((apart**2 + a**2 - b**2) / (2 * apart * a), -1, 1))
        at_b = np.arccos(np.clip((apart**2 + b**2 - a**2) / (2 * apart * b), -1, 1))
    corners = (-apart + a + b) * (apart + a - b) * (apart - a + b) * (apart + a + b)
    partly = a**2 * at_a + b**2 * at_b - 0.5 * np.sqrt(np.maximum(corners, 0))
    return np.where(apart >= a + b, 0.0, np.where(apart <= np.abs(a - b), inside, partly))


def classes(errors: FloatArray) -> NDArray[np.int_]:
    """Return the number of overlap errors in each of `CLASS_NAMES`, shape (5,)."""
    return np.bincount(np.searchsorted(CLASS_LIMITS, errors), minlength=len(CLASS_NAMES))


def repeatability(first: Keypoints, second: Keypoints) -> FloatArray:
    """Return the share of features that correspond one to one, by class of overlap error.

    Pairs are formed from the smallest overlap error to the largest. The last class counts the
    features without a partner within the largest class limit.

    Parameters
    ----------
    first, second
        Features in the pixels of the first image.

    Returns
    -------
    Correspondences in each of `CLASS_NAMES` over the size of the smaller set, shape (5,).
    """
    possible = min(len(first), len(second))
    if possible == 0:
        return np.zeros(len(CLASS_NAMES))
    # Circles whose centres are a radius apart have overlap errors above all class limits.
    pairs = cKDTree(first.position_px).query_ball_tree(cKDTree(second.position_px), _RADIUS_PX)
    one = np.repeat(np.arange(len(first)), [len(p) for p in pairs])
    other = np.concatenate([np.asarray(p, int) for p in pairs])
    errors = overlap_error(first.take(one), second.take(other))
    overlapping = np.nonzero(errors <= CLASS_LIMITS[-1])[0]
    order = overlapping[np.argsort(errors[overlapping], kind="stable")]
    free_one, free_other = np.ones(len(first), bool), np.ones(len(second), bool)
    kept = []
    for pair in order:
        if free_one[one[pair]] and free_other[other[pair]]:
            free_one[one[pair]] = free_other[other[pair]] = False
            kept.append(pair)
    counts = classes(errors[kept])
    counts[-1] = possible - len(kept)
    return np.asarray(counts / possible)
