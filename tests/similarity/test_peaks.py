from __future__ import annotations

import numpy as np
import pytest

from groundtie.similarity.peaks import highest_peaks, suppress

BOX = np.ones((3, 3), bool)


def test_peaks_come_best_first_and_apart() -> None:
    surface = np.zeros((9, 9))
    surface[2, 2], surface[3, 3], surface[6, 1], surface[2, 4] = 9, 8, 5, 7
    assert list(highest_peaks(surface, 3, BOX)) == [(2, 2), (2, 4), (6, 1)]


def test_the_last_peak_is_not_suppressed() -> None:
    surface = np.eye(3)
    assert list(highest_peaks(surface, 1, BOX)) == [(0, 0)]
    np.testing.assert_array_equal(surface, np.eye(3))


def test_beyond_the_border_is_nothing() -> None:
    surface = np.ones((4, 5))
    suppress(surface, (0, 4), BOX)
    assert np.argwhere(surface == 0).tolist() == [[0, 3], [0, 4], [1, 3], [1, 4]]


@pytest.mark.parametrize(("circular", "suppressed"), [((), [0, 1]), ((0,), [0, 1, 7])])
def test_ends_of_angles_are_neighbours(circular: tuple[int, ...], suppressed: list[int]) -> None:
    angles = np.ones(8)
    suppress(angles, (0,), np.ones(3, bool), circular)
    assert np.flatnonzero(angles == 0).tolist() == suppressed


def test_the_footprint_may_have_any_shape() -> None:
    cross = np.array([[0, 1, 0], [1, 1, 1], [0, 1, 0]], bool)
    surface = np.ones((3, 3))
    suppress(surface, (1, 1), cross)
    np.testing.assert_array_equal(surface == 0, cross)
