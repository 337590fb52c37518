from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from sklearn.neighbors import NearestNeighbors

from groundtie.studies.matching import METHODS, match

Descriptors = NDArray[np.float32]


def rows(count: int, seed: int, length: int = 32) -> Descriptors:
    values = np.random.default_rng(seed).random((count, length)).astype(np.float32)
    return values / np.linalg.norm(values, axis=1, keepdims=True)


def noisy(descriptors: Descriptors, seed: int) -> Descriptors:
    noise = np.random.default_rng(seed).normal(0, 0.01, descriptors.shape)
    return (descriptors + noise).astype(np.float32)


@pytest.mark.parametrize("method", METHODS)
def test_nearest_partners_and_ratios_are_those_of_scikit_learn(method: str) -> None:
    first, second = rows(300, 1), rows(500, 2)
    distances, index = NearestNeighbors(n_neighbors=2).fit(second).kneighbors(first)
    found = match(first, second, method=method)
    np.testing.assert_array_equal(found.first, np.arange(300))
    right = found.second == index[:, 0]
    # The forest of trees is approximate, more so on random rows than on real ones.
    assert right.all() if method == "exact" else right.mean() > 0.6
    if method == "exact":
        np.testing.assert_allclose(found.ratio, distances[:, 0] / distances[:, 1], rtol=1e-3)


def test_trees_find_what_is_clearly_nearest() -> None:
    second = rows(2000, 3, 128)
    order = np.random.default_rng(4).permutation(2000)
    found = match(noisy(second[order], 5), second, ratio=0.8)
    assert len(found) > 1900
    assert (found.second == order[found.first]).mean() > 0.99


def test_the_same_call_gives_the_same_matches() -> None:
    first, second = rows(200, 1), rows(300, 2)
    one, other = match(first, second), match(first, second)
    np.testing.assert_array_equal(one.second, other.second)


def test_a_ratio_keeps_what_is_clearly_nearest() -> None:
    first = rows(100, 1)
    second = np.concatenate([noisy(first[:40], 2), rows(200, 3)])
    found = match(first, second, ratio=0.5, method="exact")
    np.testing.assert_array_equal(found.first, np.arange(40))
    np.testing.assert_array_equal(found.second, np.arange(40))
    assert found.ratio.max() <= 0.5


def test_mutual_matches_are_each_other_s_nearest() -> None:
    first, second = rows(80, 1), rows(60, 2)
    found = match(first, second, mutual=True, method="exact")
    distance = np.linalg.norm(first[:, None] - second[None], axis=2)
    expected = [
        (i, j) for i, j in enumerate(distance.argmin(axis=1)) if distance[:, j].argmin() == i
    ]
    assert list(zip(found.first, found.second, strict=True)) == expected


def test_of_two_equal_partners_the_ratio_is_the_largest() -> None:
    one = rows(1, 1)
    twice = match(one, np.concatenate([one, one]), method="exact")
    assert twice.ratio.tolist() == [1.0]


@pytest.mark.parametrize("counts", [(0, 5), (5, 0), (0, 0)])
def test_nothing_matches_nothing(counts: tuple[int, int]) -> None:
    first, second = rows(counts[0], 1), rows(counts[1], 2)
    for mutual in (False, True):
        assert len(match(first, second, mutual=mutual)) == 0


@pytest.mark.parametrize("method", METHODS)
def test_a_single_candidate_is_everybody_s_partner(method: str) -> None:
    found = match(rows(4, 1), rows(1, 2), method=method)
    assert found.second.tolist() == [0] * 4
