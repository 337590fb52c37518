"""Keypoint matching by descriptors alone, and filtering of matches by a model."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ..features.matching import Descriptors, FloatArray, Indices, Matches, Nearest
from ..geometry.fitting import fit_model
from ..geometry.models import PARAMETERS
from ..memory import AT_ONCE

METHODS = ("exact", "kd-tree")

# Number of k-d trees, and of leaves that a query visits (best bin first; [Beis1997]).
_TREES = 4
_CHECKS = 64

# Filtered matching: largest residual in standard deviations of all residuals, and the residual
# below which differences are rounding errors.
_SIGMAS = 2.0
_ROUNDING_PX = 1e-6


def match(
    first: Descriptors,
    second: Descriptors,
    ratio: float = 1.0,
    mutual: bool = False,
    method: str = "kd-tree",
) -> Matches:
    """Match keypoints by their descriptors alone.

    Parameters
    ----------
    first, second
        Descriptors, shapes (n, k) and (m, k).
    ratio
        Largest ratio of the distances to the nearest and to the second-nearest partner; at 1 each
        keypoint keeps its nearest partner.
    mutual
        Whether both keypoints of a match must be each other's nearest.
    method
        "exact", or "kd-tree" for an approximate search by a forest of k-d trees.
    """
    found = Matches.of(_nearest(first, second, method))
    found = found.take(found.ratio <= ratio)
    if not mutual:
        return found
    back = _nearest(second, first, method).index
    return found.take(back[found.second] == found.first)


def filter_matches(
    px: FloatArray, partner_px: FloatArray, kind: str = "affine"
) -> NDArray[np.bool_]:
    """Return a mask of the matches that remain after the worst are dropped one by one.

    Filtered matching, [Suri2010] 3.4.4 and 6.7.1: fit a model to all matches, drop the match with
    the largest residual, and repeat until all residuals are at most two of their standard
    deviations. It needs more inliers than outliers to start from.

    Parameters
    ----------
    px, partner_px
        Positions of matched keypoints, shape (n, 2).
    kind
        One of `models.KINDS`.

    Returns
    -------
    Shape (n,); all False if there are too few matches for the model.
    """
    kept = np.ones(len(px), bool)
    fewest = PARAMETERS[kind] // 2 + 1
    while kept.sum() >= fewest:
        model = fit_model(kind, px, partner_px, kept.astype(float))
        residuals = np.hypot(*(partner_px - model(px)).T)
        spread = np.sqrt(np.mean(residuals[kept] ** 2))
        worst = int(np.argmax(np.where(kept, residuals, -1.0)))
        if residuals[worst] <= max(_SIGMAS * spread, _ROUNDING_PX):
            return kept
        kept[worst] = False
    return np.zeros(len(px), bool)


def _nearest(first: Descriptors, second: Descriptors, method: str) -> Nearest:
    if len(first) == 0 or len(second) == 0:
        nothing = np.full(len(first), np.inf)
        return Nearest(np.full(len(first), -1), nothing, nothing)
    if len(second) == 1:
        distance = np.linalg.norm(first - second, axis=1).astype(float)
        return Nearest(np.zeros(len(first), np.intp), distance, np.full(len(first), np.inf))
    if method == "exact":
        index, distance = _two_nearest(first, second)
    else:
        index, distance = _two_nearest_by_trees(first, second)
    return Nearest(index, distance[:, 0], distance[:, 1])


def _two_nearest(first: Descriptors, second: Descriptors) -> tuple[Indices, FloatArray]:
    own, other = (first**2).sum(axis=1), (second**2).sum(axis=1)
    index = np.zeros((len(first), 2), np.intp)
    squared = np.zeros((len(first), 2))
    step = max(AT_ONCE // len(second), 1)
    for start in range(0, len(first), step):
        block = slice(start, start + step)
        distances = own[block, None] + other - 2 * (first[block] @ second.T)
        two = np.argpartition(distances, 1, axis=1)[:, :2]
        values = np.take_along_axis(distances, two, axis=1)
        order = np.argsort(values, axis=1, kind="stable")
        index[block] = np.take_along_axis(two, order, axis=1)
        squared[block] = np.take_along_axis(values, order, axis=1)
    return index[:, 0], np.sqrt(np.maximum(squared, 0))


def _two_nearest_by_trees(first: Descriptors, second: Descriptors) -> tuple[Indices, FloatArray]:
    # The trees are random: a fixed seed makes the result reproducible.
    cv2.setRNGSeed(0)
    index = cv2.flann.Index(second, {"algorithm": 1, "trees": _TREES})
    found, squared = index.knnSearch(first, 2, params={"checks": _CHECKS})
    return found[:, 0].astype(np.intp), np.sqrt(np.asarray(squared, float))
