"""Rules of registrations also judge poses, by chips all over the overlap."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from evidences import (
    GRID,
    RADARS,
    displaced,
    estimated,
    facts,
    fallen,
    fit_points,
    leaving,
    refusing,
    scatter,
    scene,
    survey,
)

from groundtie.masks.used import MaskUsed
from groundtie.matching.band_shifts import BandShift
from groundtie.matching.pose_survey import POSE_TOLERANCE_PX, PoseSurvey
from groundtie.matching.survey import Survey
from groundtie.matching.surveys import Rest, Surveys
from groundtie.registration.pose_verdict import PoseSurveyEvidence

CHIPS = np.stack(np.meshgrid(*[np.arange(5) * 100 + 50] * 2), -1).reshape(-1, 2)


def posed(
    residuals: np.ndarray,
    chips: Survey | None = None,
    *,
    layover_factor: float | None = None,
    is_shift: bool = False,
    rest: Rest | None = None,
    ground: Sequence[Survey] = (),
    fine: Survey | None = None,
    **more: Any,
) -> PoseSurveyEvidence:
    """Return the evidence of a pose from which chips differ by residuals, shape (n, 2)."""
    fitted = estimated(fit_points())
    found = PoseSurvey(
        GRID,
        CHIPS[: len(residuals)],
        residuals,
        Surveys(chips or survey(), rest, ground, fine),
        fitted.transform,
        **{"fold_models": fitted.fold_models, **more},
    )
    images = scene(), MaskUsed.none(""), POSE_TOLERANCE_PX
    return PoseSurveyEvidence(*images, found, layover_factor, is_shift)


def fallen_beyond(count: int) -> np.ndarray:
    """Return random errors of matches outside the tolerance, shape (n, 2)."""
    errors = fallen(4 * count + 4)
    return errors[np.hypot(*errors.T) > POSE_TOLERANCE_PX][:count]


@pytest.mark.parametrize(("rival", "expected"), [(1.7, ["ground elsewhere"]), (1.5, [])])
def test_poses_of_canopies_are_refused(rival: float, expected: list[str]) -> None:
    ground = survey(height=2.0, rival=rival)
    found = replace(posed(scatter(21, 0.5), ground=[ground]), scene=RADARS)
    assert refusing(found) == expected


@pytest.mark.parametrize(("apart_px", "expected"), [(5.1, ["bands apart"]), (4.9, [])])
def test_poses_of_bands_that_are_displaced_are_refused(
    apart_px: float, expected: list[str]
) -> None:
    displaced_bands = facts(band_shifts=[BandShift((1, 2), apart_px)])
    found = replace(posed(scatter(21, 0.5)), scene=scene(input=displaced_bands))
    assert refusing(found) == expected


@pytest.mark.parametrize(
    ("agreeing", "found", "rest", "expected"),
    [
        (7, survey(), None, []),
        (5, survey(), None, ["chance agreement", "small share of check points"]),
        (7, survey(38, part=11), None, ["part elsewhere"]),
        (7, survey(height=4.0, rival=3.5), None, ["second place nearby"]),
        (7, survey(height=1.9, rival=0.5), None, ["weak similarity"]),
        (7, survey(), leaving(survey(height=1.9, rival=1.0)), ["pixel-locked content"]),
    ],
)
def test_rules_of_registrations_judge_poses(
    agreeing: int, found: Survey, rest: Rest | None, expected: list[str]
) -> None:
    """About as many of 21 chips agree as at the worst correct real pose."""
    residuals = np.concatenate([scatter(agreeing, 1.5), fallen_beyond(21 - agreeing)])
    assert refusing(posed(residuals, found, rest=rest)) == expected


def test_smaller_chips_show_parts_too() -> None:
    found = posed(scatter(21, 0.5), fine=survey(38, part=11))
    assert refusing(found) == ["part elsewhere"]


@pytest.mark.parametrize(
    ("agreeing", "is_shift", "expected"),
    [(13, True, ["small share of check points"]), (14, True, []), (13, False, [])],
)
def test_more_than_half_of_the_chips_agree_on_a_pose_that_only_shifts(
    agreeing: int, is_shift: bool, expected: list[str]
) -> None:
    """Labels drawn into both arrays coincide only under such poses."""
    residuals = np.concatenate([scatter(agreeing, 0.5), np.full((25 - agreeing, 2), np.inf)])
    assert refusing(posed(residuals, is_shift=is_shift)) == expected


# The tolerance of 5 px over √2, times the 90 % radius of a normal distribution, 2.15: 7.6 px.
@pytest.mark.parametrize(("half_px", "expected"), [(3.9, []), (4.6, ["uncertain transform"])])
def test_heights_that_may_displace_a_pose_too_far_refuse_it(
    half_px: float, expected: list[str]
) -> None:
    """Heights from -h to h average h above the lowest: the ground lies anywhere within ± 2 h."""
    chips = replace(survey(), shifts_px=displaced(49, -half_px, half_px))
    assert refusing(posed(scatter(21, 0.5), chips)) == expected
    found = posed(scatter(21, 0.5), chips).held_out.accuracy.ce90_px
    assert found == pytest.approx(0.9 * 2 * half_px, rel=0.07)


@pytest.mark.parametrize(("apart_px", "expected"), [(2.4, []), (2.6, ["uncertain transform"])])
def test_chips_that_do_not_hold_a_pose_refuse_it(apart_px: float, expected: list[str]) -> None:
    """Five poses, each without a fifth of the chips, vary by √(4/5 · 4 · 5/4) = 2 times this."""
    off = apart_px * np.array([[1, 0], [-1, 0], [0, 1], [0, -1], [0, 0]])
    models = tuple(partial(np.add, one) for one in off * math.sqrt(5 / 4))
    assert refusing(posed(scatter(21, 0.5), fold_models=models)) == expected
