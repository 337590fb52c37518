"""Rules on how many held-out points agree: with a registration, new or old, or refined RPCs."""

from __future__ import annotations

from ...geometry.judging import (
    FEWEST_CHECK_POINTS,
    LARGEST_LOG10_CHANCE,
    SMALLEST_INLIER_SHARE,
    SMALLEST_SHARE_UNROTATED,
    TOLERANCE_PX,
)
from ..evidence import EvidenceOfPoints, RegistrationEvidence
from .rule import Rule


def _by_chance(evidence: EvidenceOfPoints) -> str | None:
    points = evidence.held_out
    if points.total < FEWEST_CHECK_POINTS:
        return f"{points.total} {points.name} are too few to measure anything"
    is_chance = points.log10_chance > LARGEST_LOG10_CHANCE
    if not is_chance and points.agreeing >= FEWEST_CHECK_POINTS:
        return None
    return f"{points.agreeing} of {points.total} {points.name} agree, as they may by chance"


def _few_agree(evidence: EvidenceOfPoints) -> str | None:
    points = evidence.held_out
    if points.agreeing >= points.least_share * points.total:
        return None
    return f"only {points.agreeing} of {points.total} {points.name} agree"


def _exchanged_roles(evidence: EvidenceOfPoints) -> str | None:
    if not isinstance(evidence, RegistrationEvidence) or evidence.exchanged is None:
        return None
    points = evidence.exchanged
    if points.log10_chance > LARGEST_LOG10_CHANCE:
        return (
            f"with reference and input exchanged, {points.agreeing} of {points.total} check points "
            "agree, as they may by chance"
        )
    if points.apart_px <= min(TOLERANCE_PX, evidence.max_error_px):
        return None
    return f"with reference and input exchanged, the transform lies {points.apart_px:.1f} px off"


AGREEMENT_RULES: tuple[Rule, ...] = (
    Rule(
        "chance agreement",
        f"fewer than {FEWEST_CHECK_POINTS} held-out points agree, or as many as agree would by "
        f"chance with a probability above 10^{LARGEST_LOG10_CHANCE:.0f}",
        "[Moisan2004]; suites crossings, city and attacks",
        "give a larger part of the scene, or more points that take no part in the fit",
        _by_chance,
    ),
    Rule(
        "small share of check points",
        f"less than {SMALLEST_INLIER_SHARE:.0%} of the held-out points agree, or of a pose that "
        f"neither rotates nor scales less than {SMALLEST_SHARE_UNROTATED:.0%}",
        "suites simulated, real and attacks",
        "mask clouds and changes; give bands, or points, that show the same",
        _few_agree,
    ),
    Rule(
        "exchanged roles",
        "check points would agree as well by chance with a probability above "
        f"10^{2 * LARGEST_LOG10_CHANCE:.0f}, no mask leaves the ground alone, and with reference "
        "and input exchanged they agree as they may by chance, or the transform lies farther off "
        f"than the largest error, or than {TOLERANCE_PX:g} px, within which points agree",
        "[Holden2000]; suite attacks",
        "give a larger part of the scene, or bands that show the same",
        _exchanged_roles,
    ),
)
