"""Relief displacement of matches, from their scatter along one line."""

from __future__ import annotations

import numpy as np
import pytest
from evidences import displaced, scatter

from groundtie.registration.layover import scatter_along_line


def scatter_px(residuals: np.ndarray) -> float:
    return float(np.hypot(*scatter_along_line(residuals, np.ones(len(residuals)))))


@pytest.mark.parametrize("count", [20, 100])
def test_heights_that_are_spread_evenly_scatter_by_their_standard_deviation(count: int) -> None:
    """Over 5 px, that is 5 / √12 px."""
    assert scatter_px(displaced(count, -2.5, 2.5)) == pytest.approx(5 / np.sqrt(12), rel=0.25)


def test_they_scatter_along_their_line() -> None:
    residuals = displaced(100, -2.5, 2.5)
    line = residuals[np.argmax(np.hypot(*residuals.T))]
    found = scatter_along_line(residuals, np.ones(100))
    assert abs(found @ line) == pytest.approx(np.hypot(*found) * np.hypot(*line), rel=0.01)


def test_errors_in_all_directions_are_no_heights() -> None:
    assert scatter_px(scatter(100, 1.5)) == 0


def test_chance_is_taken_for_heights_at_the_usual_level() -> None:
    """By either of two tests at 5 %: in no more than 10 % of all cases, and no less than 5 %."""
    draws = np.random.default_rng(3).normal(0, 1.5, (2000, 30, 2))
    assert 0.05 < np.mean([scatter_px(residuals) > 0 for residuals in draws]) < 0.1


def test_a_few_wrong_matches_hide_no_line() -> None:
    """Not normally distributed: ten of 60 match anywhere within 6 px."""
    wrong = np.random.default_rng(1).uniform(-6, 6, (10, 2))
    assert scatter_px(np.concatenate([displaced(50, -2.5, 2.5), wrong])) > 0.5


def test_what_is_no_inlier_counts_for_nothing() -> None:
    residuals = np.concatenate([scatter(100, 0.5), displaced(30, 4, 10)])
    assert scatter_px(residuals) > 1
    weights = np.repeat([1.0, 0.0], [100, 30])
    assert np.hypot(*scatter_along_line(residuals, weights)) == 0


def test_too_few_show_nothing() -> None:
    assert scatter_px(displaced(2, -2.5, 2.5)) == 0
