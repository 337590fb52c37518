from __future__ import annotations

import json
import math

import numpy as np
import pytest
from evidences import (
    GRID,
    LOST,
    check_points,
    estimated,
    evidence,
    fallen,
    fit_points,
    scatter,
    scene,
)
from raster_files import UTM

from groundtie.errors import BandError
from groundtie.geometry.chance import agreement_probability, log10_chance
from groundtie.geometry.estimation import Estimate
from groundtie.geometry.models import PolynomialModel
from groundtie.geometry.tie_points import TiePoints
from groundtie.geometry.transform import Transform
from groundtie.masks.used import MaskUsed
from groundtie.matching.check import CHECK_RADIUS_PX
from groundtie.registration.evidence import AGREEMENT, ERROR, SCENE, SURVEY, RegistrationEvidence
from groundtie.registration.rules import RULES, Rule
from groundtie.registration.verdict import NOT_JUDGED, Verdict, judge, judge_search

TRUTH = Transform.nominal(UTM, GRID)


def judged(check: TiePoints, estimate: Estimate | None = None, max_error: float = 3.0) -> Verdict:
    estimate = estimate or estimated(fit_points())
    images = scene(), MaskUsed.none(""), max_error
    return judge(RegistrationEvidence(*images, estimate, check, GRID))


@pytest.mark.parametrize("sigma", [0.2, 0.7, 1.2])
@pytest.mark.parametrize("wrong", [0.0, 0.5])
def test_right_points_are_accepted_and_their_error_measured(sigma: float, wrong: float) -> None:
    count = 72
    errors = scatter(count, sigma)
    errors[: int(wrong * count)] = fallen(int(wrong * count))
    verdict = judged(check_points(errors))
    assert verdict.accepted
    assert verdict.reason == "check points confirm the registration"
    assert verdict.check_rmse_px == pytest.approx(math.sqrt(2) * sigma, rel=0.2)
    assert verdict.check_rmse_m == pytest.approx(10 * verdict.check_rmse_px)
    assert verdict.ce90_m == pytest.approx(10 * verdict.accuracy.ce90_px)
    assert (verdict.fit_points, verdict.check_points) == (72, count)
    assert verdict.points == verdict.fit_points_used + verdict.check_points_agreeing
    assert verdict.extrapolated_share < 0.2


def test_errors_of_single_check_points_are_none_of_the_transform() -> None:
    verdict = judged(check_points(scatter(72, 1.2)))
    # 72 points of 0.3 px determine an affine model to 0.3 · √(3 / 72) per axis, on average.
    assert 0.5 * 2.146 * 0.3 * math.sqrt(3 / 72) < verdict.accuracy.ce90_px < 0.5 * 2.146 * 1.2


def test_what_all_check_points_share_is_an_error_of_the_transform() -> None:
    without, bias = (judged(check_points(scatter(72, 0.3) + [by, 0])) for by in (0.0, 1.2))
    assert without.accuracy.ce90_px < 0.4 < 1.2 < bias.accuracy.ce90_px


def test_radii_of_higher_probability_are_larger_and_come_with_an_interval() -> None:
    verdict = judged(check_points(scatter(72, 0.3)))
    low, high = verdict.accuracy.ce90_range_px
    assert verdict.accuracy.ce50_px < verdict.accuracy.ce90_px < verdict.accuracy.ce95_px
    assert low < verdict.accuracy.ce90_px < high


@pytest.mark.parametrize("seed", range(20))
def test_random_points_are_refused(seed: int) -> None:
    verdict = judged(check_points(fallen(72, seed)))
    assert not verdict.accepted
    assert "of 72 check points agree" in verdict.reason
    assert math.isnan(verdict.check_rmse_px)
    assert 0.001 < verdict.chance <= 1


@pytest.mark.parametrize("bias", [(5.0, 0.0), (-3.6, 3.6), (0.0, -4.0)])
def test_a_bias_is_refused(bias: tuple[float, float]) -> None:
    verdict = judged(check_points(scatter(72, 0.4) + bias))
    assert not verdict.accepted


def test_a_bias_within_the_tolerance_counts_as_error() -> None:
    """With 1.2 px of bias and a largest error of 1 px, the points agree, but not well enough."""
    check = check_points(scatter(72, 0.3) + [1.2, 0])
    verdict = judged(check, max_error=1.0)
    assert not verdict.accepted
    assert "above 1 px" in verdict.reason
    assert verdict.check_rmse_px == pytest.approx(math.hypot(1.2, 0.3 * math.sqrt(2)), rel=0.15)
    assert judged(check, max_error=3.0).accepted


def test_what_is_measured_does_not_depend_on_the_largest_error() -> None:
    """Exact matches, and others that agree within 2 px: a small limit makes no outliers of them."""
    check = check_points(np.concatenate([scatter(42, 0.06), scatter(30, 0.9, seed=9)]))
    refused, usual = judged(check, max_error=0.2), judged(check, max_error=3.0)
    assert usual.accepted
    assert refused.rule == "error at held-out points"
    assert refused.check_rmse_px == usual.check_rmse_px > 0.5
    assert refused.accuracy == usual.accuracy


def test_points_in_one_corner_do_not_hold_the_rest() -> None:
    estimate = estimated(fit_points(within=(0.15, 0.15), sigma=0.5), "polynomial2")
    verdict = judged(check_points(scatter(72, 0.3)), estimate)
    assert not verdict.accepted
    # Either the model varies too much over the overlap, or check points far off disagree.
    assert "do not determine the model" in verdict.reason or "check points agree" in verdict.reason


def test_a_shift_of_points_in_one_corner_is_accepted_and_the_rest_is_extrapolated() -> None:
    estimate = estimated(fit_points(within=(0.3, 0.3)), "translation")
    verdict = judged(check_points(scatter(72, 0.3)), estimate)
    assert verdict.accepted
    # The hull of the points covers 0.3² of (579 - 20) × (479 - 20) px.
    hull = 0.09 * (579 - 20) * (479 - 20)
    assert verdict.extrapolated_share == pytest.approx(1 - hull / (600 * 500), abs=1e-6)
    assert verdict.spread_px < 0.2


def test_the_chance_counts_all_check_points_but_only_those_that_agree() -> None:
    errors = fallen(40)
    errors[:12] = 0.0
    far = np.hypot(*errors.T) > 2
    check = check_points(errors)
    check = check.reject(far & (np.arange(40) > 30), "no peak")
    verdict = judged(check)
    assert verdict.check_points == 40
    assert verdict.check_points_agreeing == int((~far).sum())
    probability = agreement_probability(2.0, CHECK_RADIUS_PX)
    expected = log10_chance(int((~far).sum()), 40, probability)
    assert verdict.log10_chance == pytest.approx(expected, abs=1e-9)
    assert verdict.chance == pytest.approx(10**expected)


@pytest.mark.parametrize("count", [0, 1, 2])
def test_few_check_points_confirm_nothing(count: int) -> None:
    verdict = judged(check_points(np.zeros((count, 2))))
    assert not verdict.accepted
    assert verdict.check_points == count


def test_three_exact_points_are_enough() -> None:
    assert judged(check_points(np.zeros((3, 2)))).accepted


@pytest.mark.parametrize(
    ("right", "wrong", "accepted"), [(3, 6, False), (4, 5, True), (3, 0, True)]
)
def test_three_of_nine_check_points_are_not_enough(right: int, wrong: int, accepted: bool) -> None:
    away = 9.0 * np.array([[1, 0], [0, -1], [-1, 1], [1, 1], [-1, 0], [0, 1]])
    check = check_points(np.concatenate([np.zeros((right, 2)), away[:wrong]]))
    assert judged(check).accepted == accepted


def test_fit_points_that_were_all_rejected() -> None:
    """The model may come from surfaces; the hull of no points covers nothing."""
    estimate = estimated(fit_points())
    none = estimate.points.reject(np.ones(len(estimate.points), bool), "forward–backward error")
    verdict = judged(
        check_points(scatter(30, 0.3)), Estimate(estimate.transform, none, estimate.fold_models)
    )
    assert verdict.fit_points_used == 0
    assert verdict.extrapolated_share == 1.0


def test_summaries_are_json_whatever_happened() -> None:
    exact = judged(check_points(np.zeros((400, 2))))
    # A probability of 10^-679 underflows, but must not cause a failure.
    assert exact.log10_chance == pytest.approx(400 * math.log10(4 * math.pi / 25**2), rel=1e-6)
    assert exact.chance == 0.0
    one_fold = estimated(fit_points())
    one_fold = Estimate(one_fold.transform, one_fold.points, one_fold.fold_models[:1])
    unheld = judged(check_points(np.zeros((30, 2))), one_fold)
    assert not unheld.accepted
    for verdict in (exact, judged(check_points(fallen(72))), LOST, NOT_JUDGED, unheld):
        summary = json.loads(json.dumps(verdict.summary(), allow_nan=False))
        assert summary["accepted"] is verdict.accepted
        assert summary["reason"] == verdict.reason
        assert summary["points"] == verdict.points
        more = {"points", "chance", "ce90_low_px", "ce90_high_px"}
        more |= {"ellipse_major_px", "ellipse_minor_px", "ellipse_angle_deg"}
        more |= {"ce50_px", "ce90_px", "ce95_px", "heights_px"}
        assert set(summary) == set(vars(verdict)) - {"accuracy", "is_final"} | more
    assert LOST.summary()["check_rmse_px"] is None
    assert NOT_JUDGED.summary()["check_rmse_px"] is None


def test_a_refusal_names_its_rule_and_what_to_try() -> None:
    accepted = judged(check_points(scatter(72, 0.3)))
    assert (accepted.rule, accepted.advice) == ("", "")
    assert accepted.sentence() == accepted.reason
    refused = judged(check_points(fallen(72)))
    rule = next(rule for rules in RULES.values() for rule in rules if rule.name == refused.rule)
    assert refused.advice == rule.advice
    assert refused.sentence() == f"{refused.reason}; {rule.advice}"


def test_the_first_rule_that_refuses_decides() -> None:
    """These points do not agree, and there is not enough ground; agreement is tested first."""
    little = MaskUsed("ground", "reference", 0.05, "as in a town")
    assert judge(evidence(fallen(72), mask=little)).rule == "chance agreement"
    errors = scatter(72, 0.3) + [1.2, 0.0]
    found = judge(evidence(errors, max_error_px=1.0, mask=little))
    assert found.rule == "error at held-out points"
    # Results refused for their error or scene have figures all the same.
    assert found.check_rmse_px > 1
    assert judge(evidence(errors, mask=little)).check_rmse_px > 1


def test_a_search_that_failed_is_a_refusal_and_bad_input_is_not() -> None:
    assert (LOST.accepted, LOST.rule) == (False, "nothing in common")
    assert LOST.reason == "nothing in common was found"
    with pytest.raises(BandError, match="no band 7"):
        judge_search(BandError("there is no band 7"))


def test_what_the_model_predicts_is_judged_not_the_nominal_place() -> None:
    """Nominally the input is 80 m off; the model corrects it, so that its points agree."""
    shift = PolynomialModel("translation", TRUTH.model.frame, np.array([[80.0, -50.0]]))
    fit = fit_points()
    moved = Estimate(Transform(shift, UTM, GRID), fit, estimated(fit).fold_models)
    off = check_points(scatter(40, 0.3) + [8.0, 5.0])
    assert judged(off, moved).accepted
    assert not judged(check_points(scatter(40, 0.3)), moved).accepted


@pytest.mark.parametrize("stage", [AGREEMENT, ERROR, SCENE, SURVEY])
def test_a_rule_at_any_stage_refuses(stage: str, monkeypatch: pytest.MonkeyPatch) -> None:
    rule = Rule("house rule", "all", "this test", "go", lambda _: "forbidden")
    good = evidence(scatter(72, 0.3))
    assert judge(good).accepted
    monkeypatch.setattr("groundtie.registration.verdict.RULES", {**RULES, stage: (rule,)})
    found = judge(good)
    assert (found.accepted, found.rule, found.reason) == (False, "house rule", "forbidden")
    # Errors of possibly random matches measure nothing.
    assert math.isnan(found.check_rmse_px) == (stage == AGREEMENT)
