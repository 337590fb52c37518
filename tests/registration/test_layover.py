"""Layover between two radar images: heights displace matches along one line."""

from __future__ import annotations

import numpy as np
import pytest
from evidences import displaced, estimated, evidence, fallen, fit_points, fit_with, scatter

from groundtie.geometry.tie_points import TiePoints
from groundtie.registration.evidence import RegistrationEvidence
from groundtie.registration.layover import (
    CHIPS_MEAN_OVER_SCATTER,
    KEYPOINTS_MEAN_OVER_SCATTER,
)
from groundtie.registration.rules import RULES


def layover(found: RegistrationEvidence) -> str | None:
    """Return what the rules on layover state."""
    rules = [rule for rule in RULES if rule.name.startswith("layover")]
    assert len(rules) == 2
    reasons = [rule.reason(found) for rule in rules]
    return next((reason for reason in reasons if reason is not None), None)


def reason(
    check_errors: np.ndarray,
    fit: TiePoints | None = None,
    factor: float | None = KEYPOINTS_MEAN_OVER_SCATTER,
) -> str | None:
    return layover(evidence(check_errors, estimated(fit or fit_points()), layover_factor=factor))


def test_level_ground_has_no_layover() -> None:
    assert reason(scatter(16, 0.3)) is None


@pytest.mark.parametrize("seed", range(20))
def test_points_that_fell_anywhere_are_not_layover(seed: int) -> None:
    assert reason(np.concatenate([scatter(7, 0.3), fallen(9, seed)])) is None


def test_a_few_canopies_beside_the_ground_are_let_pass() -> None:
    assert reason(np.concatenate([scatter(11, 0.3), displaced(5, 4, 10)])) is None


@pytest.mark.parametrize("side", [-1, 1])
def test_more_roofs_than_ground_are_refused(side: int) -> None:
    found = reason(np.concatenate([scatter(6, 0.3), side * displaced(9, 4, 10)]))
    assert found is not None
    assert "9 of 15 check points lie along a line beside the 6 that agree" in found


def test_so_few_may_lie_on_a_line_by_chance() -> None:
    assert reason(np.concatenate([scatter(3, 0.3), displaced(2, 4, 10)])) is None


@pytest.mark.parametrize("count", [20, 100])
def test_matches_on_many_heights_are_refused(count: int) -> None:
    """Heights that are spread evenly over 5 px scatter by 5 / √12 px."""
    found = reason(scatter(16, 0.3), fit_with(displaced(count, -2.5, 2.5)))
    assert found is not None
    scattered = float(found.split("scatter by ")[1].split(" px")[0])
    assert scattered == pytest.approx(5 / np.sqrt(12), rel=0.25)


def test_matches_that_scatter_in_all_directions_are_not_layover() -> None:
    assert reason(scatter(16, 0.3), fit_with(scatter(100, 1.5))) is None


def test_a_little_scatter_along_a_line_is_let_pass() -> None:
    """Hedges and fields in rows: what is meant is what may move the model by the largest error."""
    assert reason(scatter(16, 0.3), fit_with(displaced(100, -0.8, 0.8))) is None


def test_chips_scatter_less_than_what_they_show() -> None:
    fit = fit_with(displaced(100, -1.0, 1.0))
    assert reason(scatter(16, 0.3), fit) is None
    found = reason(scatter(16, 0.3), fit, CHIPS_MEAN_OVER_SCATTER)
    assert found is not None and "scatter by 0." in found


@pytest.mark.parametrize("errors", [displaced(9, 4, 10), displaced(9, -10, -4)])
def test_only_two_radar_images_are_tested(errors: np.ndarray) -> None:
    check = np.concatenate([scatter(6, 0.3), errors])
    assert reason(check) is not None
    assert reason(check, fit_with(displaced(100, -2.5, 2.5)), None) is None


def test_too_few_matches_show_nothing() -> None:
    assert reason(scatter(16, 0.3), fit_with(displaced(6, -2.5, 2.5))) is None
