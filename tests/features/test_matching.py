from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from groundtie.features.matching import match_near

Descriptors = NDArray[np.float32]


def rows(count: int, seed: int, length: int = 32) -> Descriptors:
    values = np.random.default_rng(seed).random((count, length)).astype(np.float32)
    return values / np.linalg.norm(values, axis=1, keepdims=True)


def test_near_matches_are_the_nearest_of_the_gate() -> None:
    rng = np.random.default_rng(0)
    first, second = rows(150, 1), rows(400, 2)
    predicted, position = rng.uniform(0, 100, (150, 2)), rng.uniform(0, 100, (400, 2))
    distance = np.linalg.norm(first[:, None] - second[None], axis=2)
    apart = np.linalg.norm(predicted[:, None] - position[None], axis=2)
    distance[apart > 12.0] = np.inf
    two = np.sort(distance, axis=1)[:, :2]
    found = match_near(first, second, predicted, position, 12.0)
    nearest, back = distance.argmin(axis=1), distance.argmin(axis=0)
    mutual = np.isfinite(two[:, 0]) & (back[nearest] == np.arange(150))
    assert 0 < mutual.sum() < 150
    np.testing.assert_array_equal(found.first, np.nonzero(mutual)[0])
    np.testing.assert_array_equal(found.second, nearest[mutual])
    np.testing.assert_allclose(found.ratio, two[mutual, 0] / two[mutual, 1], rtol=1e-4)


def test_a_partner_without_a_rival_has_no_ratio() -> None:
    one = rows(1, 1)
    alone = match_near(one, one, np.zeros((1, 2)), np.zeros((1, 2)), 5.0)
    assert alone.ratio.tolist() == [0.0]


@pytest.mark.parametrize("counts", [(0, 5), (5, 0), (0, 0)])
def test_nothing_matches_nothing(counts: tuple[int, int]) -> None:
    first, second = rows(counts[0], 1), rows(counts[1], 2)
    places = np.zeros((counts[0], 2)), np.zeros((counts[1], 2))
    assert len(match_near(first, second, *places)) == 0
