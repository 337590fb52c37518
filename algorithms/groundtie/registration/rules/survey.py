"""Rules of the scene on the survey: what chips all over the overlap match."""

from __future__ import annotations

from ...masks.choice import LAYER, REGIONS
from ...matching.chips import LEAST_HEIGHT
from ...matching.survey import LEAST_PROPORTION, LOG10_FALSE_ALARMS, SURVEY_RADIUS_PX
from ..evidence import SCENE, RegistrationEvidence
from .rule import WITHOUT, Rule

# What chips all over match elsewhere is a second place from this share of their similarity on.
# Measured on pairs that were registered right: up to 0.76 (suites real and attacks).
_RIVAL_HEIGHT = 0.85


def _part_elsewhere(evidence: RegistrationEvidence) -> str | None:
    parts = [] if evidence.survey is None else evidence.survey.parts
    evident = [part for part in parts if part.is_evident]
    if not evident:
        return None
    part = max(evident, key=lambda one: one.chips)
    distance = f"{part.distance_px:.1f} px off"
    return f"{part.chips} neighbouring chips in the {part.where} agree on a place {distance}"


def _second_place_nearby(evidence: RegistrationEvidence) -> str | None:
    survey = evidence.survey
    if survey is None or survey.rival_height < _RIVAL_HEIGHT * survey.height:
        return None
    return "moved elsewhere as a whole, chips all over match about as well"


def _weak(evidence: RegistrationEvidence) -> str | None:
    survey = evidence.survey
    if survey is None or evidence.mask.kind in (REGIONS, LAYER):
        return None
    if survey.height >= LEAST_HEIGHT:
        return None
    return (
        f"only {survey.confirming} of {len(survey.centres)} chips all over match where the "
        "transform has them, and the others no better than by chance"
    )


def _locked(evidence: RegistrationEvidence) -> str | None:
    rest = evidence.survey_of_rest
    if rest is None or (rest.is_confirming and rest.height > rest.rival_height):
        return None
    return (
        "both images have the same content at the same columns and rows; without it, only "
        f"{rest.confirming} of {len(rest.centres)} chips match where the transform has them"
    )


SURVEY_RULES: tuple[Rule, ...] = (
    Rule(
        "part elsewhere",
        SCENE,
        "neighbouring chips agree with each other on another place, too many for chance "
        f"(10^{LOG10_FALSE_ALARMS:.0f} such parts expected) and {LEAST_PROPORTION} for each that "
        "confirms the transform",
        "[Moisan2004]; suites real and attacks",
        "register the parts of a mosaic one by one; in a town, give a mask of the ground",
        _part_elsewhere,
    ),
    Rule(
        "second place nearby",
        SCENE,
        f"moved elsewhere as a whole, within {SURVEY_RADIUS_PX} px, chips all over match at least "
        f"{_RIVAL_HEIGHT:g} times as well",
        "suites real and attacks",
        "give a larger part of the scene, which shows more than what repeats",
        _second_place_nearby,
    ),
    Rule(
        "weak similarity",
        SCENE,
        "without a mask of the ground, chips all over are on average no more similar, where the "
        f"transform has them, than one may be anywhere by chance: {LEAST_HEIGHT:g} robust standard "
        "deviations",
        "expected maximum of the background of a similarity surface",
        "give images with less noise, or a larger pixel size for matching",
        _weak,
    ),
    Rule(
        "pixel-locked content",
        SCENE,
        "both images have the same content at the same columns and rows, such as labels or clouds, "
        "and what else they show does not confirm the transform",
        "suites real and attacks",
        WITHOUT,
        _locked,
    ),
)
