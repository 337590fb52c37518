"""Every rule has evidence that it refuses, alone, and evidence that it lets pass."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from importlib import import_module
from pkgutil import iter_modules
from typing import Any

import numpy as np
import pytest
from evidences import (
    GRID,
    RANGE,
    control,
    displaced,
    estimated,
    evidence,
    facts,
    fallen,
    fit_points,
    fit_with,
    points,
    refinement,
    scatter,
    scene,
    survey,
)

from groundtie.assessment.accuracy import AssessmentEvidence
from groundtie.assessment.point_errors import PointErrors
from groundtie.errors import (
    AmbiguousPlaceError,
    BandError,
    NothingFoundError,
    NotRegisteredError,
    TooFewPointsError,
)
from groundtie.geometry.estimation import Estimate
from groundtie.masks.choice import LAYER, REGIONS, SURFACE, THRESHOLD, MaskUsed
from groundtie.matching.pose_survey import PoseSurvey
from groundtie.matching.rest import Rest
from groundtie.matching.survey import Survey
from groundtie.pose.pose import Pose, PoseFound
from groundtie.registration import evidence as stages
from groundtie.registration import rules
from groundtie.registration.evidence import (
    RegistrationEvidence,
    SearchEvidence,
)
from groundtie.registration.layover import CHIPS_MEAN_OVER_SCATTER
from groundtie.registration.pose_verdict import PoseEvidence, PoseSurveyEvidence
from groundtie.registration.refinement_evidence import RefinementEvidence
from groundtie.registration.rules import RULES, Rule
from groundtie.registration.series_evidence import DateEvidence
from groundtie.registration.surface_masks import ModelFit
from groundtie.registration.tie_point_evidence import TiePointEvidence
from groundtie.registration.verdict import Evidence, first_refusal

GOOD = scatter(36, 0.4)
RANK = (
    stages.TIE_POINTS,
    stages.SEARCH,
    stages.ASSESSMENT,
    stages.POSE,
    stages.AGREEMENT,
    stages.ERROR,
    stages.SCENE,
    stages.LAYOVER,
    stages.SURVEY,
    stages.REFINEMENT,
    stages.SERIES,
)

# Dense towns: of a radar with speckle, of a radar whose speckle a filter took, of who knows what.
TOWN = {"strong_share": 0.25}
SPECKLED = scene(facts(variation2=0.2, **TOWN))
DESPECKLED = scene(facts(is_known_radar=True, **TOWN))
PERHAPS = scene(facts(**TOWN))


def masked(kind: str) -> MaskUsed:
    return MaskUsed(kind, "reference", 0.3, "as asked for")


def two_thirds(right: int) -> np.ndarray:
    """Return errors of 36 check points of which so many agree."""
    return np.concatenate([scatter(right, 0.4), fallen(36 - right)])


def beside(right: int, others: int) -> np.ndarray:
    """Return errors of check points of which some agree on a place 7 px off."""
    return np.concatenate([scatter(right, 0.3), scatter(others, 0.3) + [5.0, 5.0]])


def loose(by_px: float) -> Estimate:
    """Return an estimate that varies by so much, and a little more, with each block of points."""
    shifts = [(side * by_px, 0.0) for side in (-1, 1)] * 3
    folds = tuple(partial(np.add, shift) for shift in shifts)
    return replace(estimated(fit_points()), fold_models=folds)


CONTROL = control((20, -9))


BEST = Pose(40.0)


def pose(height: float = 9.0, rival: float = 3.0, found: Pose = BEST) -> PoseEvidence:
    """Return the evidence of a pose beside the two best ones of an exhaustive search."""
    best = PoseFound(BEST, height), PoseFound(Pose(-70.0), rival)
    return PoseEvidence([PoseFound(found, height)], best, (200, 100))


def assessed(
    errors: np.ndarray, counted: int | None = None, **misses_px: float
) -> AssessmentEvidence:
    """Return the evidence of points of which so many are inliers, and of ways back."""
    count = len(errors)
    inliers = np.arange(count) < (count if counted is None else counted)
    points = PointErrors(np.zeros((count, 2)), errors, np.ones(count, bool), inliers)
    return AssessmentEvidence("check points", points, 3.0, misses_px)


NOWHERE = np.array([[np.nan, 0.0]])
FEW = np.zeros((3, 2))


def stored(px: np.ndarray, errors: np.ndarray, kind: str = "affine") -> TiePointEvidence:
    """Return the evidence of stored tie points of a raster of 600 × 500 px."""
    return TiePointEvidence.of(points(px, errors, check=False), kind, GRID)


RANDOM = np.random.default_rng(7)
ANYWHERE = RANDOM.uniform(0, 499, (50, 2))


# Of each rule: evidence that it refuses, and evidence that it does not.
EVIDENCE: dict[str, tuple[Any, Any]] = {
    # 50 points within n px of a line: of 600 px, 60 px are a tenth.
    "tie points too near": (
        stored(ANYWHERE * [1, 0.001] + [0, 200], np.zeros((50, 2))),
        stored(ANYWHERE * [1, 0.02] + [0, 200], np.zeros((50, 2))),
    ),
    "tie points at random": (
        stored(ANYWHERE, RANDOM.uniform(0, 499, (50, 2)) - ANYWHERE),
        stored(ANYWHERE, 20 * RANDOM.normal(size=(50, 2))),
    ),
    "second place": (
        SearchEvidence(AmbiguousPlaceError("two places match about as well")),
        SearchEvidence(NothingFoundError("nothing in common was found")),
    ),
    "nothing in common": (
        SearchEvidence(NothingFoundError("nothing in common was found")),
        SearchEvidence(AmbiguousPlaceError("two places match about as well")),
    ),
    "too few points": (
        SearchEvidence(TooFewPointsError("only 3 chips could be matched")),
        SearchEvidence(BandError("there is no band 7")),
    ),
    "points not placed": (assessed(np.concatenate([GOOD, NOWHERE])), assessed(GOOD)),
    "few held-out points": (assessed(FEW[:2]), assessed(FEW)),
    "few held-out inliers": (assessed(GOOD, 8), assessed(GOOD, 30)),
    "inconsistent ways": (assessed(GOOD, way=3.1), assessed(GOOD, way=2.9)),
    "pose by chance": (pose(height=4.9, rival=3.0), pose(height=5.1, rival=3.0)),
    "second pose": (pose(height=9.0, rival=5.7), pose(height=9.0, rival=5.5)),
    # Three degrees move corners by 6 px, a degree by 2 px.
    "other pose": (pose(found=Pose(43.0)), pose(found=Pose(41.0))),
    "chance agreement": (evidence(np.zeros((2, 2))), evidence(np.zeros((3, 2)))),
    "small share of check points": (
        evidence(np.concatenate([scatter(14, 0.3), fallen(58)])),
        evidence(np.concatenate([scatter(20, 0.3), fallen(52)])),
    ),
    "another transform": (evidence(beside(15, 20)), evidence(beside(20, 16))),
    "error at held-out points": (
        evidence(scatter(72, 0.9), max_error_px=1.0),
        evidence(scatter(72, 0.9), max_error_px=1.5),
    ),
    "uncertain transform": (evidence(GOOD, loose(2.0)), evidence(GOOD, loose(1.0))),
    "too little ground": (
        evidence(GOOD, mask=MaskUsed(REGIONS, "reference", 0.08, "as in a dense town")),
        evidence(GOOD, mask=MaskUsed(REGIONS, "reference", 0.12, "as in a dense town")),
    ),
    "surface model elsewhere": (
        evidence(GOOD, mask=MaskUsed(SURFACE, "reference", 0.3, "shows nothing", False)),
        evidence(GOOD, mask=MaskUsed(SURFACE, "reference", 0.3, "fits")),
    ),
    "ground elsewhere": (
        evidence(GOOD, ground_shift_px=1.1),
        evidence(GOOD, ground_shift_px=0.9),
    ),
    "despeckled town": (evidence(GOOD, scene=DESPECKLED), evidence(GOOD, scene=SPECKLED)),
    "town matched whole": (
        evidence(two_thirds(20), scene=PERHAPS),
        evidence(two_thirds(26), scene=PERHAPS),
    ),
    "layover of check points": (
        evidence(np.concatenate([scatter(24, 0.3), displaced(20, 4, 10)]), layover_factor=3.0),
        evidence(np.concatenate([scatter(24, 0.3), displaced(10, 4, 10)]), layover_factor=3.0),
    ),
    "layover of fit points": (
        evidence(GOOD, estimated(fit_with(displaced(100, -2.5, 2.5))), layover_factor=3.0),
        evidence(GOOD, estimated(fit_with(displaced(100, -0.8, 0.8))), layover_factor=3.0),
    ),
    "part elsewhere": (
        evidence(GOOD, survey=survey(35, part=14)),
        evidence(GOOD, survey=survey(46, part=2)),
    ),
    "second place nearby": (
        evidence(GOOD, survey=survey(rival=6.5)),
        evidence(GOOD, survey=survey(rival=6.3)),
    ),
    "weak similarity": (
        evidence(GOOD, survey=survey(height=1.9, rival=1.0)),
        evidence(GOOD, survey=survey(height=2.1, rival=1.0)),
    ),
    "pixel-locked content": (
        evidence(GOOD, survey=survey(), rest=Rest(survey(height=1.9, rival=1.0))),
        evidence(GOOD, survey=survey(), rest=Rest(survey(height=2.1, rival=1.0))),
    ),
    "narrow control": (
        refinement(control((20, -9), corner=0.2), kind="shift"),
        refinement(control((20, -9), corner=0.4), kind="shift"),
    ),
    "not nearer than before": (
        refinement(control((0, 0)), control((0, 0), 15, noise_px=0.01, seed=1)),
        refinement(CONTROL, control((20, -9), 15, noise_px=0.01, seed=1)),
    ),
    "bias not folded": (
        refinement(CONTROL, folding_px=0.02),
        refinement(CONTROL, folding_px=0.005),
    ),
    "date not readable": (DateEvidence("no such file"), DateEvidence(links=1)),
    "date not linked": (
        DateEvidence(refusals=["nothing in common was found"], is_reached=False),
        DateEvidence(refusals=["nothing in common was found"], links=1),
    ),
    "loops do not close": (
        DateEvidence(links=1, rejected=1, open_loops=1, loops=1),
        DateEvidence(links=2, rejected=1, open_loops=1, loops=2, is_confirmed=True),
    ),
    "one way alone": (
        DateEvidence(links=1, is_refused_by_hub=True),
        DateEvidence(links=2, is_refused_by_hub=True, is_confirmed=True),
    ),
}


def refusing(found: Evidence) -> list[str]:
    """Return the names of all rules that refuse, whichever decides."""
    asked = [rule for rule in RULES if rule.stage in found.stages]
    return [rule.name for rule in asked if rule.reason(found) is not None]


def test_evidence_stands_here_for_every_rule_and_for_no_other() -> None:
    assert list(EVIDENCE) == [rule.name for rule in RULES]


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.name)
def test_a_rule_refuses_what_it_is_for_and_no_other_does(rule: Rule) -> None:
    refused, _ = EVIDENCE[rule.name]
    assert refusing(refused) == [rule.name]
    decided = first_refusal(refused)
    assert decided is not None and decided[0] is rule
    assert decided[1] == rule.reason(refused) and len(decided[1]) > 10


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.name)
def test_a_rule_lets_pass_what_is_just_within_its_limit(rule: Rule) -> None:
    refused, passed = EVIDENCE[rule.name]
    assert type(refused) is type(passed)
    assert rule.name not in refusing(passed)
    # Of a search, any failure is refused or no refusal.
    assert rule.stage == stages.SEARCH or refusing(passed) == []


def test_every_rule_of_every_module_is_asked() -> None:
    modules = [
        import_module(f"{rules.__name__}.{one.name}") for one in iter_modules(rules.__path__)
    ]
    tuples = [value for one in modules for value in vars(one).values() if isinstance(value, tuple)]
    written = [item.name for one in tuples for item in one if isinstance(item, Rule)]
    assert sorted(written) == sorted(rule.name for rule in RULES)


def test_names_are_unique_and_stages_follow_one_another() -> None:
    names = [rule.name for rule in RULES]
    assert len(set(names)) == len(names)
    ranks = [RANK.index(rule.stage) for rule in RULES]
    assert ranks == sorted(ranks)
    assert set(ranks) == set(range(len(RANK)))


@pytest.mark.parametrize("rule", RULES, ids=lambda rule: rule.name)
def test_a_rule_states_its_limit_its_source_and_what_to_try(rule: Rule) -> None:
    for text in (rule.name, rule.refuses, rule.source, rule.advice):
        assert text and text == text.strip() and not text.endswith(".")


def test_what_heights_may_displace_all_points_by_is_refused() -> None:
    """Chips that scatter evenly along a line by ± n px may be n px off, all of them."""

    def along(reach_px: float) -> RegistrationEvidence:
        seen = survey()
        return evidence(GOOD, survey=replace(seen, shifts_px=displaced(49, -reach_px, reach_px)))

    assert refusing(along(2.0)) == []
    assert refusing(along(3.5)) == ["uncertain transform"]


@pytest.mark.parametrize("folds", [0, 1, 5])
def test_a_transform_whose_error_is_unknown_is_refused(folds: int) -> None:
    """No model without a block, one alone, and models that have no values."""
    unknown = replace(
        estimated(fit_points()), fold_models=(lambda px: np.full(px.shape, np.nan),) * folds
    )
    assert "uncertain transform" in refusing(evidence(GOOD, unknown))


@pytest.mark.parametrize(
    ("more", "expected_px"),
    [({}, 6.0), ({"mask": masked(REGIONS)}, 3.0), ({"layover_factor": 3.0}, 6.0 * math.sqrt(3))],
)
def test_heights_that_spread_evenly_displace_by_their_width(
    more: dict[str, Any], expected_px: float
) -> None:
    """Chips that spread by ± 3 px along the range: the ground is the lowest, or the middle."""
    seen = replace(survey(), shifts_px=displaced(49, -3.0, 3.0))
    found = evidence(GOOD, survey=seen, **more).displacement_px
    assert np.hypot(*found) == pytest.approx(expected_px, rel=0.15)
    assert abs(found @ RANGE) == pytest.approx(np.hypot(*found), rel=0.01)


@pytest.mark.parametrize("kind", [REGIONS, LAYER, SURFACE])
def test_a_town_whose_ground_was_matched_is_not_suspected(kind: str) -> None:
    found = evidence(two_thirds(20), scene=PERHAPS, mask=masked(kind))
    assert "town matched whole" not in refusing(found)


def test_a_town_whose_ground_confirms_is_not_suspected() -> None:
    assert refusing(evidence(two_thirds(20), scene=PERHAPS, is_ground_checked=True)) == []


def test_an_image_of_fields_is_not_suspected() -> None:
    assert refusing(evidence(two_thirds(20), scene=scene())) == []


@pytest.mark.parametrize(
    ("fit", "reason"),
    [
        (ModelFit(0.4, (2, -2)), None),
        (ModelFit(0.4, (-3, 1)), "3.2 px off"),
        (ModelFit(0.08, (0, 0)), "the registered input does not show"),
    ],
)
def test_the_input_shows_elevated_objects_where_the_surface_model_has_them(
    fit: ModelFit, reason: str | None
) -> None:
    found = evidence(GOOD, mask=masked(SURFACE), input_fit=fit, max_error_px=3.0)
    decided = first_refusal(found)
    assert (decided is None) == (reason is None)
    assert decided is None or (reason is not None and reason in decided[1])


def test_ground_must_be_reliable_and_span_the_overlap() -> None:
    regions = MaskUsed(REGIONS, "reference", 0.3, "as in a dense town")
    assert refusing(evidence(GOOD, mask=regions)) == []
    doubted = replace(regions, is_reliable=False)
    assert refusing(evidence(GOOD, mask=doubted)) == ["too little ground"]
    narrow = estimated(fit_points(within=(0.6, 0.6)))
    assert refusing(evidence(GOOD, narrow, mask=regions)) == ["too little ground"]
    assert refusing(evidence(GOOD, narrow)) == []


@pytest.mark.parametrize(("agreeing", "expected"), [(4, ["too little ground"]), (5, [])])
def test_an_oblique_view_needs_more_check_points_on_the_ground(
    agreeing: int, expected: list[str]
) -> None:
    regions = MaskUsed(REGIONS, "reference", 0.3, "as in a dense town")
    oblique = scene(facts(variation2=0.25, strong_share=0.2), facts(is_in_sensor_geometry=True))
    errors = scatter(agreeing, 0.3)
    assert refusing(evidence(errors, mask=regions, scene=oblique)) == expected
    assert refusing(evidence(errors, mask=regions)) == []


@pytest.mark.parametrize("kind", [REGIONS, LAYER, SURFACE])
def test_little_ground_may_be_weakly_similar(kind: str) -> None:
    """A mask leaves little of each chip; other rules judge what it leaves."""
    weak = survey(height=1.9, rival=1.8)
    assert refusing(evidence(GOOD, survey=weak, mask=masked(kind))) == []
    assert refusing(evidence(GOOD, survey=weak)) == ["second place nearby", "weak similarity"]


def test_a_part_of_which_half_confirms_is_layover_not_a_part() -> None:
    found = survey(49, part=12)
    surfaces = found.surfaces.copy()
    surfaces[:12:2] = survey(49).surfaces[:12:2]
    assert refusing(evidence(GOOD, survey=replace(found, surfaces=surfaces))) == []


def test_without_locked_content_another_place_must_not_match_better() -> None:
    rest = survey(20, height=4.0, rival=5.0)
    found = evidence(GOOD, survey=survey(), rest=Rest(rest))
    assert refusing(found) == ["pixel-locked content"]


def test_without_locked_content_no_part_must_match_elsewhere() -> None:
    found = evidence(GOOD, survey=survey(), rest=Rest(survey(part=10)))
    assert refusing(found) == ["pixel-locked content"]


@pytest.mark.parametrize(("height", "expected"), [(8.9, []), (9.1, ["second place nearby"])])
def test_a_second_place_beneath_a_copy(height: float, expected: list[str]) -> None:
    found = replace(survey(), ghost_height=height)
    assert refusing(evidence(GOOD, survey=found)) == expected


@pytest.mark.parametrize(("part", "expected"), [(7, ["pixel-locked content"]), (2, [])])
def test_what_copies_leave_may_contradict(part: int, expected: list[str]) -> None:
    """It need not confirm the transform, as a cloud deck looks like a copy, but not another."""
    left = survey(3, part, height=6.0)
    found = evidence(GOOD, survey=survey(), rest=Rest(left, is_explained=True))
    assert refusing(found) == expected


@pytest.mark.parametrize(
    ("kind", "expected"),
    [(LAYER, []), (SURFACE, []), (REGIONS, ["despeckled town"]), (THRESHOLD, [])],
)
def test_a_layer_is_believed_where_there_is_no_speckle(kind: str, expected: list[str]) -> None:
    """Regions of a camera's image that pass for a radar's are no ground."""
    assert refusing(evidence(GOOD, scene=PERHAPS, mask=masked(kind))) == expected


def test_only_rules_of_the_evidence_are_asked() -> None:
    """Rules of agreement and error judge refinements, too; those of scenes do not."""
    assert SearchEvidence.stages == (stages.SEARCH,)
    assert RegistrationEvidence.stages == (
        stages.AGREEMENT,
        stages.ERROR,
        stages.SCENE,
        stages.LAYOVER,
        stages.SURVEY,
    )
    assert RefinementEvidence.stages == (stages.AGREEMENT, stages.ERROR, stages.REFINEMENT)
    assert PoseEvidence.stages == (stages.POSE,)
    assert PoseSurveyEvidence.stages == (stages.AGREEMENT, stages.LAYOVER, stages.SURVEY)


@pytest.mark.parametrize(
    ("agreeing", "found", "rest", "expected"),
    [
        (7, survey(), None, []),
        (5, survey(), None, ["small share of check points"]),
        (4, survey(), None, ["chance agreement", "small share of check points"]),
        (7, survey(35, part=14), None, ["part elsewhere"]),
        (7, survey(height=4.0, rival=3.5), None, ["second place nearby"]),
        (7, survey(height=1.9, rival=0.5), None, ["weak similarity"]),
        (7, survey(), Rest(survey(height=1.9, rival=1.0)), ["pixel-locked content"]),
    ],
)
def test_rules_of_registrations_judge_poses(
    agreeing: int, found: Survey, rest: Rest | None, expected: list[str]
) -> None:
    """Of 21 chips, about as many agree as at the worst real pose that is right."""
    errors = np.where(np.arange(21) < agreeing, 4.9, 5.1)
    residuals = np.column_stack([errors, np.zeros(21)])
    moved = estimated(fit_points()).transform
    assert refusing(PoseSurveyEvidence(PoseSurvey(residuals, found, rest, moved))) == expected


@pytest.mark.parametrize(
    ("residuals", "factor", "expected"),
    [
        (scatter(25, 0.5), CHIPS_MEAN_OVER_SCATTER, []),
        (
            np.concatenate([scatter(13, 0.5), displaced(12, 6, 12)]),
            CHIPS_MEAN_OVER_SCATTER,
            ["layover of check points"],
        ),
        (displaced(25, -2, 2), CHIPS_MEAN_OVER_SCATTER, ["layover of fit points"]),
        (displaced(25, -2, 2), None, []),
    ],
)
def test_poses_of_elevated_objects_are_refused(
    residuals: np.ndarray, factor: float | None, expected: list[str]
) -> None:
    """Between two radar images, canopies and roofs lie along a line beside the ground."""
    moved = estimated(fit_points()).transform
    found = PoseSurvey(residuals, survey(), None, moved)
    assert refusing(PoseSurveyEvidence(found, factor)) == expected


def test_a_failure_that_is_no_refusal_decides_nothing() -> None:
    assert first_refusal(SearchEvidence(NotRegisteredError("refused elsewhere"))) is None
