"""Every rule is tested by evidence that it alone refuses, and by evidence that it accepts."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from importlib import import_module
from itertools import chain
from pkgutil import iter_modules
from typing import Any

import numpy as np
import pytest
from evidences import (
    GOOD,
    GRID,
    PERHAPS,
    RADARS,
    TOWN,
    control,
    estimated,
    evidence,
    facts,
    fallen,
    fit_points,
    in_common,
    leaving,
    left_of_two_sensors,
    points,
    refinement,
    refusing,
    scatter,
    scene,
    survey,
    two_thirds,
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
from groundtie.masks.used import GROUND, SURFACE, MaskUsed
from groundtie.matching.band_shifts import BandShift
from groundtie.matching.contrast_signs import ContrastSigns
from groundtie.matching.parts import FarPlace
from groundtie.matching.shared_content import Sensors
from groundtie.pose.pose import Pose, PoseFound
from groundtie.registration import evidence as stages
from groundtie.registration import rules
from groundtie.registration.evidence import (
    Agreement,
    DateEvidence,
    ImagesEvidence,
    RegistrationEvidence,
    SearchEvidence,
)
from groundtie.registration.pose_verdict import PoseEvidence, PoseSurveyEvidence
from groundtie.registration.refinement import RefinementEvidence
from groundtie.registration.rules import RULES, Rule
from groundtie.registration.tie_point_evidence import TiePointEvidence
from groundtie.registration.verdict import refusals

RANK = (
    stages.TIE_POINTS,
    stages.BANDS,
    stages.IMAGES,
    stages.SEARCH,
    stages.ASSESSMENT,
    stages.POSE,
    stages.AGREEMENT,
    stages.ERROR,
    stages.SCENE,
    stages.SURVEY,
    stages.REFINEMENT,
    stages.SERIES,
)

ALL_RULES = tuple(chain.from_iterable(RULES.values()))

# Dense towns: in a radar image with speckle, and in one after speckle filtering.
SPECKLED = scene(facts(variation2=0.2, **TOWN))
ON_GROUND = MaskUsed(GROUND, "reference", 0.3, "as in a town")
OBLIQUE = scene(facts(variation2=0.2, **TOWN), facts(is_in_sensor_geometry=True))
DESPECKLED = scene(facts(is_known_radar=True, **TOWN))


def loose(by_px: float) -> Estimate:
    """Return an estimate that varies by slightly more than so much with each block of points."""
    shifts = [(side * by_px, 0.0) for side in (-1, 1)] * 3
    folds = tuple(partial(np.add, shift) for shift in shifts)
    return replace(estimated(fit_points()), fold_models=folds)


CONTROL = control((20, -9))


BEST = Pose(40.0)


def pose(height: float = 9.0, rival: float = 3.0, found: Pose = BEST) -> PoseEvidence:
    """Return the evidence of a pose beside the two best poses of an exhaustive search."""
    best = PoseFound(BEST, height), PoseFound(Pose(-70.0), rival)
    return PoseEvidence([PoseFound(found, height)], best, (200, 100))


def assessed(
    errors: np.ndarray, counted: int | None = None, **misses_px: float
) -> AssessmentEvidence:
    """Return the evidence of points with a number of inliers, and of matches back."""
    count = len(errors)
    inliers = np.arange(count) < (count if counted is None else counted)
    points = PointErrors(np.zeros((count, 2)), errors, np.ones(count, bool), inliers)
    return AssessmentEvidence("check points", points, 3.0, misses_px, math.nan)


def of_nine(agreeing: int) -> Agreement:
    """Return the agreement of nine points with a number of inliers."""
    return evidence(
        np.concatenate([scatter(agreeing, 0.3), np.full((9 - agreeing, 2), 9.0)])
    ).held_out


NOWHERE = np.array([[np.nan, 0.0]])


def stored(px: np.ndarray, errors: np.ndarray, kind: str = "affine") -> TiePointEvidence:
    """Return the evidence of stored tie points of a raster of 600 × 500 px."""
    return TiePointEvidence.of(points(px, errors, check=False), kind, GRID)


RANDOM = np.random.default_rng(7)
ANYWHERE = RANDOM.uniform(0, 499, (50, 2))


def bands_apart(px: float) -> ImagesEvidence:
    """Return the evidence of an input with two bands displaced by so much."""
    displaced = facts(band_shifts=[BandShift((1, 2), px)])
    return ImagesEvidence(scene(input=displaced), MaskUsed.none(""), 3.0)


# For each rule, evidence that it refuses, and evidence that it accepts.
EVIDENCE: dict[str, tuple[Any, Any]] = {
    # 50 points within n px of a line: 60 px are a tenth of 600 px.
    "tie points too near": (
        stored(ANYWHERE * [1, 0.001] + [0, 200], np.zeros((50, 2))),
        stored(ANYWHERE * [1, 0.02] + [0, 200], np.zeros((50, 2))),
    ),
    "tie points at random": (
        stored(ANYWHERE, RANDOM.uniform(0, 499, (50, 2)) - ANYWHERE),
        stored(ANYWHERE, 20 * RANDOM.normal(size=(50, 2))),
    ),
    "bands apart": (bands_apart(3.1), bands_apart(2.9)),
    "ground not found": (
        ImagesEvidence(DESPECKLED, MaskUsed(GROUND, "reference", 0.3, "as in a town"), 3.0),
        ImagesEvidence(SPECKLED, MaskUsed(GROUND, "reference", 0.3, "as in a town"), 3.0),
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
    "inconsistent ways": (assessed(GOOD, way=3.1), assessed(GOOD, way=2.9)),
    "pose by chance": (pose(height=4.9, rival=3.0), pose(height=5.1, rival=3.0)),
    "second pose": (pose(height=9.0, rival=5.7), pose(height=9.0, rival=5.5)),
    # Three degrees move the corners by 6 px, one degree by 2 px.
    "other pose": (pose(found=Pose(43.0)), pose(found=Pose(41.0))),
    "chance agreement": (evidence(np.zeros((2, 2))), evidence(np.zeros((3, 2)))),
    "small share of check points": (
        evidence(np.concatenate([scatter(14, 0.3), fallen(58)])),
        evidence(np.concatenate([scatter(20, 0.3), fallen(52)])),
    ),
    "exchanged roles": (
        evidence(GOOD, exchanged=of_nine(3)),
        evidence(GOOD, exchanged=of_nine(4)),
    ),
    "error at held-out points": (
        evidence(scatter(72, 0.9), max_error_px=1.0),
        evidence(scatter(72, 0.9), max_error_px=1.5),
    ),
    "uncertain transform": (evidence(GOOD, loose(2.0)), evidence(GOOD, loose(1.0))),
    "few points on the ground": (
        evidence(scatter(4, 0.3), mask=ON_GROUND, scene=OBLIQUE),
        evidence(scatter(5, 0.3), mask=ON_GROUND, scene=OBLIQUE),
    ),
    "surface model elsewhere": (
        evidence(GOOD, mask=MaskUsed(SURFACE, "reference", 0.3, "shows nothing", False)),
        evidence(GOOD, mask=MaskUsed(SURFACE, "reference", 0.3, "fits")),
    ),
    "town matched whole": (
        evidence(two_thirds(20), scene=PERHAPS),
        evidence(two_thirds(26), scene=PERHAPS),
    ),
    "part elsewhere": (
        evidence(GOOD, survey=survey(38, part=11)),
        evidence(GOOD, survey=survey(46, part=2)),
    ),
    "stripes elsewhere": (
        evidence(GOOD, survey=survey(), stripes=FarPlace(3.6, 6.1, (0.0, 9.0))),
        evidence(GOOD, survey=survey(), stripes=FarPlace(3.8, 6.1, (0.0, 9.0))),
    ),
    "second place nearby": (
        evidence(GOOD, survey=survey(rival=6.5)),
        evidence(GOOD, survey=survey(rival=6.3)),
    ),
    "second place far off": (
        evidence(GOOD, survey=survey(), far=FarPlace(10.0, 8.1, (60.0, 0.0))),
        evidence(GOOD, survey=survey(), far=FarPlace(10.0, 7.9, (60.0, 0.0))),
    ),
    "weak similarity": (
        evidence(GOOD, survey=survey(height=1.9, rival=1.0)),
        evidence(GOOD, survey=survey(height=2.1, rival=1.0)),
    ),
    "pixel-locked content": (
        evidence(GOOD, survey=survey(), rest=leaving(survey(height=1.9, rival=1.0))),
        evidence(GOOD, survey=survey(), rest=leaving(survey(height=2.1, rival=1.0))),
    ),
    "unexplained elsewhere": (
        evidence(GOOD, survey=survey(), unexplained=survey(peak=6.1 / 7, peak_px=13)),
        evidence(GOOD, survey=survey(), unexplained=survey(peak=5.9 / 7, peak_px=13)),
    ),
    "one sign of contrast": (
        evidence(GOOD, survey=survey(), signs=ContrastSigns(0.6, 0.05)),
        evidence(GOOD, survey=survey(), signs=ContrastSigns(0.6, 0.07)),
    ),
    "rest elsewhere": (
        evidence(
            GOOD,
            survey=survey(),
            rest=in_common(Sensors.RADARS, survey(part=5, rival=7.0)),
        ),
        evidence(
            GOOD,
            survey=survey(),
            rest=in_common(Sensors.RADARS, survey(part=5, rival=5.0)),
        ),
    ),
    "nothing else in common": (
        evidence(GOOD, survey=survey(), rest=left_of_two_sensors(0.9, 0.8)),
        evidence(GOOD, survey=survey(), rest=left_of_two_sensors(0.8, 1.1)),
    ),
    "ground elsewhere": (
        evidence(GOOD, scene=RADARS, survey=survey(), ground=[survey(height=2.0, rival=1.7)]),
        evidence(GOOD, scene=RADARS, survey=survey(), ground=[survey(height=2.0, rival=1.5)]),
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


def test_evidence_stands_here_for_every_rule_and_for_no_other() -> None:
    assert list(EVIDENCE) == [rule.name for rule in ALL_RULES]


@pytest.mark.parametrize("rule", ALL_RULES, ids=lambda rule: rule.name)
def test_a_rule_refuses_what_it_is_for_and_no_other_does(rule: Rule) -> None:
    refused, _ = EVIDENCE[rule.name]
    assert refusing(refused) == [rule.name]
    decided = next(refusals(refused), None)
    assert decided is not None and decided[0] is rule
    assert decided[1] == rule.reason(refused) and len(decided[1]) > 10


@pytest.mark.parametrize("rule", ALL_RULES, ids=lambda rule: rule.name)
def test_a_rule_lets_pass_what_is_just_within_its_limit(rule: Rule) -> None:
    refused, passed = EVIDENCE[rule.name]
    assert type(refused) is type(passed)
    assert rule.name not in refusing(passed)
    # For a search, every failure is a refusal.
    assert rule in RULES[stages.SEARCH] or refusing(passed) == []


def test_every_rule_of_every_module_is_asked() -> None:
    modules = [
        import_module(f"{rules.__name__}.{one.name}") for one in iter_modules(rules.__path__)
    ]
    tuples = [value for one in modules for value in vars(one).values() if isinstance(value, tuple)]
    written = [item.name for one in tuples for item in one if isinstance(item, Rule)]
    assert sorted(written) == sorted(rule.name for rule in ALL_RULES)


def test_names_are_unique_and_stages_follow_one_another() -> None:
    names = [rule.name for rule in ALL_RULES]
    assert len(set(names)) == len(names)
    assert tuple(RULES) == RANK


@pytest.mark.parametrize("rule", ALL_RULES, ids=lambda rule: rule.name)
def test_a_rule_states_its_limit_its_source_and_what_to_try(rule: Rule) -> None:
    for text in (rule.name, rule.refuses, rule.source, rule.advice):
        assert text and text == text.strip() and not text.endswith(".")


def test_only_rules_of_the_evidence_are_asked() -> None:
    """Rules of agreement and error also judge refinements; those of scenes do not."""
    assert ImagesEvidence.stages == (stages.BANDS, stages.IMAGES)
    assert SearchEvidence.stages == (stages.SEARCH,)
    assert RegistrationEvidence.stages == (
        stages.BANDS,
        stages.IMAGES,
        stages.AGREEMENT,
        stages.ERROR,
        stages.SCENE,
        stages.SURVEY,
    )
    assert RefinementEvidence.stages == (stages.AGREEMENT, stages.ERROR, stages.REFINEMENT)
    assert PoseEvidence.stages == (stages.POSE,)
    assert PoseSurveyEvidence.stages == (
        stages.BANDS,
        stages.AGREEMENT,
        stages.ERROR,
        stages.SURVEY,
    )


def test_a_failure_that_is_no_refusal_decides_nothing() -> None:
    assert next(refusals(SearchEvidence(NotRegisteredError("refused elsewhere"))), None) is None
