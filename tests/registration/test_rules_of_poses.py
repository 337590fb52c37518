"""Rules of registrations judge poses, too: by chips all over the overlap."""

from __future__ import annotations

import numpy as np
import pytest
from evidences import (
    displaced,
    estimated,
    fit_points,
    in_band,
    refusing,
    scatter,
    survey,
)

from groundtie.matching.pose_survey import PoseSurvey
from groundtie.matching.rest import Rest
from groundtie.matching.survey import Survey
from groundtie.registration.layover import CHIPS_MEAN_OVER_SCATTER
from groundtie.registration.pose_verdict import PoseSurveyEvidence


@pytest.mark.parametrize(
    ("agreeing", "found", "rest", "expected"),
    [
        (7, survey(), None, []),
        (5, survey(), None, ["chance agreement", "small share of check points"]),
        (7, survey(35, part=14), None, ["part elsewhere"]),
        (7, survey(height=4.0, rival=3.5), None, ["second place nearby"]),
        (7, survey(height=1.9, rival=0.5), None, ["weak similarity"]),
        (7, survey(), Rest(survey(height=2.4, rival=1.0)), ["pixel-locked content"]),
    ],
)
def test_rules_of_registrations_judge_poses(
    agreeing: int, found: Survey, rest: Rest | None, expected: list[str]
) -> None:
    """Of 21 chips, about as many agree as at the worst real pose that is right."""
    errors = np.where(np.arange(21) < agreeing, 4.9, 5.1)
    residuals = np.column_stack([errors, np.zeros(21)])
    moved = estimated(fit_points()).transform
    assert refusing(PoseSurveyEvidence(PoseSurvey(residuals, found, rest, moved))) == expected


@pytest.mark.parametrize(("rival", "expected"), [(8.0, ["band elsewhere"]), (1.0, [])])
def test_a_band_of_other_ground_refuses_a_pose(rival: float, expected: list[str]) -> None:
    residuals, moved = np.zeros((21, 2)), estimated(fit_points()).transform
    alone = in_band(survey(height=2.0, rival=rival))
    assert refusing(PoseSurveyEvidence(PoseSurvey(residuals, survey(), None, moved, alone))) == (
        expected
    )


@pytest.mark.parametrize(
    ("residuals", "factor", "expected"),
    [
        (scatter(25, 0.5), CHIPS_MEAN_OVER_SCATTER, []),
        (
            np.concatenate([scatter(13, 0.5), displaced(12, 6, 12)]),
            CHIPS_MEAN_OVER_SCATTER,
            ["layover of check points"],
        ),
        (displaced(25, -2, 2), CHIPS_MEAN_OVER_SCATTER, ["layover of fit points"]),
        (displaced(25, -2, 2), None, []),
    ],
)
def test_poses_of_elevated_objects_are_refused(
    residuals: np.ndarray, factor: float | None, expected: list[str]
) -> None:
    """Between two radar images, canopies and roofs lie along a line beside the ground."""
    moved = estimated(fit_points()).transform
    found = PoseSurvey(residuals, survey(), None, moved)
    assert refusing(PoseSurveyEvidence(found, factor)) == expected


@pytest.mark.parametrize(
    ("agreeing", "is_shift", "expected"),
    [(12, True, ["small share of check points"]), (13, True, []), (12, False, [])],
)
def test_half_of_the_chips_agree_on_a_pose_that_only_shifts(
    agreeing: int, is_shift: bool, expected: list[str]
) -> None:
    """Labels that are drawn into both arrays move no array otherwise."""
    residuals = np.concatenate([scatter(agreeing, 0.5), np.full((25 - agreeing, 2), np.inf)])
    found = PoseSurvey(residuals, survey(), None, estimated(fit_points()).transform)
    assert refusing(PoseSurveyEvidence(found, None, is_shift)) == expected
