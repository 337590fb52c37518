"""Rules on the error of a transform or of refined RPCs, and on how well points determine it."""

from __future__ import annotations

from ..evidence import EvidenceOfPoints
from .rule import Rule


def _large_error(evidence: EvidenceOfPoints) -> str | None:
    points = evidence.held_out
    if not points.rmse_px > points.max_error_px:
        return None
    return f"error at {points.name} is {points.rmse_px:.2f} px, above {points.max_error_px:g} px"


def _uncertain(evidence: EvidenceOfPoints) -> str | None:
    points = evidence.held_out
    # Negated, so that NaN refuses: it is not known to be small.
    if not points.spread_px <= points.max_error_px:
        spread = f"{points.spread_px:.2f} px over {points.area}"
        return f"the points do not determine the model: it varies by {spread}"
    # Assessed transforms, whose fit is unknown, have no CE90: NaN passes.
    if not points.accuracy.ce90_px > points.largest_ce90_px:
        return None
    return (
        f"90 % of errors over {points.area} are expected within {points.accuracy.ce90_px:.2f} px "
        f"only, with what heights displace; {points.largest_ce90_px:.2f} px are allowed"
    )


ERROR_RULES: tuple[Rule, ...] = (
    Rule(
        "error at held-out points",
        "the root mean square error of held-out inliers is above the largest error",
        "the user's largest error",
        "give a more flexible model, or ask for less",
        _large_error,
    ),
    Rule(
        "uncertain transform",
        "the model varies by more than the largest error if blocks of points are left out in turn, "
        "or its CE90, which includes what heights may displace all points by, is above the CE90 "
        "that belongs to the largest error",
        "jackknife, [Efron1993]; [Mauchly1940]; [Mardia2000]; the user's largest error",
        "give a simpler model, or a larger part of the scene; in a town, give a mask of the ground",
        _uncertain,
    ),
)
