"""Rules on the survey: where chips all over the overlap match."""

from __future__ import annotations

import math
from dataclasses import replace

from ...geometry.judging import RIVAL_HEIGHT
from ...matching.locked import EXACT_PX, NOMINAL_PX, WHOLE_TIMES_EXACT
from ...matching.parts import CANOPIES_PX, CANOPIES_SHARE, ELSEWHERE_PX, LEAST_EXCESS
from ...matching.shared_content import Sensors
from ...matching.survey import SURVEY_RADIUS_PX, Survey
from ...matching.surveys import LEAST_BY_ONE_WAY, LEAST_OF_REST, Rest, Surveys
from ...similarity.in_common import LEAST_BRIGHTER, MOVED_GROUND_SHARE
from ...similarity.unexplained import WINDOW_PX
from ..evidence import RegistrationEvidence
from .pose import LEAST_HEIGHT
from .rule import ON_GROUND, UNMASKED, WITHOUT, Rule

# Mean similarity of the chips, in robust standard deviations, below which they match weakly.
# Measured: from 2.2 on for correctly registered pairs, 1.5 to 2.9 for very noisy images that were
# registered wrongly (suites real and attacks).
WEAK_HEIGHT = 2.0

# Least share of the chips with enough valid pixels in both images. Without a mask, all have enough.
# On the ground of correctly registered cities, 22 of 57 and more have; on snow of one shape that
# was taken for the ground of a city, 4 of 37. Without pixel-locked content, nine of ten correct
# transforms keep a quarter; noise that two radar images share leaves 2 of 49. Copies and views of
# one camera may leave less, plain copies at most an eighth. If a quarter is left and edges are
# sharp, as those of clouds and snow of one shape, its similarity must reach the limit for other
# content (suites city, margins and attacks; tests of masks).
_LEAST_CHIPS = 0.25

# Height of a second place, in robust standard deviations of the similarity elsewhere. Beneath
# clouds, labels, patterns of noise and copies, ground that lies elsewhere has a peak of its own,
# however high that of the overlay is.
# Whole survey: correct transforms reach 11.6, through displaced canopies; one of twelve dense
# cities in pixels of 2 m has more. Most ground beneath overlays has 12.3 and more, some 10 to 12.
# Without pixel-locked content: correct transforms reach 4.4, or 8.6 to 14.3 where more is drawn at
# another place or an orchard repeats; wrong ones have 6.5 and more (suites real, calibration of
# large rural scenes, seeds 440-565, and attacks: controls --seeds 33000-33039, --seeds 72000-72029,
# once_wrong.txt).
# Input that the reference does not explain: 72 of 85 correct transforms are lower; the others have
# 6.1 and more, through content that repeats or is drawn at another place. This limit alone refuses
# two of them (suite margins, --seeds 87000-87029 --sample 120; none of one_grid).
PEAK_DEVIATIONS, REST_PEAK_DEVIATIONS = 12.0, 6.0

# The same without dark or bright pixels: correct transforms reach 6.1, of filtered radar images;
# wrong ones have 10.0 and more (suites real, and margins, --classes "shadows at another hour").
EVEN_PEAK_DEVIATIONS = 8.0

# Most similarity of stripes where the transform has them, as a share of that elsewhere. Furrows
# match a period off, too, and rows of roofs beside their ground. Of 117 correct transforms 5 have
# stripes of such height; two of radar images, whose canopies are displaced, are below this limit,
# and refused by parts, too. Of 31 wrong ones 13 have such stripes, and 8 are below (suite margins,
# --seeds 500000-500019 --sample 120, classes as in docs/measurements.md).
STRIPES_IN_PLACE = 0.6

# Nearer than this, roofs make such peaks under correct transforms, too: with 9 px instead, a suburb
# that is correct to 0.6 px is refused (suite attacks: images exchanged/0/sim-suburban/register/
# 33012). Views of one camera have few such roofs; other ground that a copy was blended into has a
# peak far above the higher limit (tests/matching/test_surveys.py).
_ROOFS_PX = 12.0


# Share of windows in which grey values correlate positively, and the most that correlate negatively
# relative to these. Of the real pairs that are asked, two reach this share: so-cloudy-sentinel has
# 0.33 times as many negative, dn-3, by day and night, 0.17 (suite margins).
LEAST_POSITIVE, MOST_NEGATIVE = 0.4, 0.1


def _part_elsewhere(evidence: RegistrationEvidence) -> str | None:
    parts = evidence.surveys.parts
    if not parts:
        return None
    part = parts[0]
    return (
        f"{part.chips} chips around the {part.where} match {part.distance_px:.1f} px off together"
    )


def _stripes_elsewhere(evidence: RegistrationEvidence) -> str | None:
    found = evidence.surveys.stripes
    if found is None or found.height < REST_PEAK_DEVIATIONS:
        return None
    if found.own_height >= STRIPES_IN_PLACE * found.height:
        return None
    return f"stripes of the input match {found.distance_px:.0f} px off together"


def _second_place_nearby(evidence: RegistrationEvidence) -> str | None:
    survey = evidence.surveys.whole
    if survey is None:
        return None
    if deviations_elsewhere(survey) >= PEAK_DEVIATIONS:
        return "chips all over match at a second place, too, if all of them are moved together"
    if evidence.mask.leaves_little or not _has_rival(survey):
        return None
    return "chips all over match about as well if all of them are moved together to a second place"


def _second_place_far_off(evidence: RegistrationEvidence) -> str | None:
    far = evidence.surveys.far
    if far is None or far.height < LEAST_HEIGHT or not far.is_rival:
        return None
    return f"the images match about as well {far.distance_px:.0f} px off as a whole"


def _one_sign(evidence: RegistrationEvidence) -> str | None:
    signs, rest = evidence.surveys.signs, evidence.surveys.rest
    if signs is None or signs.positive < LEAST_POSITIVE:
        return None
    if signs.negative > MOST_NEGATIVE * signs.positive:
        return None
    if rest is not None and rest.shared.moves_as_ground:
        return None
    return (
        f"bright and dark areas coincide in {signs.positive:.0%} of windows and are opposite in "
        f"{signs.negative:.0%}, as of one layer drawn over a radar and a camera image"
    )


def _has_rival(survey: Survey) -> bool:
    return survey.rival_height >= RIVAL_HEIGHT * survey.height


def deviations_elsewhere(survey: Survey) -> float:
    """Return the height of a second place, in robust deviations of the similarity elsewhere.

    Unless it is about as high as the transform's own place, it must be a peak.
    """
    height = survey.rival_height if _has_rival(survey) else survey.second_peak
    return height / survey.deviation_elsewhere


def _weak(evidence: RegistrationEvidence) -> str | None:
    survey = evidence.surveys.whole
    if survey is None:
        return None
    chips = len(survey.centres)
    if has_few_chips(survey, chips):
        return f"only {survey.comparable} of {chips} chips overlap with the registered input"
    if evidence.mask.leaves_little or survey.height >= WEAK_HEIGHT:
        return None
    return (
        f"only {survey.confirming} of {chips} chips all over confirm the transform, "
        "all of them weakly"
    )


def has_few_chips(survey: Survey, chips: int) -> bool:
    """Whether too few of the chips have enough valid pixels to be evidence."""
    return survey.comparable < _LEAST_CHIPS * chips


def _confirms(left: Survey, rest: Rest) -> bool:
    if has_few_chips(left, rest.chips):
        return rest.shared.is_explained
    is_elsewhere = _has_rival(left) or deviations_elsewhere(left) >= REST_PEAK_DEVIATIONS
    return left.height >= WEAK_HEIGHT and not is_elsewhere


def _locked(evidence: RegistrationEvidence) -> str | None:
    """Judge the survey without shared content; copies and views of one camera may leave little."""
    rest = evidence.surveys.rest
    if rest is None or not rest.shared.is_evident:
        return None
    if rest.shared.is_noise:
        return "both radar images have the same pattern of noise, finer than ground"
    if rest.shared.is_drawn:
        return "both images have the same drawn edges, sharper than the ground's or side by side"
    left = rest.survey
    if left is None or _confirms(left, rest):
        return None
    return (
        "without the content that both images share pixel by pixel, only "
        f"{left.confirming} of {len(left.centres)} chips confirm the transform"
    )


def deviations_of_unexplained(surveys: Surveys, from_px: float = _ROOFS_PX) -> float:
    """Return the height of a second place of the input that the reference does not explain.

    It lies farther off than `from_px`. 0 if too few chips are left, as of copies.
    """
    left = surveys.unexplained
    if left is None or has_few_chips(left, len(left.centres)):
        return 0.0
    return deviations_elsewhere(replace(left, elsewhere_px=max(left.elsewhere_px, from_px)))


def _unexplained_elsewhere(evidence: RegistrationEvidence) -> str | None:
    surveys = evidence.surveys
    is_view = surveys.rest is not None and surveys.rest.shared.is_explained
    is_elsewhere = deviations_of_unexplained(surveys) >= REST_PEAK_DEVIATIONS
    is_nearby = is_view and deviations_of_unexplained(surveys, ELSEWHERE_PX) >= PEAK_DEVIATIONS
    if not (is_elsewhere or is_nearby):
        return None
    return "the part of the input that the reference does not explain matches elsewhere"


def deviations_of_rest(rest: Rest | None) -> float:
    """Return the height of a second place of two radar images without their shared content.

    0 unless the whole has a rival and a part lies elsewhere, too: under correct transforms, walls
    and canopies now and then cause one or the other.
    """
    if rest is None or rest.shared.is_evident or rest.shared.sensors is not Sensors.RADARS:
        return 0.0
    left = rest.survey
    if left is None or not (_has_rival(left) and left.parts):
        return 0.0
    return deviations_elsewhere(left)


def _rest_elsewhere(evidence: RegistrationEvidence) -> str | None:
    if deviations_of_rest(evidence.surveys.rest) < REST_PEAK_DEVIATIONS:
        return None
    return "without the content that both images share, chips all over match elsewhere"


def height_of_else(rest: Rest | None) -> float:
    """Return the mean similarity of chips without the content that both images share.

    Of the surveys without shared windows and without shared edges, the higher; of what may be
    clouds, whose soft edges hardly coincide, the former. Infinite if neither was made, or what two
    radar images share is no brighter than the rest.
    """
    if rest is None or not rest.shared.may_be_drawn:
        return math.inf
    ways = [rest.survey, rest.without_edges]
    if rest.shared.sameness.may_be_clouds and rest.survey is not None:
        ways = [rest.survey]
    elif rest.shared.sensors is Sensors.RADARS:
        return math.inf
    return max((left.height for left in ways if left is not None), default=math.inf)


def _nothing_else(evidence: RegistrationEvidence) -> str | None:
    rest = evidence.surveys.rest
    height = height_of_else(rest)
    if evidence.mask.leaves_little or rest is None or height >= rest.least:
        return None
    return (
        "without the content that both images share pixel by pixel, chips all over hardly match: "
        f"{height:.1f} standard deviations"
    )


def _ground_elsewhere(evidence: RegistrationEvidence) -> str | None:
    sensors = evidence.scene.sensors
    least = EVEN_PEAK_DEVIATIONS if sensors is Sensors.CAMERAS else REST_PEAK_DEVIATIONS
    rivals = filter(_has_rival, evidence.surveys.ground)
    if all(deviations_elsewhere(survey) < least for survey in rivals):
        return None
    is_open = sensors is Sensors.RADARS
    ground = "between forests and settlements" if is_open else "outside of shadows and roofs"
    return f"the ground {ground} matches elsewhere"


SURVEY_RULES: tuple[Rule, ...] = (
    Rule(
        "part elsewhere",
        "three neighbouring chips or more match better at one other place than where the transform "
        f"has them: all but the highest together by {LEAST_EXCESS:g} standard deviations of noise. "
        f"Or chips that hardly match where it has them, {CANOPIES_SHARE:.1%} or more, together "
        f"match more than {CANOPIES_PX:g} px and up to a quarter of the longer side off, by "
        f"{LEAST_EXCESS:g} robust standard deviations better; in a radar image, chips of open "
        "ground alone",
        "[Neill2012]; suites margins and attacks",
        "register the parts of a mosaic one by one; in a town, give a mask of the ground",
        _part_elsewhere,
        is_final=True,
    ),
    Rule(
        "stripes elsewhere",
        "the 30% of lines, in one of 30 directions, whose edges agree least together match more "
        f"than {ELSEWHERE_PX:g} px off, by {REST_PEAK_DEVIATIONS:g} robust standard deviations, "
        f"and less than {STRIPES_IN_PLACE:g} times as well where the transform has them. Not asked "
        "of rendered images",
        "suites real, one_grid and attacks",
        "register what is of one date or pass by itself; in a town, give a mask of the ground",
        _stripes_elsewhere,
        is_final=True,
    ),
    Rule(
        "second place nearby",
        f"the mean surface of chips all over has, within {SURVEY_RADIUS_PX} px, a second peak of "
        f"{PEAK_DEVIATIONS:g} robust standard deviations; or, {UNMASKED}, "
        f"a place elsewhere that is at least {RIVAL_HEIGHT:g} times as high",
        "suites real and attacks",
        "give a larger part of the scene, which shows more than what repeats or is drawn over it",
        _second_place_nearby,
        is_final=True,
    ),
    Rule(
        "second place far off",
        f"the orientation of edges of the whole overlap matches, more than {SURVEY_RADIUS_PX} px "
        "and up to a quarter of its longer side off, at least "
        f"{RIVAL_HEIGHT:g} times as well, and by {LEAST_HEIGHT:g} robust standard deviations, as "
        f"poses above chance do. Asked {UNMASKED}, and not of rendered images; poses are compared "
        "with others by *second pose*",
        "suites real, rotated_pairs and attacks",
        "give a larger part of the scene, which shows more than what repeats or is drawn over it",
        _second_place_far_off,
        is_final=True,
    ),
    Rule(
        "weak similarity",
        f"less than {_LEAST_CHIPS:.0%} of chips all over overlap with the input where the "
        f"transform has them; or, {UNMASKED}, their mean similarity there is below "
        f"{WEAK_HEIGHT:g} robust standard deviations of one surface",
        "suites real and attacks",
        "give images with less noise, a mask that leaves more, or a larger pixel size for matching",
        _weak,
        is_final=True,
    ),
    Rule(
        "pixel-locked content",
        "both images have the same content, pixel by pixel, such as labels or clouds. Its edges "
        "are sharper than edges of the ground, or lie beside one another. Or it is a pattern of "
        "noise in two radar images, whose fine structure is more coherent than their coarse "
        "structure. Or, without it, less than a quarter of the chips is left, their mean "
        f"similarity is below {WEAK_HEIGHT:g} robust standard deviations, or a second place "
        f"matches about as well or is a peak of {REST_PEAK_DEVIATIONS:g}. Copies and views of one "
        "camera are refused only if edges are sharp, and a quarter of the chips is left that is as "
        "weak or has such a place. Camera images that are displaced as ground is, by more than "
        f"{NOMINAL_PX:g} px on the map and {WHOLE_TIMES_EXACT * EXACT_PX:g} px from whole pixels, "
        f"may have sharp edges if {MOVED_GROUND_SHARE:.0%} of the rest varies alike",
        "suites margins and attacks",
        WITHOUT,
        _locked,
        is_final=True,
    ),
    Rule(
        "unexplained elsewhere",
        "the input, without what a line through the grey values of both images explains in windows "
        f"of {WINDOW_PX} px, correlates in phase with the reference at a second place: a peak of "
        f"{REST_PEAK_DEVIATIONS:g} robust standard deviations more than {_ROOFS_PX:g} px off, or, "
        f"for copies and views of one camera, of {PEAK_DEVIATIONS:g} nearer. Not asked of an image "
        "in the geometry of its sensor, over which no map layer lies",
        "[Kuglin1975]; suites margins, one_grid and attacks",
        WITHOUT,
        _unexplained_elsewhere,
        is_final=True,
    ),
    Rule(
        "one sign of contrast",
        "between a radar and a camera image, grey values of blocks of 4 × 4 px correlate "
        f"positively in {LEAST_POSITIVE:.0%} of chips or more, and negatively in less than "
        f"{MOST_NEGATIVE:g} times as many, as in a layer that is drawn over both. Asked if the "
        "images are such by metadata or speckle, also if a layer has halved its coefficient of "
        f"variation, and displaced as layers are: up to {NOMINAL_PX:g} px on the map, or up to "
        f"{WHOLE_TIMES_EXACT * EXACT_PX:g} px off whole pixels. Not of images that a tool takes "
        "for one kind",
        "suites real and attacks",
        f"{WITHOUT}; if both images are a radar's, use match_sar_sar, if both are a camera's, "
        "match_optical",
        _one_sign,
        is_final=True,
    ),
    Rule(
        "rest elsewhere",
        "between two radar images, without the content that both have pixel by pixel, "
        "a second place matches about as well, and "
        f"{REST_PEAK_DEVIATIONS:g} robust standard deviations better than usual, and a part lies "
        "elsewhere",
        "suites margins and attacks",
        WITHOUT,
        _rest_elsewhere,
        is_final=True,
    ),
    Rule(
        "nothing else in common",
        "the mean similarity of chips all over is below "
        f"{LEAST_OF_REST:g} robust standard deviation of one surface, both without windows that "
        "vary alike and without the surroundings of edges that coincide; if what varies alike is "
        f"brighter by {LEAST_BRIGHTER:g} standard deviations, as clouds are, without these windows "
        f"alone. Below {LEAST_BY_ONE_WAY:g} of two radar images, in the latter case only, and, "
        "without edges, of two camera images in which hardly anything varies alike. Asked "
        f"{UNMASKED}, and not of copies and views of one camera",
        "suites real, margins and attacks",
        WITHOUT,
        _nothing_else,
        is_final=True,
    ),
    Rule(
        "ground elsewhere",
        "what is neither forest nor settlement in two radar images, or not dark or not bright in "
        "two camera images, as cast shadows and roofs are, matches elsewhere about as well, and by "
        f"{REST_PEAK_DEVIATIONS:g} robust standard deviations, of camera images "
        f"{EVEN_PEAK_DEVIATIONS:g}, better than usual",
        "suites calibration and margins",
        ON_GROUND,
        _ground_elsewhere,
    ),
)
