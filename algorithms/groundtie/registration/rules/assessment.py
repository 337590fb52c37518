"""Rules on a registration that was made before, by points and ways back."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...geometry.judging import FEWEST_CHECK_POINTS, SMALLEST_INLIER_SHARE
from ..evidence import ASSESSMENT
from .rule import Rule

if TYPE_CHECKING:
    from ...assessment.accuracy import AssessmentEvidence


def _not_placed(evidence: AssessmentEvidence) -> str | None:
    lost = int((~evidence.points.placed).sum())
    if lost == 0:
        return None
    return f"the transform cannot place {lost} of {len(evidence.points)} {evidence.name}"


def _few_held_out(evidence: AssessmentEvidence) -> str | None:
    count = len(evidence.points)
    if count >= FEWEST_CHECK_POINTS:
        return None
    return f"{count} {evidence.name} are too few to measure anything"


def _few_inliers(evidence: AssessmentEvidence) -> str | None:
    points = evidence.held_out
    fewest = max(FEWEST_CHECK_POINTS, SMALLEST_INLIER_SHARE * points.total)
    # Too few points are another rule's.
    if points.total < FEWEST_CHECK_POINTS or points.agreeing >= fewest:
        return None
    return f"only {points.agreeing} of {points.total} {points.name} agree"


def _inconsistent(evidence: AssessmentEvidence) -> str | None:
    for name, miss in evidence.misses_px.items():
        if miss > evidence.max_error_px:
            return f"{name} inconsistency is {miss:.2f} px, above {evidence.max_error_px:g} px"
    return None


ASSESSMENT_RULES: tuple[Rule, ...] = (
    Rule(
        "points not placed",
        ASSESSMENT,
        "the transform cannot place a held-out point",
        "definition of a transform of the scene",
        "give the transform of this image, and points inside its area",
        _not_placed,
    ),
    Rule(
        "few held-out points",
        ASSESSMENT,
        f"there are fewer than {FEWEST_CHECK_POINTS} held-out points",
        "three points always agree on an affine model",
        "give more points that took no part in the fit",
        _few_held_out,
    ),
    Rule(
        "few held-out inliers",
        ASSESSMENT,
        f"fewer than {FEWEST_CHECK_POINTS} held-out points, or less than "
        f"{SMALLEST_INLIER_SHARE:.0%} of them, are inliers",
        "suites simulated and real",
        "give points that are measured in both images",
        _few_inliers,
    ),
    Rule(
        "inconsistent ways",
        ASSESSMENT,
        "a way there and back by other transforms misses its start by more than the largest error",
        "the user's largest error; [Suri2010] 2.5.3",
        "find out which of the transforms is wrong by points",
        _inconsistent,
    ),
)
