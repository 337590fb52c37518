"""Rules of the scene on the survey: what chips all over the overlap match."""

from __future__ import annotations

import math

from ...matching.parts import LEAST_EXCESS
from ...matching.rest import Rest
from ...matching.survey import SURVEY_RADIUS_PX, Survey
from ..evidence import SURVEY, RegistrationEvidence
from .rule import WITHOUT, Rule

# Chips all over are similar to a second place from this share on, and weakly similar below so many
# robust standard deviations. Measured on pairs that were registered right: up to 0.76, and from
# 2.2 on; on images with much noise that were registered wrong: 0.43 to 0.98, and 1.5 to 2.9 (suites
# real and attacks).
RIVAL_HEIGHT = 0.8
WEAK_HEIGHT = 2.0

# The same of what is left without what the columns and rows share, whose rims remain. Measured by
# the suite margins (--seeds 2 --sample 120): from 2.8 on, on shared pairs; of 27 wrong transforms
# one is higher than 1.5 by far, at 3.4.
WEAK_REST_HEIGHT = 2.5

# Of what is drawn over the images, soft rims and pieces in faint colours remain, too. Measured by
# the suites margins and attacks: over ground that lies elsewhere, up to 2.2 in 55 pairs and 5.2 in
# another; one ground in other colours leaves 10 to 23. What lies exactly is not asked for as much:
# a pair that was registered to one grid before leaves 4.4, clouds in other colours up to 7.7.
DRAWN_REST_HEIGHT = 8.0

# Of all this, a quarter of the chips must be left: of right transforms nine of ten are, of noise
# that two radar images share 2 of 49. Copies and one camera's views leave little; where as many
# have anything left, it must be so high: right transforms from 1.66 on; beneath clouds and snow up
# to 1.5, but for one at 1.8. Plain copies leave something of an eighth of the chips at most, clouds
# of 0.3 and more. Where edges are sharp and half of the chips are left, it must be as high as of
# other content: right ones from 2.53 on, clouds, snow and a reference that was blended in up to 2.2
# (suites margins and attacks).
WEAK_COPY_HEIGHT = 1.6
_LEAST_CHIPS, _MANY_CHIPS = 0.25, 0.5

# What the reference does not explain of a copy may not stand out elsewhere by so many robust
# standard deviations of its surfaces, if it is weak at the transform: right ones up to 4.3; ground
# that shows through copies, clouds and labels from 6.1 on (suites margins and attacks).
BEYOND_DEVIATIONS = 5.0

# What is left of one camera's views are tall buildings, whose layover differs alike: their parts
# must be so much higher elsewhere. Right ones up to 10.8, but for one at 12.7 and one at 17.5,
# beside labels; a wrong one 18.3 (suites margins and attacks).
LEAST_EXCESS_OF_COPIES = 11.0


def _part_elsewhere(evidence: RegistrationEvidence) -> str | None:
    if evidence.survey is None or not evidence.survey.parts:
        return None
    part = evidence.survey.parts[0]
    return f"{part.chips} chips around the {part.where} match {part.distance_px:.1f} px off"


def _second_place_nearby(evidence: RegistrationEvidence) -> str | None:
    survey = evidence.survey
    if survey is None or evidence.mask.is_ground or not _has_rival(survey):
        return None
    return "moved elsewhere as a whole, chips all over match about as well"


def _has_rival(survey: Survey) -> bool:
    return survey.rival_height >= RIVAL_HEIGHT * survey.height


def _weak(evidence: RegistrationEvidence) -> str | None:
    survey = evidence.survey
    if survey is None or evidence.mask.is_ground:
        return None
    if survey.height >= WEAK_HEIGHT:
        return None
    return (
        f"only {survey.confirming} of {len(survey.centres)} chips all over match where the "
        "transform has them, and all of them weakly"
    )


def _has_few_chips(rest: Rest) -> bool:
    return rest.survey.comparable < _LEAST_CHIPS * rest.chips


def _has_many_chips(left: Survey, rest: Rest) -> bool:
    return left.comparable >= _MANY_CHIPS * rest.chips


def least_height_of_copies(rest: Rest) -> float:
    """Return how high what a mask leaves of copies must be; -∞ where it is too little."""
    if _has_few_chips(rest):
        return -math.inf
    is_sharp = rest.has_sharp_edges and _has_many_chips(rest.survey, rest)
    return WEAK_REST_HEIGHT if is_sharp else WEAK_COPY_HEIGHT


def deviations_elsewhere(rest: Rest) -> float:
    """Return how far what a copy's reference does not explain stands out elsewhere.

    In robust standard deviations; 0 where it is strong, or highest, where the transform has it.
    """
    left = rest.beyond
    if left is None or not _has_many_chips(left, rest):
        return 0.0
    is_elsewhere = left.height < WEAK_REST_HEIGHT and _has_rival(left)
    return left.rival_deviations if is_elsewhere else 0.0


def _has_part(rest: Rest) -> bool:
    least = LEAST_EXCESS_OF_COPIES if rest.is_explained else LEAST_EXCESS
    return any(part.excess >= least for part in rest.survey.parts)


def _locked(evidence: RegistrationEvidence) -> str | None:
    """Ask of the rest what is asked of all; of copies and one camera's views little is left."""
    rest = evidence.rest
    if rest is None:
        return None
    survey = rest.survey
    if rest.is_explained:
        is_nothing = survey.height < least_height_of_copies(rest)
        is_unconfirmed = is_nothing or deviations_elsewhere(rest) >= BEYOND_DEVIATIONS
    else:
        least = DRAWN_REST_HEIGHT if rest.is_drawn else WEAK_REST_HEIGHT
        is_unconfirmed = _has_few_chips(rest) or survey.height < least or _has_rival(survey)
    if not (_has_part(rest) or is_unconfirmed):
        return None
    return (
        "without what both images show at the same columns and rows, only "
        f"{survey.confirming} of {len(survey.centres)} chips match where the transform has them"
    )


def _other_ground_in_a_band(evidence: RegistrationEvidence) -> str | None:
    for one in evidence.bands:
        if one.survey.is_elsewhere:
            return f"band {one.band} of the {one.image} alone matches elsewhere"
    return None


SURVEY_RULES: tuple[Rule, ...] = (
    Rule(
        "part elsewhere",
        SURVEY,
        "three chips or more match at one place elsewhere, all but the highest together "
        f"{LEAST_EXCESS:g} standard deviations of noise better than where the transform has each",
        "[Neill2012]; suites margins and attacks",
        "register the parts of a mosaic one by one; in a town, give a mask of the ground",
        _part_elsewhere,
    ),
    Rule(
        "second place nearby",
        SURVEY,
        "without a mask of the ground, chips all over match at least "
        f"{RIVAL_HEIGHT:g} times as well if all are moved elsewhere, within {SURVEY_RADIUS_PX} px",
        "suites real and attacks",
        "give a larger part of the scene, which shows more than what repeats",
        _second_place_nearby,
    ),
    Rule(
        "weak similarity",
        SURVEY,
        "without a mask of the ground, the mean similarity of chips all over, where the transform "
        f"has them, is below {WEAK_HEIGHT:g} robust standard deviations of one of them",
        "suites real and attacks",
        "give images with less noise, or a larger pixel size for matching",
        _weak,
    ),
    Rule(
        "pixel-locked content",
        SURVEY,
        "both images have the same content at the same columns and rows, such as labels or clouds, "
        "and without it less than a quarter of the chips is left, a part lies elsewhere, a second "
        f"place matches about as well, or the mean similarity is below {WEAK_REST_HEIGHT:g} "
        f"standard deviations, or {DRAWN_REST_HEIGHT:g} of what is sharper than ground in other "
        f"colours; of a copy, or one camera's views, below {WEAK_COPY_HEIGHT:g} if a quarter is "
        f"left, below {WEAK_REST_HEIGHT:g} with sharp edges if half is, or a part is "
        f"{LEAST_EXCESS_OF_COPIES:g} higher elsewhere, or what the reference does not explain of "
        f"it matches elsewhere, and stands out there by {BEYOND_DEVIATIONS:g}",
        "suites margins and attacks",
        WITHOUT,
        _locked,
    ),
    Rule(
        "band elsewhere",
        SURVEY,
        "bands of an image do not coincide, and in one alone chips all over together match "
        f"elsewhere {LEAST_EXCESS:g} standard deviations of noise better",
        "suite margins",
        "give the band that shows the ground, alone in a file",
        _other_ground_in_a_band,
    ),
)
