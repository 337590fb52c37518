from __future__ import annotations

import numpy as np
import pytest
from shapely.geometry import Point

from groundtie.features.keypoints import Keypoints
from groundtie.studies.repeatability import CLASS_NAMES, classes, overlap_error, repeatability


def circles(px: np.ndarray, scale: float | np.ndarray = 2.0) -> Keypoints:
    px = np.asarray(px, float)
    count = len(px)
    scales = np.broadcast_to(np.asarray(scale, float), (count,)).copy()
    return Keypoints(px, scales, np.zeros(count), np.ones(count))


@pytest.mark.parametrize(
    ("apart", "scales"), [(0, (2, 2)), (3, (2, 2)), (7, (2, 2.5)), (3, (4, 1.5)), (80, (2, 2))]
)
def test_overlap_errors_are_shapely_s(apart: float, scales: tuple[float, float]) -> None:
    first = circles([[0, 0]], scales[0])
    second = circles([[0.6 * apart, 0.8 * apart]], scales[1])
    one = Point(0, 0).buffer(30, 256)
    other = Point(0.6 * apart, 0.8 * apart).buffer(30 * scales[1] / scales[0], 256)
    expected = 1 - one.intersection(other).area / one.union(other).area
    assert overlap_error(first, second)[0] == pytest.approx(expected, abs=2e-4)


def test_three_pixels_apart_is_an_error_of_about_a_tenth() -> None:
    # [Suri2010] 6.6.2: 0–10 % are usually 0–3 pixels.
    assert overlap_error(circles([[0, 0]]), circles([[2.3, 0]]))[0] < 0.1
    assert overlap_error(circles([[0, 0]]), circles([[3.5, 0]]))[0] > 0.1


def test_classes_count_overlap_errors() -> None:
    counts = classes(np.array([0.05, 0.1, 0.15, 0.35, 0.39, 0.8]))
    assert counts.tolist() == [2, 1, 0, 2, 1]
    assert len(CLASS_NAMES) == len(counts)


def test_the_same_features_repeat_fully() -> None:
    px = np.random.default_rng(0).uniform(0, 300, (50, 2))
    found = repeatability(circles(px), circles(px))
    assert found.tolist() == [1, 0, 0, 0, 0]


def test_each_feature_repeats_once_and_the_rest_are_counted_as_missing() -> None:
    first = circles([[0, 0], [100, 0], [200, 0]])
    # Two near the first of which one can count, one at twice the scale, none at the last.
    second = circles([[1, 0], [2, 0], [100, 0], [400, 400]], [2, 2, 4, 2])
    found = repeatability(first, second)
    np.testing.assert_allclose(found, [1 / 3, 0, 0, 0, 2 / 3])


def test_no_features_repeat_nothing() -> None:
    found = repeatability(Keypoints.none(), circles([[0, 0]]))
    assert found.tolist() == [0] * 5
