"""The error of a registration and what it makes of it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from benchmarks.accuracy import (
    CORRECT,
    INACCURATE,
    REFUSED,
    SILENTLY_WRONG,
    Truth,
    classify,
    lattice,
)

SIZE = (101, 51)
IDENTITY = np.eye(2)


def identity(px: np.ndarray) -> np.ndarray:
    return px


def test_lattice_covers_the_reference_from_border_to_border() -> None:
    px = lattice(SIZE)
    np.testing.assert_allclose(px.min(axis=0), [0, 0])
    np.testing.assert_allclose(px.max(axis=0), [100, 50])
    np.testing.assert_allclose(px.mean(axis=0), [50, 25])


def test_the_truth_has_no_error() -> None:
    truth = Truth.on_lattice(identity, SIZE, IDENTITY)
    assert truth.error_px(identity) == 0


def test_a_shift_is_its_length() -> None:
    truth = Truth.on_lattice(identity, SIZE, IDENTITY)
    assert truth.error_px(lambda px: px + [3.0, -4.0]) == pytest.approx(5.0)


def test_errors_are_root_mean_squares() -> None:
    truth = Truth(np.zeros((4, 2)), np.zeros((4, 2)), IDENTITY)
    off = np.array([[0.0, 0.0], [0.0, 0.0], [2.0, 0.0], [0.0, 4.0]])
    assert truth.error_px(lambda px: off) == pytest.approx(math.sqrt((4 + 16) / 4))


def test_a_scale_error_grows_towards_the_border() -> None:
    # The mean square of (0.01 x, 0) over 21 equidistant x of 0 … 100 is 0.0001 · 3416.67.
    truth = Truth.on_lattice(identity, SIZE, IDENTITY)
    expected = 0.01 * math.sqrt(np.mean(np.arange(0, 101, 5.0) ** 2))
    assert truth.error_px(lambda px: px * [1.01, 1.0]) == pytest.approx(expected)


def test_errors_are_in_reference_pixels() -> None:
    # The input's pixels are half as large and turned by 90°: 2 of them are 1 reference pixel.
    linear = np.array([[0.0, -2.0], [2.0, 0.0]])
    truth = Truth.on_lattice(lambda px: px @ linear.T, SIZE, linear)
    assert truth.error_px(lambda px: px @ linear.T + [0.0, 2.0]) == pytest.approx(1.0)


def test_unequal_pixels_count_by_their_direction() -> None:
    linear = np.diag([4.0, 0.5])
    truth = Truth.on_lattice(lambda px: px @ linear, SIZE, linear)
    assert truth.error_px(lambda px: px @ linear + [4.0, 0.0]) == pytest.approx(1.0)
    assert truth.error_px(lambda px: px @ linear + [0.0, 4.0]) == pytest.approx(8.0)


def test_an_unknown_error_stays_unknown() -> None:
    truth = Truth.on_lattice(identity, SIZE, IDENTITY)
    assert math.isnan(truth.error_px(lambda px: px * math.nan))


@pytest.mark.parametrize(
    ("error_px", "sigma_px", "expected"),
    [
        (0.0, 0.0, CORRECT),
        (1.0, 0.0, CORRECT),
        (1.001, 0.0, INACCURATE),
        (3.0, 0.0, INACCURATE),
        (3.001, 0.0, SILENTLY_WRONG),
        (3.0, 2.0, CORRECT),
        (3.5, 2.0, INACCURATE),
        (5.0, 2.0, INACCURATE),
        (5.5, 2.0, SILENTLY_WRONG),
        (math.inf, 0.0, SILENTLY_WRONG),
    ],
)
def test_accepted_registrations_are_judged_by_their_error(
    error_px: float, sigma_px: float, expected: str
) -> None:
    assert classify(True, error_px, sigma_px) == expected


@pytest.mark.parametrize("error_px", [0.0, 100.0, math.nan])
def test_a_refusal_is_never_wrong(error_px: float) -> None:
    assert classify(False, error_px, 0.0) == REFUSED


def test_an_unknown_error_is_not_taken_for_a_correct_one() -> None:
    with pytest.raises(ValueError, match="must be known"):
        classify(True, math.nan, 0.0)
