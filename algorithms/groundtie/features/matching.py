"""Matches of keypoints by nearest descriptors, with their ratio, near predicted positions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..geometry.rows import Rows
from ..memory import AT_ONCE
from ..rasters.grid import FloatArray

Descriptors = NDArray[np.float32]
Indices = NDArray[np.intp]

# Largest distance of a partner from its predicted position ([Suri2010] 6.9.2).
GATE_PX = 16


@dataclass(frozen=True)
class Matches(Rows):
    """Keypoints of a first table and their partners in a second one.

    Parameters
    ----------
    first, second
        Row numbers in both tables, shape (n,).
    ratio
        Distance of their descriptors over that to the next best partner, 0 to 1, shape (n,); 0
        without another partner.
    """

    first: Indices
    second: Indices
    ratio: FloatArray

    @classmethod
    def of(cls, nearest: Nearest) -> Matches:
        """Return the matches of the keypoints that have a nearest partner."""
        which = np.nonzero(nearest.index >= 0)[0]
        distance, following = nearest.distance[which], nearest.next_distance[which]
        ratio = np.ones(len(which))
        np.divide(distance, following, out=ratio, where=following > 0)
        return cls(which, nearest.index[which], ratio)


@dataclass(frozen=True)
class Nearest:
    """Nearest partner of each keypoint, -1 for none, and the distances to it and to the next."""

    index: Indices
    distance: FloatArray
    next_distance: FloatArray


def match_near(
    first: Descriptors,
    second: Descriptors,
    predicted_px: FloatArray,
    position_px: FloatArray,
    gate_px: float = GATE_PX,
) -> Matches:
    """Match keypoints that are mutual nearest neighbours, near predicted positions.

    Only partners within the gate are compared. They include hundreds of times fewer wrong ones than
    the whole image, so that the ratio need not separate inliers from outliers ([Suri2010] 6.9).

    Parameters
    ----------
    first, second
        Descriptors, shapes (n, k) and (m, k).
    predicted_px
        Predicted positions of the first ones' partners, shape (n, 2).
    position_px
        Positions of the second ones, shape (m, 2).
    gate_px
        Largest distance of a partner from its predicted position.
    """
    pairs = _pairs_within(predicted_px, position_px, gate_px)
    distance = _pair_distances(first, second, pairs)
    found = Matches.of(_best_of_each(pairs, distance, len(first)))
    back = _best_of_each(pairs[:, ::-1], distance, len(second)).index
    return found.take(back[found.second] == found.first)


def _pairs_within(first: FloatArray, second: FloatArray, reach: float) -> Indices:
    """Return all pairs of positions within reach, row numbers of shape (p, 2), ascending."""
    from scipy.spatial import cKDTree  # takes 0.1 s to import; all tools import this module

    near = cKDTree(first).sparse_distance_matrix(cKDTree(second), reach, output_type="ndarray")
    return np.column_stack([near["i"], near["j"]])[np.lexsort((near["j"], near["i"]))]


def _pair_distances(first: Descriptors, second: Descriptors, pairs: Indices) -> FloatArray:
    distances = np.zeros(len(pairs))
    step = max(AT_ONCE // max(first.shape[1], 1), 1)
    for start in range(0, len(pairs), step):
        one, other = pairs[start : start + step].T
        difference = first[one] - second[other]
        squared = np.einsum("ij,ij->i", difference, difference)
        distances[start : start + step] = np.sqrt(squared)
    return distances


def _best_of_each(pairs: Indices, distance: FloatArray, count: int) -> Nearest:
    """Return the nearest partner and the next distance for `count` features of the first column."""
    order = np.lexsort((distance, pairs[:, 0]))
    owner, partner, sorted_distance = pairs[order, 0], pairs[order, 1], distance[order]
    start = np.searchsorted(owner, np.arange(count))
    stop = np.searchsorted(owner, np.arange(count), side="right")
    index = np.full(count, -1, np.intp)
    best, following = np.full(count, np.inf), np.full(count, np.inf)
    some, several = stop > start, stop > start + 1
    index[some], best[some] = partner[start[some]], sorted_distance[start[some]]
    following[several] = sorted_distance[start[several] + 1]
    return Nearest(index, best, following)
