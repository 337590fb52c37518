"""The verdict on known errors, and the numbers of an assessment."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from known_errors import normal_errors, places, shifted

from groundtie.assessment.accuracy import Assessment
from groundtie.assessment.point_errors import PointErrors
from groundtie.errors import TooFewPointsError


class TestVerdict:
    def errors(self, error: Any, count: int = 20) -> PointErrors:
        xy = places(count)
        transform = shifted(37.0, -24.0)
        return PointErrors.of(transform, xy, transform(xy) + np.asarray(error, float))

    def test_small_errors_are_accepted(self) -> None:
        errors = self.errors(normal_errors(25, 0.5), 25)
        verdict = Assessment(check_points=errors, control_points=self.errors([0, 0], 9)).judge(2.0)
        assert verdict.accepted
        assert verdict.reason == "check points confirm the registration"
        assert (verdict.check_points, verdict.check_points_agreeing) == (25, 25)
        assert (verdict.fit_points, verdict.fit_points_used) == (9, 9)
        assert verdict.check_rmse_px == pytest.approx(errors.in_pixels.rmse)
        assert verdict.check_rmse_m == pytest.approx(10 * verdict.check_rmse_px, rel=1e-6)
        assert errors.in_pixels.ce90 == pytest.approx(2.146 * 0.5, rel=1e-3)
        assert verdict.summary()["chance"] is None

    @pytest.mark.parametrize(("length", "accepted"), [(2.999, True), (3.001, False)])
    def test_the_limit(self, length: float, accepted: bool) -> None:
        verdict = Assessment(check_points=self.errors([length, 0])).judge(3.0)
        assert verdict.accepted == accepted
        if not accepted:
            assert verdict.reason == "error at check points is 3.00 px, above 3 px"

    def test_check_points_go_before_test_points(self) -> None:
        good, bad = self.errors([0.1, 0]), self.errors([9.0, 0])
        assert Assessment(check_points=good, test_points=bad).judge(3.0).accepted
        verdict = Assessment(check_points=bad, test_points=good).judge(3.0)
        assert "error at check points is 9.00 px" in verdict.reason
        verdict = Assessment(test_points=good).judge(3.0)
        assert verdict.reason == "test points confirm the registration"

    def test_control_points_do_not_matter(self) -> None:
        good, bad = self.errors([0.1, 0]), self.errors([50.0, 0])
        assert Assessment(check_points=good, control_points=bad).judge(3.0).accepted

    @pytest.mark.parametrize(
        ("name", "label"), [("two_way", "two-way"), ("three_way", "three-way")]
    )
    def test_inconsistency_refuses(self, name: str, label: str) -> None:
        good, bad = self.errors([0.1, 0]), self.errors([0.0, 3.5])
        assert Assessment(check_points=good, **{name: good}).judge(3.0).accepted
        verdict = Assessment(check_points=good, **{name: bad}).judge(3.0)
        assert not verdict.accepted
        assert verdict.reason == f"{name.replace('_', '-')} inconsistency is 3.50 px, above 3 px"

    def test_two_points_are_too_few(self) -> None:
        assert Assessment(check_points=self.errors([0.1, 0], 3)).judge(3.0).accepted
        verdict = Assessment(check_points=self.errors([0.1, 0], 2)).judge(3.0)
        assert verdict.rule == "chance agreement"
        assert verdict.reason == "2 check points are too few to measure anything"

    @pytest.mark.parametrize(
        ("inliers", "of", "rule"),
        [
            (2, 5, "chance agreement"),
            (4, 20, "small share of check points"),
            (5, 20, ""),
        ],
    )
    def test_few_inliers_refuse(self, inliers: int, of: int, rule: str) -> None:
        errors = self.errors([0.1, 0], of)
        counted = np.arange(of) < inliers
        verdict = Assessment(test_points=replace(errors, counted=counted)).judge(3.0)
        assert verdict.rule == rule

    @pytest.mark.parametrize("count", [6, 10, 16])
    def test_test_points_that_fell_anywhere_are_refused(self, count: int) -> None:
        """By 3 % and more of such draws, three of them scatter no wider than is allowed."""
        for seed in range(200):
            far = np.random.default_rng(seed).uniform(-12.5, 12.5, (count, 2))
            points = self.errors(far, count).of_inliers(3.0)
            assert not Assessment(test_points=points).judge(3.0).accepted

    @pytest.mark.parametrize("sigma", [0.0, 0.1, 2.0])
    def test_few_test_points_that_agree_are_enough(self, sigma: float) -> None:
        points = self.errors(normal_errors(6, sigma), 6).of_inliers(3.0)
        verdict = Assessment(test_points=points).judge(3.0)
        assert verdict.accepted
        assert verdict.log10_chance < -4
        assert verdict.summary()["chance"] < 1e-4

    @pytest.mark.parametrize("limit_px", [5.0, 12.0, 20.0, 60.0])
    def test_no_error_is_so_large_that_windows_confirm_it(self, limit_px: float) -> None:
        """Points that were searched for nearby lie nearby, whatever the transform is."""
        for seed in range(50):
            far = np.random.default_rng(seed).uniform(-12.5, 12.5, (10, 2))
            points = self.errors(far, 10).of_inliers(limit_px)
            assert not Assessment(test_points=points).judge(limit_px).accepted

    def test_windows_are_as_large_as_the_pixels_that_were_matched(self) -> None:
        """Of an input with ten pixels for each that it was matched in."""
        right = replace(self.errors(normal_errors(9, 5.0), 9), window_px=250.0)
        assert Assessment(test_points=right.of_inliers(20.0)).judge(20.0).accepted
        for seed in range(50):
            far = np.random.default_rng(seed).uniform(-125, 125, (9, 2))
            points = replace(self.errors(far, 9), window_px=250.0).of_inliers(20.0)
            assert not Assessment(test_points=points).judge(20.0).accepted

    def test_a_point_that_cannot_be_placed_is_no_small_error(self) -> None:
        errors = self.errors([0.1, 0])
        errors.error_px[3] = np.inf
        verdict = Assessment(check_points=errors).judge(3.0)
        assert verdict.reason == "the transform cannot place 1 of 20 check points"

    def test_a_quarter_of_the_test_points_must_be_right(self) -> None:
        errors = self.errors([0.1, 0], 40)
        for right, accepted in ((10, True), (9, False)):
            marked = replace(errors, counted=np.arange(40) < right)
            assert Assessment(test_points=marked).judge(3.0).accepted == accepted

    def test_without_points_there_is_no_verdict(self) -> None:
        assessment = Assessment(control_points=self.errors([0, 0]), two_way=self.errors([0, 0]))
        with pytest.raises(TooFewPointsError, match="no points took no part in the fit"):
            assessment.judge(3.0)


def test_the_summary_has_all_parts_whatever_was_measured() -> None:
    summary = Assessment().summary()
    assert list(summary) == [
        "control_points",
        "test_points",
        "check_points",
        "two_way",
        "three_way",
    ]
    assert all(part["points"] == 0 and math.isnan(part["ce90_m"]) for part in summary.values())


def test_the_summary_is_for_json() -> None:
    errors = PointErrors.of(shifted(1, 2), places(), shifted(1, 2)(places()) + [1, 0])
    summary = json.loads(json.dumps(Assessment(check_points=errors).summary()["check_points"]))
    assert summary["rmse_px"] == pytest.approx(1)
    assert summary["bias_x_m"] == pytest.approx(10)
    assert summary["std_y_m"] == pytest.approx(0, abs=1e-6)
