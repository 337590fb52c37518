from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from groundtie.rasters.averaging import area_average, overlaps


def test_whole_pixels_are_plain_means() -> None:
    image = np.random.default_rng(0).random((12, 20)).astype(np.float32)
    valid = np.ones(image.shape, bool)
    means, known = area_average(image, valid, np.arange(0, 13, 3.0), np.arange(0, 21, 4.0))
    assert known.all()
    np.testing.assert_allclose(means, image.reshape(4, 3, 5, 4).mean(axis=(1, 3)), rtol=1e-6)


def test_parts_of_pixels_count_by_their_area() -> None:
    """OpenCV's area interpolation is another implementation of the same mean."""
    image = np.random.default_rng(1).random((50, 70)).astype(np.float32)
    edges = np.linspace(0, 50, 14), np.linspace(0, 70, 24)
    means, _ = area_average(image, np.ones(image.shape, bool), *edges)
    expected = cv2.resize(image, (23, 13), interpolation=cv2.INTER_AREA)
    np.testing.assert_allclose(means, expected, atol=1e-5)


def test_invalid_pixels_carry_no_weight() -> None:
    image = np.full((4, 4), 7.0, np.float32)
    valid = np.ones((4, 4), bool)
    valid[0, 0], image[0, 0] = False, -9999
    means, known = area_average(image, valid, np.arange(0, 5, 2.0), np.arange(0, 5, 2.0))
    assert known.all()
    np.testing.assert_array_equal(means, 7.0)


@pytest.mark.parametrize(("holes", "expected"), [(0, True), (8, True), (9, False), (16, False)])
def test_half_of_the_area_must_be_valid(holes: int, expected: bool) -> None:
    image, valid = np.ones((4, 4), np.float32), np.ones((4, 4), bool)
    valid.ravel()[:holes] = False
    means, known = area_average(image, valid, np.array([0.0, 4.0]), np.array([0.0, 4.0]))
    assert known[0, 0] == expected
    assert means[0, 0] == float(expected)


def test_complex_values_are_averaged_as_such() -> None:
    image = np.array([[1, 1j], [-1, -1j]], np.complex64)
    edges = np.array([0.0, 2.0])
    means, _ = area_average(image, np.ones((2, 2), bool), edges, np.array([0.0, 1.0, 2.0]))
    np.testing.assert_allclose(means, [[0, 0]], atol=1e-7)
    assert means.dtype == np.complex64


@given(
    count=st.integers(1, 40),
    cuts=st.lists(st.floats(0, 1), min_size=0, max_size=10),
)
def test_overlaps_share_out_every_pixel(count: int, cuts: list[float]) -> None:
    edges = np.array([0.0, *sorted(cut * count for cut in cuts), count])
    matrix = overlaps(edges, count, np.float64).toarray()
    np.testing.assert_allclose(matrix.sum(axis=0), 1.0, atol=1e-9)
    np.testing.assert_allclose(matrix.sum(axis=1), np.diff(edges), atol=1e-9)
    assert matrix.min() >= 0
