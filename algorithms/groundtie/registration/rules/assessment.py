"""Rules on an existing registration, judged by points and by ways back."""

from __future__ import annotations

from typing import TYPE_CHECKING

from .rule import Rule

if TYPE_CHECKING:
    from ...assessment.accuracy import AssessmentEvidence


def _not_placed(evidence: AssessmentEvidence) -> str | None:
    lost = int((~evidence.points.placed).sum())
    if lost == 0:
        return None
    return f"the transform cannot place {lost} of {len(evidence.points)} {evidence.name}"


def _inconsistent(evidence: AssessmentEvidence) -> str | None:
    for name, miss in evidence.misses_px.items():
        if miss > evidence.max_error_px:
            return f"{name} inconsistency is {miss:.2f} px, above {evidence.max_error_px:g} px"
    return None


ASSESSMENT_RULES: tuple[Rule, ...] = (
    Rule(
        "points not placed",
        "the transform cannot place a held-out point",
        "definition of a transform of the scene",
        "give the transform of this image, and points inside its area",
        _not_placed,
    ),
    Rule(
        "inconsistent ways",
        "a way there and back by other transforms misses its start by more than the largest error",
        "the user's largest error; [Suri2010] 2.5.3",
        "find out which of the transforms is wrong by points",
        _inconsistent,
    ),
)
