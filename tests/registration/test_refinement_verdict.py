from __future__ import annotations

import numpy as np
import pytest
from evidences import IMAGE_SIZE, control, refinement

from groundtie.geometry.accuracy import Common
from groundtie.registration.verdict import judge
from groundtie.sensor.adjustment import Control


def test_points_that_agree_confirm() -> None:
    fit, check = control((20, -9)), control((20, -9), 15, seed=1)
    evidence = refinement(fit, check, 0.5)
    verdict = judge(evidence)
    assert verdict.accepted
    assert evidence.held_out.name == "check points"
    assert evidence.before.rmse == pytest.approx(np.hypot(20, 9), abs=0.2)
    assert evidence.after.rmse == pytest.approx(0.3 * np.sqrt(2), rel=0.35)
    assert verdict.check_rmse_m == pytest.approx(0.5 * verdict.check_rmse_px)
    assert evidence.summary()["before"]["bias_col_px"] == pytest.approx(20, abs=0.3)


def test_without_check_points_each_is_judged_by_a_fit_without_it() -> None:
    fit = control((20, -9))
    evidence = refinement(fit)
    verdict = judge(evidence)
    assert verdict.accepted
    assert evidence.held_out.name == "points left out in turn"
    assert verdict.check_points == 40


def test_what_is_not_better_than_before_is_refused() -> None:
    fit = control((0, 0))
    check = control((0, 0), 15, noise_px=0.01, seed=1)
    verdict = judge(refinement(fit, check))
    assert not verdict.accepted
    assert "not nearer than before" in verdict.reason


@pytest.mark.parametrize(
    ("fit", "check", "max_error_px", "reason"),
    [
        (control((20, -9)), control((0, 0), 15, 40.0, seed=1), 3.0, "agree"),
        (control((20, -9), corner=0.2), None, 3.0, "spread over"),
        (control((20, -9), noise_px=1.5), None, 0.5, "above 0.5 px"),
        (control((20, -9)), control((26, -9), 15, seed=1), 3.0, "agree"),
    ],
)
def test_refusals(fit: Control, check: Control | None, max_error_px: float, reason: str) -> None:
    verdict = judge(refinement(fit, check, 1.0, max_error_px, "shift"))
    assert not verdict.accepted
    assert reason in verdict.reason


@pytest.mark.parametrize(("sigma_px", "is_accepted"), [(2.0, True), (2.3, False)])
def test_what_displaces_all_control_alike_is_part_of_the_error(
    sigma_px: float, is_accepted: bool
) -> None:
    """90 % of normal errors lie within 2.15 standard deviations; a limit of 3 px allows 4.55 px."""
    found = refinement(control((20, -9)), common=Common(np.zeros(2), sigma_px))
    verdict = judge(found)
    assert verdict.accepted == is_accepted
    assert verdict.accuracy.ce90_px == pytest.approx(2.15 * sigma_px, rel=0.05)


def test_a_model_that_points_do_not_hold_is_refused() -> None:
    """Points on a strip across the image do not determine the rows."""
    fit = control((20, -9), 20, 1.2)
    strip = fit.expected_px * [1.0, 0.26]
    narrow = Control(strip, strip + fit.found_px - fit.expected_px, fit.covariance_px2, IMAGE_SIZE)
    verdict = judge(refinement(narrow, None, 1.0, 2.2, "affine"))
    assert not verdict.accepted
