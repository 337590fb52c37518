"""Rules on the error of a registration or of refined RPCs, and on how well points hold it."""

from __future__ import annotations

from ..evidence import ERROR, RegistrationEvidence
from ..refinement_evidence import RefinementEvidence
from .rule import Rule


def _large_error(evidence: RegistrationEvidence | RefinementEvidence) -> str | None:
    points = evidence.held_out
    if not points.rmse_px > points.max_error_px:
        return None
    return f"error at {points.name} is {points.rmse_px:.2f} px, above {points.max_error_px:g} px"


def _loose_model(evidence: RegistrationEvidence | RefinementEvidence) -> str | None:
    points = evidence.held_out
    if points.spread_px <= points.max_error_px:
        return None
    spread = f"{points.spread_px:.2f} px over {points.area}"
    return f"the points do not hold the model: it varies by {spread}"


ERROR_RULES: tuple[Rule, ...] = (
    Rule(
        "error at held-out points",
        ERROR,
        "the root mean square error of held-out inliers is above the largest error",
        "the user's largest error",
        "give a more flexible model, or ask for less",
        _large_error,
    ),
    Rule(
        "loose model",
        ERROR,
        "the model varies by more than the largest error if blocks of points are left out in turn",
        "jackknife; [Efron1993]",
        "give a simpler model, or a larger part of the scene",
        _loose_model,
    ),
)
