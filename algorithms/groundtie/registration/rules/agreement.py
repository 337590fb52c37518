"""Rules on how many held-out points agree with a registration or with refined RPCs."""

from __future__ import annotations

import numpy as np

from ...geometry.judging import (
    FEWEST_CHECK_POINTS,
    LARGEST_LOG10_CHANCE,
    SMALLEST_INLIER_SHARE,
    SMALLEST_SHARE_UNROTATED,
    TOLERANCE_PX,
)
from ...geometry.robust import distances, find_consensus
from ..evidence import AGREEMENT, RegistrationEvidence
from ..refinement_evidence import RefinementEvidence
from .rule import Rule

# Check points that agree on another transform within this distance make it a rival, if they are
# more by so many, as three always agree on an affine model and one or two more may by chance, and
# by this factor. Measured by the suites real and crossings.
_RIVAL_TOLERANCE_PX = 3.0
_RIVAL_POINTS = 3
_RIVAL_SHARE = 1.25


def _by_chance(evidence: RegistrationEvidence | RefinementEvidence) -> str | None:
    points = evidence.held_out
    is_chance = points.log10_chance > LARGEST_LOG10_CHANCE
    if not is_chance and points.agreeing >= FEWEST_CHECK_POINTS:
        return None
    return f"{points.agreeing} of {points.total} {points.name} agree, as they may by chance"


def _few_agree(evidence: RegistrationEvidence | RefinementEvidence) -> str | None:
    points = evidence.held_out
    if points.agreeing >= points.least_share * points.total:
        return None
    return f"only {points.agreeing} of {points.total} {points.name} agree"


def _another_transform(evidence: RegistrationEvidence | RefinementEvidence) -> str | None:
    if not isinstance(evidence, RegistrationEvidence):
        return None
    residuals = evidence.residuals_px
    if len(residuals) < _RIVAL_POINTS:
        return None
    own = int((np.hypot(*residuals.T) <= _RIVAL_TOLERANCE_PX).sum())
    px = evidence.grid.map_to_pixel(evidence.counted.reference_xy)
    rival = find_consensus(px, px + residuals, _RIVAL_TOLERANCE_PX)
    others = int((distances(rival, px, px + residuals) <= _RIVAL_TOLERANCE_PX).sum())
    if others < max(own + _RIVAL_POINTS, _RIVAL_SHARE * own):
        return None
    return f"{others} of {evidence.held_out.total} check points agree on another transform"


def _exchanged_roles(evidence: RegistrationEvidence | RefinementEvidence) -> str | None:
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
        AGREEMENT,
        f"fewer than {FEWEST_CHECK_POINTS} held-out points agree, or as many as agree would by "
        f"chance with a probability above 10^{LARGEST_LOG10_CHANCE:.0f}",
        "[Moisan2004]; suites crossings, city and attacks",
        "give a larger part of the scene: more check points then confirm it",
        _by_chance,
    ),
    Rule(
        "small share of check points",
        AGREEMENT,
        f"less than {SMALLEST_INLIER_SHARE:.0%} of the held-out points agree, or of a pose that "
        f"neither rotates nor scales less than {SMALLEST_SHARE_UNROTATED:.0%}",
        "suites simulated, real and attacks",
        "mask clouds and changes; give bands that show the same",
        _few_agree,
    ),
    Rule(
        "another transform",
        AGREEMENT,
        f"check points agree on another transform: {_RIVAL_POINTS} more than on this one, and "
        f"{_RIVAL_SHARE:g} times as many",
        "suites real and crossings",
        "give parts of a mosaic one by one, or a more flexible model",
        _another_transform,
    ),
    Rule(
        "exchanged roles",
        AGREEMENT,
        "check points would agree as well by chance with a probability above "
        f"10^{2 * LARGEST_LOG10_CHANCE:.0f}, no mask leaves the ground alone, and with reference "
        "and input exchanged they agree as they may by chance, or the transform lies farther off "
        f"than the largest error, or than {TOLERANCE_PX:g} px, within which points agree",
        "[Holden2000]; suite attacks",
        "give a larger part of the scene, or bands that show the same",
        _exchanged_roles,
    ),
)
