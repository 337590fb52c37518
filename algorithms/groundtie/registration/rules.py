"""The one list of rules by which registrations are refused.

A rule looks at evidence and returns why it refuses, in a sentence, or None. Its `stage` states
which kind of evidence it reads (see `evidence`); `verdict.judge` asks all rules of the evidence's
stages in their order, and the first one that refuses decides.

To add a rule, write a function and put a `Rule` in `RULES`. docs/method-verdict.md is made from
this list, and a test asks for evidence that triggers it and evidence that does not.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import AmbiguousPlaceError, NothingFoundError, TooFewPointsError
from ..geometry.judging import (
    FEWEST_CHECK_POINTS,
    LARGEST_LOG10_CHANCE,
    LOG10_CHANCE_ON_GROUND,
    SMALLEST_INLIER_SHARE,
    TOLERANCE_PX,
)
from ..geometry.robust import distances, find_consensus
from ..masks.choice import LAYER, REGIONS
from ..matching.survey import LEAST_PROPORTION, LOG10_FALSE_ALARMS, SURVEY_RADIUS_PX
from .evidence import (
    AGREEMENT,
    ASSESSMENT,
    ERROR,
    POSE,
    REFINEMENT,
    SCENE,
    SEARCH,
    TIE_POINTS,
    RegistrationEvidence,
    SearchEvidence,
)
from .layover import count_on_line, scatter_along_line_px
from .refinement_evidence import RefinementEvidence

if TYPE_CHECKING:
    from ..assessment.accuracy import AssessmentEvidence
    from .pose_verdict import PoseEvidence
    from .tie_point_evidence import TiePointEvidence

# Check points that agree on another transform within this distance make it a rival, if they are
# more by so many, as three always agree on an affine model and one or two more may by chance, and
# by this factor. Measured by the suites real and crossings.
_RIVAL_TOLERANCE_PX = 3.0
_RIVAL_POINTS = 3
_RIVAL_SHARE = 1.25

# What the ground shows of a fit that was not made on it: it is itself good to a pixel or two.
# Measured by the suite city.
_LARGEST_GROUND_SHIFT_PX = 1.0

# Less ground than this, or points over less of the overlap, does not hold a model. Measured on the
# seeds 1 to 12 of the suite rpc_city: accepted and more than 3 px wrong at 7 % of ground, and with
# 61 % extrapolated; right from 12 %, and up to 35 %.
_LEAST_GROUND_SHARE, _LARGEST_EXTRAPOLATED = 0.10, 0.5

# An oblique view displaces fit and check points alike: where four sums of check chips all agree, as
# in images of 700 px, the suite rpc_city has errors up to 6 px; with five and more, below 1 px.
_FEWEST_IN_SENSOR_GEOMETRY = 5

# Check points along a line, over those that agree: from here on it is open which are the ground.
# Measured on pairs that were registered right: up to 0.56; on others: from 0.78 (suite sar_sar).
_LAYOVER_SHARE = 2 / 3

# From this share of agreeing check points on, more agree than roofs alone do. Measured where a
# dense town was matched whole and a wrong registration accepted: 28 to 56 %; on other scenes with
# as many strong scatterers: from 72 % (suite city).
_CLEAR_SHARE = 2 / 3

# Chips all over are similar to a second place from this share on, and weakly similar below so many
# robust standard deviations. Measured on pairs that were registered right: up to 0.76, and from
# 2.2 on; on images with much noise that were registered wrong: 0.43 to 0.98, and 1.5 to 2.9 (suites
# real and attacks).
_RIVAL_HEIGHT = 0.8
_WEAK_HEIGHT = 2.0

# Control must spread over so much of each side of an image (suite rpc).
_SMALLEST_EXTENT = 0.25

# A pose: its height over chance, and over the best pose elsewhere. Measured on 29 real pairs (right
# poses: height ≥ 6.2, ratio ≥ 1.8) and 115 of different places (where the height passed: ratio ≤
# 1.45; suite rotated_pairs). It is that of the exhaustive search if it moves the corners
# by less than this share of its longer side.
_LEAST_HEIGHT = 5.0
_LEAST_RIVAL_RATIO = 1.6
_SAME_SHARE = 0.02

# A bias that is folded into new RPCs may be missed by so much, in pixels.
_LARGEST_FOLDING_PX = 0.01


# Stored tie points must hold a model so well that an error of 1 px changes the raster by no more
# than this share of its side: it would not look like itself.
_LARGEST_BORDER_SPREAD = 0.1


@dataclass(frozen=True)
class Rule:
    """A reason to refuse.

    Parameters
    ----------
    name
        What it is called in verdicts and in the documentation.
    stage
        Which kind of evidence it reads.
    refuses
        What it refuses, with its limit, for the documentation.
    source
        Where the limit comes from.
    advice
        What a user can do that is safe.
    reason
        Returns why it refuses, in a sentence; None: it does not.
    """

    name: str
    stage: str
    refuses: str
    source: str
    advice: str
    reason: Callable[[Any], str | None]


def _points_too_near(evidence: TiePointEvidence) -> str | None:
    spread = evidence.border_spread_px
    if spread <= _LARGEST_BORDER_SPREAD * evidence.side_px:
        return None
    if not np.isfinite(spread):
        return f"the tie points lie so that no {evidence.kind} model follows from them"
    return (
        f"the tie points lie so near to each other, or to a line, that an error of 1 px moves the "
        f"raster's border by {spread:.0f} px"
    )


def _points_at_random(evidence: TiePointEvidence) -> str | None:
    chance = evidence.log10_chance
    if chance is None or chance <= LARGEST_LOG10_CHANCE:
        return None
    return f"the {evidence.count} tie points fit each other no better than random ones"


def _ambiguous(evidence: SearchEvidence) -> str | None:
    failure = evidence.failure
    return str(failure) if isinstance(failure, AmbiguousPlaceError) else None


def _nothing_found(evidence: SearchEvidence) -> str | None:
    failure = evidence.failure
    is_none = isinstance(failure, NothingFoundError) and not isinstance(
        failure, AmbiguousPlaceError
    )
    return str(failure) if is_none else None


def _too_few_points(evidence: SearchEvidence) -> str | None:
    failure = evidence.failure
    return str(failure) if isinstance(failure, TooFewPointsError) else None


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


def _by_chance(evidence: RegistrationEvidence | RefinementEvidence) -> str | None:
    points = evidence.held_out
    is_chance = points.log10_chance > points.largest_log10_chance
    if not is_chance and points.agreeing >= FEWEST_CHECK_POINTS:
        return None
    return f"{points.agreeing} of {points.total} {points.name} agree, as they may by chance"


def _few_agree(evidence: RegistrationEvidence | RefinementEvidence) -> str | None:
    points = evidence.held_out
    if points.agreeing >= SMALLEST_INLIER_SHARE * points.total:
        return None
    return f"only {points.agreeing} of {points.total} {points.name} agree"


def _another_transform(evidence: RegistrationEvidence | RefinementEvidence) -> str | None:
    if isinstance(evidence, RefinementEvidence):
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


def _little_ground(evidence: RegistrationEvidence) -> str | None:
    mask = evidence.mask
    if mask.kind != REGIONS:
        return None
    if not mask.is_reliable:
        return "too few roads and banks were found to be the ground of a town"
    if mask.share < _LEAST_GROUND_SHARE:
        return f"only {mask.share:.0%} of the {mask.image} is ground that was found"
    agreeing = evidence.held_out.agreeing
    is_oblique = evidence.scene is not None and evidence.scene.input.is_in_sensor_geometry
    if is_oblique and agreeing < _FEWEST_IN_SENSOR_GEOMETRY:
        return f"only {agreeing} check points on the ground agree, where the view is oblique"
    if evidence.extrapolated_share > _LARGEST_EXTRAPOLATED:
        share = f"{evidence.extrapolated_share:.0%}"
        return f"{share} of the overlap lies beyond the ground that was matched"
    return None


def _ground_elsewhere(evidence: RegistrationEvidence) -> str | None:
    if evidence.ground_shift_px <= _LARGEST_GROUND_SHIFT_PX:
        return None
    return f"the ground alone matches {evidence.ground_shift_px:.1f} px elsewhere"


def _layover_of_check_points(evidence: RegistrationEvidence) -> str | None:
    if evidence.layover_factor is None:
        return None
    residuals = evidence.check.residual_on(evidence.grid, evidence.estimate.transform)
    agreeing = int((np.hypot(*residuals.T) <= TOLERANCE_PX).sum())
    on_line = count_on_line(residuals, evidence.radius_px)
    if on_line < max(_LAYOVER_SHARE * agreeing, 1):
        return None
    return (
        f"{on_line} of {len(residuals)} check points lie along a line beside the {agreeing} that "
        "agree, as layover displaces elevated objects"
    )


def _layover_of_fit_points(evidence: RegistrationEvidence) -> str | None:
    if evidence.layover_factor is None:
        return None
    used = evidence.estimate.points.take(evidence.estimate.points.used)
    scatter = scatter_along_line_px(used.residual_on(evidence.grid, evidence.estimate.transform))
    if evidence.layover_factor * scatter <= evidence.max_error_px:
        return None
    return (
        f"matched points scatter by {scatter:.1f} px along a line more than across it, as layover "
        "scatters heights"
    )


def _despeckled_town(evidence: RegistrationEvidence) -> str | None:
    kind = evidence.mask.kind
    if evidence.scene is None or kind == LAYER:
        return None
    if not evidence.scene.is_despeckled_town(masked_by_regions=kind == REGIONS):
        return None
    return "the radar image of a dense town has no speckle, by which its ground is found"


def _town_matched_whole(evidence: RegistrationEvidence) -> str | None:
    points = evidence.held_out
    is_ground = evidence.mask.kind in (REGIONS, LAYER) or evidence.is_ground_checked
    if evidence.scene is None or is_ground or points.agreeing >= _CLEAR_SHARE * points.total:
        return None
    if not evidence.scene.may_be_dense_town:
        return None
    return (
        f"only {points.agreeing} of {points.total} check points agree, as roofs may, and an image "
        "has as many strong scatterers as a radar's of a dense town"
    )


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
    if survey is None or evidence.mask.kind in (REGIONS, LAYER):
        return None
    if survey.rival_height < _RIVAL_HEIGHT * survey.height:
        return None
    return "moved elsewhere as a whole, chips all over match about as well"


def _weak(evidence: RegistrationEvidence) -> str | None:
    survey = evidence.survey
    if survey is None or evidence.mask.kind in (REGIONS, LAYER):
        return None
    if survey.height >= _WEAK_HEIGHT:
        return None
    return (
        f"only {survey.confirming} of {len(survey.centres)} chips all over match where the "
        "transform has them, and all of them weakly"
    )


def _locked(evidence: RegistrationEvidence) -> str | None:
    rest = evidence.survey_of_rest
    if rest is None or (rest.is_confirming and rest.height > rest.rival_height):
        return None
    return (
        "both images have the same content at the same columns and rows; without it, only "
        f"{rest.confirming} of {len(rest.centres)} chips match where the transform has them"
    )


def _narrow_control(evidence: RefinementEvidence) -> str | None:
    if evidence.extent >= _SMALLEST_EXTENT:
        return None
    share = f"{100 * evidence.extent:.0f} %"
    return f"the control points spread over {share} of a side of the image only"


def _not_nearer(evidence: RefinementEvidence) -> str | None:
    before, after = evidence.rms_before_px, evidence.rms_after_px
    if before > after:
        return None
    name = evidence.held_out.name
    return f"{name} are not nearer than before: {after:.2f} px, {before:.2f} px as delivered"


def _not_folded(evidence: RefinementEvidence) -> str | None:
    if evidence.folding_px <= _LARGEST_FOLDING_PX:
        return None
    return f"RPCs cannot take up the bias: they miss it by {evidence.folding_px:.3f} px"


def _no_pose(evidence: PoseEvidence) -> str | None:
    if not evidence.found:
        return "nothing in common was found"
    if evidence.rival_ratio is None:
        return "the images hold too little to judge by"
    if evidence.height < _LEAST_HEIGHT:
        return f"the best pose is no higher than chance ({evidence.height:.1f})"
    return None


def _second_pose(evidence: PoseEvidence) -> str | None:
    ratio = evidence.rival_ratio
    if ratio is None or ratio >= _LEAST_RIVAL_RATIO:
        return None
    return f"another pose matches about as well (1 : {1 / ratio:.2f})"


def _not_exhaustive(evidence: PoseEvidence) -> str | None:
    if evidence.apart_px <= _SAME_SHARE * max(evidence.shape):
        return None
    best = evidence.exhaustive[0].pose
    return (
        f"a search over all rotations prefers {best.rotation_deg:.1f}° and scale "
        f"{best.scale:.3f}, {evidence.apart_px:.0f} px away"
    )


def _locked_pose(evidence: PoseEvidence) -> str | None:
    if evidence.sameness is None or not evidence.sameness.is_evident:
        return None
    return "both images have the same content at the same columns and rows"


_WIDER = "check the band and the overlap; give a larger search radius, or allow rotation"
_WITHOUT = "give images, or masks, without what is drawn over the ground"
_GROUND = "give a mask of the ground, such as roads and waters"

RULES: tuple[Rule, ...] = (
    Rule(
        "tie points too near",
        TIE_POINTS,
        "an error of 1 px in stored tie points moves the border of the raster by more than "
        f"{_LARGEST_BORDER_SPREAD:.0%} of its longer side: they lie at one place or along a line",
        "leverage; [Hastie2009] 3.2",
        "give points all over the raster, or a simpler model",
        _points_too_near,
    ),
    Rule(
        "tie points at random",
        TIE_POINTS,
        "as many random points would fit the model as well with a probability above "
        f"10^{LARGEST_LOG10_CHANCE:.0f}",
        "expected false alarms; [Moisan2004]",
        "take out points that are wrong, or give those of this raster",
        _points_at_random,
    ),
    Rule(
        "second place",
        SEARCH,
        "a second place matches about as well as the best: half of its evidence (log10), or "
        "keypoints that agree on a second transform",
        "suite crossings and repetitive scenes",
        "give a larger part of the scene, or a matching pixel size that shows more than what "
        "repeats",
        _ambiguous,
    ),
    Rule(
        "nothing in common",
        SEARCH,
        "no place matches better than random ones would",
        "expected false alarms above 1; [Moisan2004]",
        _WIDER,
        _nothing_found,
    ),
    Rule(
        "too few points",
        SEARCH,
        "fewer points match, or agree, than the model needs",
        "number of parameters of the model",
        "give a larger part of the scene, or a simpler model",
        _too_few_points,
    ),
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
    Rule(
        "chance agreement",
        AGREEMENT,
        f"fewer than {FEWEST_CHECK_POINTS} held-out points agree, or as many as agree would by "
        f"chance with a probability above 10^{LARGEST_LOG10_CHANCE:.0f} "
        f"(10^{LOG10_CHANCE_ON_GROUND:.0f} where the ground of a dense town was matched)",
        "[Moisan2004]; suites crossings and city",
        "give a larger part of the scene: more check points then confirm it",
        _by_chance,
    ),
    Rule(
        "small share of check points",
        AGREEMENT,
        f"less than {SMALLEST_INLIER_SHARE:.0%} of the held-out points agree",
        "suites simulated and real",
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
    Rule(
        "too little ground",
        SCENE,
        "where the regions of a radar image were taken for its ground: too few roads and banks, "
        f"less than {_LEAST_GROUND_SHARE:.0%} of the image, points over less than "
        f"{1 - _LARGEST_EXTRAPOLATED:.0%} of the overlap, or, in an image with RPCs, fewer than "
        f"{_FEWEST_IN_SENSOR_GEOMETRY} check points that agree",
        "suite rpc_city",
        _GROUND,
        _little_ground,
    ),
    Rule(
        "ground elsewhere",
        SCENE,
        f"the ground of a dense town alone matches more than {_LARGEST_GROUND_SHIFT_PX:g} px from "
        "the transform",
        "suite city",
        _GROUND,
        _ground_elsewhere,
    ),
    Rule(
        "layover of check points",
        SCENE,
        "between two radar images, check points that disagree lie along one line, "
        f"{_LAYOVER_SHARE:.2f} times as many as agree",
        "suite sar_sar",
        _GROUND,
        _layover_of_check_points,
    ),
    Rule(
        "layover of fit points",
        SCENE,
        "between two radar images, points of the fit scatter so far along one line that heights "
        "displace the model by more than the largest error",
        "[Mauchly1940]; suite sar_sar",
        _GROUND,
        _layover_of_fit_points,
    ),
    Rule(
        "despeckled town",
        SCENE,
        "a radar image of a dense town has no speckle, by which its ground is found",
        "suite city",
        f"give the radar image unfiltered; {_GROUND}",
        _despeckled_town,
    ),
    Rule(
        "town matched whole",
        SCENE,
        f"less than {_CLEAR_SHARE:.0%} of the check points agree, an image may be a radar's of a "
        "dense town, and its ground did not confirm the transform",
        "suite city",
        f"if it is a town, give the radar image unfiltered; {_GROUND}",
        _town_matched_whole,
    ),
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
        "without a mask of the ground, chips all over match at least "
        f"{_RIVAL_HEIGHT:g} times as well if all are moved elsewhere, within {SURVEY_RADIUS_PX} px",
        "suites real and attacks",
        "give a larger part of the scene, which shows more than what repeats",
        _second_place_nearby,
    ),
    Rule(
        "weak similarity",
        SCENE,
        "without a mask of the ground, the mean similarity of chips all over, where the transform "
        f"has them, is below {_WEAK_HEIGHT:g} robust standard deviations of one of them",
        "suites real and attacks",
        "give images with less noise, or a larger pixel size for matching",
        _weak,
    ),
    Rule(
        "pixel-locked content",
        SCENE,
        "both images have the same content at the same columns and rows, such as labels or clouds, "
        "and what else they show does not confirm the transform",
        "suites real and attacks",
        _WITHOUT,
        _locked,
    ),
    Rule(
        "narrow control",
        REFINEMENT,
        f"control points spread over less than {_SMALLEST_EXTENT:.0%} of a side of the image",
        "suite rpc",
        "give control all over the image",
        _narrow_control,
    ),
    Rule(
        "not nearer than before",
        REFINEMENT,
        "held-out points are no nearer by the refined RPCs than by the delivered ones",
        "definition of a refinement",
        "keep the delivered RPCs",
        _not_nearer,
    ),
    Rule(
        "bias not folded",
        REFINEMENT,
        f"new RPCs miss the bias by more than {_LARGEST_FOLDING_PX:g} px",
        "a hundredth of a pixel is below what control measures",
        "give a simpler model of the bias",
        _not_folded,
    ),
    Rule(
        "pose by chance",
        POSE,
        f"the best rotation, scale and shift are less than {_LEAST_HEIGHT:g} robust standard "
        "deviations above chance",
        "suite rotated_pairs",
        _WIDER,
        _no_pose,
    ),
    Rule(
        "second pose",
        POSE,
        f"the best pose is less than {_LEAST_RIVAL_RATIO:g} times as high as the best one "
        "elsewhere",
        "suite rotated_pairs",
        "give a larger part of the scene, or limit rotation and scale to what is possible",
        _second_pose,
    ),
    Rule(
        "other pose",
        POSE,
        "an exhaustive search over all rotations finds another pose, whose corners are more than "
        f"{_SAME_SHARE:.0%} of the reference's longer side away",
        "suite rotated_pairs",
        "take the exhaustive search",
        _not_exhaustive,
    ),
    Rule(
        "pixel-locked pose",
        POSE,
        "a pose that only shifts the image lies where both have the same content at the same "
        "columns and rows, such as labels or clouds",
        "suite attacks",
        _WITHOUT,
        _locked_pose,
    ),
)
