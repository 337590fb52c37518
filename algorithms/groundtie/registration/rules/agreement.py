"""Rules on how many held-out points agree with a registration, new or old, or refined RPCs."""

from __future__ import annotations

from ...geometry.judging import (
    FEWEST_CHECK_POINTS,
    LARGEST_LOG10_CHANCE,
    SMALLEST_INLIER_SHARE,
    SMALLEST_SHARE_UNROTATED,
)
from ..evidence import EvidenceOfPoints, RegistrationEvidence
from .rule import UNMASKED, Rule


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
    if points.log10_chance <= LARGEST_LOG10_CHANCE:
        return None
    exchanged = "with reference and input exchanged"
    if points.total == 0:
        return f"{exchanged}, the coarse search finds another place, or none"
    return (
        f"{exchanged}, {points.agreeing} of {points.total} check points agree, as they may by "
        "chance"
    )


AGREEMENT_RULES: tuple[Rule, ...] = (
    Rule(
        "chance agreement",
        f"fewer than {FEWEST_CHECK_POINTS} held-out points agree, or their agreement has a "
        f"probability by chance above 10^{LARGEST_LOG10_CHANCE:.0f}",
        "[Moisan2004]; suites crossings, city and attacks",
        "give a larger part of the scene or, with points of your own, more check points",
        _by_chance,
    ),
    Rule(
        "small share of check points",
        f"less than {SMALLEST_INLIER_SHARE:.0%} of the held-out points agree; less than "
        f"{SMALLEST_SHARE_UNROTATED:.0%} with a pose that neither rotates nor scales",
        "suites simulated, real and attacks",
        "mask clouds and changes; give bands, or points, that show the same",
        _few_agree,
    ),
    Rule(
        "exchanged roles",
        "the agreement of the check points has a probability by chance above "
        f"10^{2 * LARGEST_LOG10_CHANCE:.0f}, and check points that are matched with reference and "
        "input exchanged, around a coarse search of their own, agree no better than by chance. "
        f"Asked {UNMASKED}",
        "[Holden2000]; suite attacks",
        "give a larger part of the scene, or bands that show the same",
        _exchanged_roles,
    ),
)
