from __future__ import annotations

import numpy as np
import pytest

from groundtie.registration.refinement_verdict import judge_refinement
from groundtie.sensor.adjustment import Control, adjust

SIZE = (1000, 800)


def points(
    shift: tuple[float, float],
    count: int = 40,
    noise_px: float = 0.3,
    corner: float = 1.0,
    seed: int = 0,
) -> Control:
    random = np.random.default_rng(seed)
    px = random.uniform(0, 1, (count, 2)) * SIZE * corner
    found = px + shift + random.normal(0, noise_px, px.shape)
    return Control(px, found, np.tile(0.01 * np.eye(2), (count, 1, 1)), SIZE)


def test_points_that_agree_confirm() -> None:
    fit, check = points((20, -9)), points((20, -9), 15, seed=1)
    found = judge_refinement(fit, adjust(fit), check, 0.5, 3.0)
    assert found.verdict.accepted
    assert found.held_out == "check points"
    assert found.before.rmse == pytest.approx(np.hypot(20, 9), abs=0.2)
    assert found.after.rmse == pytest.approx(0.3 * np.sqrt(2), rel=0.35)
    assert found.verdict.check_rmse_m == pytest.approx(0.5 * found.verdict.check_rmse_px)
    assert found.summary()["before"]["bias_col_px"] == pytest.approx(20, abs=0.3)


def test_without_check_points_each_is_judged_by_a_fit_without_it() -> None:
    fit = points((20, -9))
    found = judge_refinement(fit, adjust(fit), None, 1.0, 3.0)
    assert found.verdict.accepted
    assert found.held_out == "points left out in turn"
    assert found.verdict.check_points == 40


def test_what_is_not_better_than_before_is_refused() -> None:
    fit = points((0, 0))
    check = points((0, 0), 15, noise_px=0.01, seed=1)
    found = judge_refinement(fit, adjust(fit), check, 1.0, 3.0)
    assert not found.verdict.accepted
    assert "not nearer than before" in found.verdict.reason


@pytest.mark.parametrize(
    ("fit", "check", "max_error_px", "reason"),
    [
        (points((20, -9)), points((0, 0), 15, 40.0, seed=1), 3.0, "agree"),
        (points((20, -9), corner=0.2), None, 3.0, "spread over"),
        (points((20, -9), noise_px=1.5), None, 0.5, "above 0.5 px"),
        (points((20, -9)), points((26, -9), 15, seed=1), 3.0, "agree"),
    ],
)
def test_refusals(fit: Control, check: Control | None, max_error_px: float, reason: str) -> None:
    found = judge_refinement(fit, adjust(fit, "shift"), check, 1.0, max_error_px)
    assert not found.verdict.accepted
    assert reason in found.verdict.reason


def test_a_model_that_points_do_not_hold_is_refused() -> None:
    """Points on a strip across the image say nothing of its rows."""
    fit = points((20, -9), 20, 1.2)
    strip = fit.expected_px * [1.0, 0.26]
    narrow = Control(strip, strip + fit.found_px - fit.expected_px, fit.covariance_px2, SIZE)
    found = judge_refinement(narrow, adjust(narrow, "affine"), None, 1.0, 2.2)
    assert not found.verdict.accepted
