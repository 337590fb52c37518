from __future__ import annotations

import numpy as np
import pytest
from registration.test_verdict import (
    GRID,
    RADIUS,
    check_points,
    estimated,
    fallen,
    fit_points,
    points,
    scatter,
)

from groundtie.geometry.tie_points import TiePoints
from groundtie.registration.layover import CHIPS_MEAN_OVER_SCATTER, leaning

# Where heights lean: along range, here off the axes of the map.
RANGE = np.array([np.cos(0.3), np.sin(0.3)])


def leant(count: int, low: float, high: float, seed: int = 5) -> np.ndarray:
    """Return errors of matches on things of various heights, exact across the range."""
    lengths = np.random.default_rng(seed).uniform(low, high, count)
    return lengths[:, None] * RANGE + scatter(count, 0.2, seed)


def reason(check_errors: np.ndarray, fit: TiePoints | None = None) -> str | None:
    return leaning(estimated(fit or fit_points()), check_points(check_errors), GRID, 3.0, RADIUS)


def test_level_ground_does_not_lean() -> None:
    assert reason(scatter(16, 0.3)) is None


@pytest.mark.parametrize("seed", range(20))
def test_points_that_fell_anywhere_do_not_lean(seed: int) -> None:
    assert reason(np.concatenate([scatter(7, 0.3), fallen(9, seed)])) is None


def test_a_few_canopies_beside_the_ground_are_let_pass() -> None:
    assert reason(np.concatenate([scatter(11, 0.3), leant(5, 4, 10)])) is None


@pytest.mark.parametrize("side", [-1, 1])
def test_more_roofs_than_ground_lean(side: int) -> None:
    found = reason(np.concatenate([scatter(6, 0.3), side * leant(9, 4, 10)]))
    assert found is not None
    assert "9 of 15 check points lie along a line beside the 6 that agree" in found


def test_so_few_may_lie_on_a_line_by_chance() -> None:
    assert reason(np.concatenate([scatter(3, 0.3), leant(2, 4, 10)])) is None


def fit_with(errors: np.ndarray) -> TiePoints:
    """Return points of a fit whose matches have errors."""
    px = np.random.default_rng(6).uniform([20, 20], [579, 479], (len(errors), 2))
    return points(px, errors, check=False)


@pytest.mark.parametrize("count", [20, 100])
def test_matches_on_many_heights_lean(count: int) -> None:
    """Heights that are spread evenly over 5 px scatter by 5 / √12 px."""
    found = reason(scatter(16, 0.3), fit_with(leant(count, -2.5, 2.5)))
    assert found is not None
    scattered = float(found.split("scatter by ")[1].split(" px")[0])
    assert scattered == pytest.approx(5 / np.sqrt(12), rel=0.25)


def test_matches_that_scatter_in_all_directions_do_not_lean() -> None:
    assert reason(scatter(16, 0.3), fit_with(scatter(100, 1.5))) is None


def test_a_little_scatter_along_a_line_is_let_pass() -> None:
    """Hedges and fields in rows: what is meant is what may move the model by the largest error."""
    assert reason(scatter(16, 0.3), fit_with(leant(100, -0.8, 0.8))) is None


def test_chips_scatter_less_than_what_they_show() -> None:
    estimate, check = estimated(fit_with(leant(100, -1.0, 1.0))), check_points(scatter(16, 0.3))
    assert leaning(estimate, check, GRID, 3.0, RADIUS) is None
    found = leaning(estimate, check, GRID, 3.0, RADIUS, CHIPS_MEAN_OVER_SCATTER)
    assert found is not None and "scatter by 0." in found


def test_too_few_matches_tell_nothing() -> None:
    assert reason(scatter(16, 0.3), fit_with(leant(6, -2.5, 2.5))) is None
