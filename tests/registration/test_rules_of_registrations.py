"""Rules on registrations: the joint effect of several facts."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from evidences import (
    CAMERAS,
    DRAWN_OVER,
    GOOD,
    PERHAPS,
    RADARS,
    RANGE,
    VIEWS,
    displaced,
    estimated,
    evidence,
    facts,
    fit_points,
    in_common,
    leaving,
    left_of_two_sensors,
    masked,
    refusing,
    scatter,
    scene,
    survey,
    two_thirds,
)
from scipy.stats import binom

from groundtie.masks.used import GROUND, LAYER, NONE, SURFACE, MaskUsed
from groundtie.matching.band_shifts import BandShift
from groundtie.matching.contrast_signs import ContrastSigns
from groundtie.matching.parts import LEAST_EXCESS, Part
from groundtie.matching.shared_content import Sensors
from groundtie.matching.survey import SURVEY_RADIUS_PX, Survey
from groundtie.registration.evidence import Evidence, ImagesEvidence, RegistrationEvidence
from groundtie.registration.scene import SceneInfo
from groundtie.registration.surface_masks import RENDERED_CORRELATION, ModelFit
from groundtie.registration.verdict import refusals
from groundtie.similarity.in_common import Sameness


def test_what_heights_may_displace_all_points_by_is_refused() -> None:
    """If chips scatter evenly along a line by ± n px, all of them may be wrong by n px."""

    def along(reach_px: float) -> RegistrationEvidence:
        seen = survey()
        return evidence(GOOD, survey=replace(seen, shifts_px=displaced(49, -reach_px, reach_px)))

    assert refusing(along(2.0)) == []
    assert refusing(along(3.5)) == ["uncertain transform"]


@pytest.mark.parametrize(("elevated_px", "expected"), [(2.0, []), (2.3, ["uncertain transform"])])
def test_what_elevated_objects_displace_all_points_by_is_refused(
    elevated_px: float, expected: list[str]
) -> None:
    """90 % of normal errors lie within 2.15 standard deviations; a limit of 3 px allows 4.55 px."""
    whole = MaskUsed(NONE, None, 1.0, "as in a town", elevated_px=elevated_px)
    assert refusing(evidence(GOOD, mask=whole, max_error_px=3.0)) == expected


@pytest.mark.parametrize(
    ("images", "height", "where"),
    [
        (RADARS, 2.0, "between forests"),
        (CAMERAS, 1.5, "outside of shadows and roofs"),
        (CAMERAS, 1.35, None),
    ],
)
def test_a_refusal_names_the_ground_that_lies_elsewhere(
    images: SceneInfo, height: float, where: str | None
) -> None:
    """The mean of 49 chips of noise deviates by 1/7: 1.1 are 7.7 and 1.25 are 8.7 deviations."""
    ground = survey(height=height, rival=height - 0.25)
    found = list(refusals(evidence(GOOD, scene=images, survey=survey(), ground=[ground])))
    assert [rule.name for rule, _ in found] == ["ground elsewhere"] * (where is not None)
    assert where is None or where in found[0][1]


def test_a_weak_survey_of_ground_does_not_hide_what_another_shows() -> None:
    """Of 7 deviations and far above the transform's own place; of 8.7, and little below it."""
    weak, clear = survey(height=0.1, rival=1.0), survey(height=1.5, rival=1.25)
    for ground, expected in (([weak], []), ([weak, clear], ["ground elsewhere"])):
        found = evidence(GOOD, scene=CAMERAS, survey=survey(), ground=ground)
        assert refusing(found) == expected


@pytest.mark.parametrize("folds", [0, 1, 5])
def test_a_transform_whose_error_is_unknown_is_refused(folds: int) -> None:
    """No model without a block, a single one, and models without values."""
    unknown = replace(
        estimated(fit_points()), fold_models=(lambda px: np.full(px.shape, np.nan),) * folds
    )
    assert "uncertain transform" in refusing(evidence(GOOD, unknown))


@pytest.mark.parametrize(
    ("more", "expected_px"),
    [({}, 6.0), ({"mask": masked(GROUND)}, 3.0), ({"layover_factor": 3.0}, 6.0 * math.sqrt(3))],
)
def test_heights_that_spread_evenly_displace_by_their_width(
    more: dict[str, Any], expected_px: float
) -> None:
    """Chips that spread by ± 3 px along the range: the ground is the lowest, or the middle."""
    seen = replace(survey(), shifts_px=displaced(49, -3.0, 3.0))
    found = evidence(GOOD, survey=seen, **more).error.common.heights_px
    assert np.hypot(*found) == pytest.approx(expected_px, rel=0.15)
    assert abs(found @ RANGE) == pytest.approx(np.hypot(*found), rel=0.01)


@pytest.mark.parametrize("kind", [GROUND, LAYER, SURFACE])
def test_a_town_whose_ground_was_matched_is_not_suspected(kind: str) -> None:
    found = evidence(two_thirds(20), scene=PERHAPS, mask=masked(kind))
    assert "town matched whole" not in refusing(found)


@pytest.mark.parametrize(("alike", "expected"), [(0.4, []), (0.2, ["town matched whole"])])
def test_images_that_vary_as_one_sensors_are_no_radars(alike: float, expected: list[str]) -> None:
    sameness = replace(DRAWN_OVER, area=0.1, reduced_area=alike, coarse_area=alike)
    found = evidence(two_thirds(20), scene=PERHAPS, rest=leaving(sameness=sameness))
    assert refusing(found) == expected


@pytest.mark.parametrize(("off_drawn", "is_refused"), [(0.9, True), (1.1, False)])
def test_contrast_of_one_sign_is_suspected_where_layers_lie(
    off_drawn: float, is_refused: bool
) -> None:
    rest = in_common(Sensors.DIFFERENT, survey())
    rest = replace(rest, shared=replace(rest.shared, off_drawn=off_drawn))
    found = evidence(GOOD, survey=survey(), rest=rest, signs=ContrastSigns(0.6, 0.0))
    assert ("one sign of contrast" in refusing(found)) == is_refused


def test_an_image_of_fields_is_not_suspected() -> None:
    assert refusing(evidence(two_thirds(20), scene=scene())) == []


@pytest.mark.parametrize(
    ("fit", "reason"),
    [
        (ModelFit(0.4, (2, -2)), None),
        (ModelFit(0.4, (-3, 1)), "3.2 px off"),
        (ModelFit(0.08, (0, 0)), "the registered input does not show"),
        (ModelFit(0.45, (0, 0), RENDERED_CORRELATION), None),
        (ModelFit(0.35, (0, 0), RENDERED_CORRELATION), "the registered input does not show"),
    ],
)
def test_the_input_shows_elevated_objects_where_the_surface_model_has_them(
    fit: ModelFit, reason: str | None
) -> None:
    found = evidence(GOOD, mask=masked(SURFACE), input_fit=fit, max_error_px=3.0)
    decided = next(refusals(found), None)
    assert (decided is None) == (reason is None)
    assert decided is None or (reason is not None and reason in decided[1])


@pytest.mark.parametrize(
    ("agreeing", "has_colours", "expected"),
    [
        (4, False, ["few points on the ground"]),
        (5, False, []),
        (3, True, ["few points on the ground"]),
        (4, True, []),
    ],
)
def test_an_oblique_view_needs_more_check_points_on_the_ground(
    agreeing: int, has_colours: bool, expected: list[str]
) -> None:
    ground = MaskUsed(GROUND, "reference", 0.3, "as in a town")
    camera = facts(is_in_sensor_geometry=True, has_colours=has_colours)
    oblique = scene(facts(variation2=0.25, strong_share=0.2), camera)
    assert refusing(evidence(scatter(agreeing, 0.3), mask=ground, scene=oblique)) == expected


@pytest.mark.parametrize("kind", [GROUND, LAYER, SURFACE])
def test_little_ground_may_be_weakly_similar(kind: str) -> None:
    """A mask leaves little of each chip; other rules judge the rest."""
    weak = survey(height=1.9, rival=1.6)
    assert refusing(evidence(GOOD, survey=weak, mask=masked(kind))) == []
    assert refusing(evidence(GOOD, survey=weak)) == ["second place nearby", "weak similarity"]


@pytest.mark.parametrize("masks", [{}, {"mask": masked(GROUND)}])
def test_a_quarter_of_the_chips_must_overlap_where_the_transform_has_them(
    masks: dict[str, MaskUsed],
) -> None:
    def of(overlapping: int) -> Survey:
        found = survey(height=20.0)
        surfaces = found.surfaces.copy()
        surfaces[overlapping:] = 0
        return replace(found, surfaces=surfaces)

    assert refusing(evidence(GOOD, survey=of(12), **masks)) == ["weak similarity"]
    assert refusing(evidence(GOOD, survey=of(13), **masks)) == []


def test_parts_are_chips_that_do_not_confirm_between_others_that_do() -> None:
    """Every other one of eleven in two rows: diagonals connect them, but the sixth is isolated."""
    found = survey(49, part=11)
    surfaces = found.surfaces.copy()
    surfaces[:11:2] = survey(49).surfaces[:11:2]
    survey_of_tiles = replace(found, surfaces=surfaces)
    assert refusing(evidence(GOOD, survey=survey_of_tiles)) == ["part elsewhere"]
    assert survey_of_tiles.parts[0].members == (1, 3, 7, 9)


def test_without_locked_content_the_place_must_match() -> None:
    found = evidence(GOOD, survey=survey(), rest=leaving(survey(20, height=1.9, rival=1.0)))
    assert refusing(found) == ["pixel-locked content"]


def test_without_locked_content_another_place_must_not_match_better() -> None:
    found = evidence(GOOD, survey=survey(), rest=leaving(survey(20, height=4.0, rival=5.0)))
    assert refusing(found) == ["pixel-locked content"]


def test_of_what_is_drawn_nothing_that_is_left_is_evidence() -> None:
    """Soft rims match, too, so the rest is not surveyed, however high the whole survey is."""
    rest = leaving(sameness=replace(DRAWN_OVER, sharpness=3.0))
    found = evidence(GOOD, survey=survey(height=20.0), rest=rest)
    assert refusing(found) == ["pixel-locked content"]


@pytest.mark.parametrize(("chips", "is_refused"), [(200, True), (190, False)])
def test_a_quarter_of_the_chips_must_be_left_to_confirm(chips: int, is_refused: bool) -> None:
    """A few chips are high by chance; 49 remain."""
    found = evidence(GOOD, survey=survey(), rest=leaving(survey(49), chips=chips))
    assert refusing(found) == ["pixel-locked content"] * is_refused


def test_what_one_cameras_views_leave_may_lie_elsewhere_in_parts() -> None:
    """Tall buildings do, as their layover differs."""
    left = survey(3, part=5, height=6.0)
    assert left.parts
    rest = leaving(left, VIEWS)
    assert refusing(evidence(GOOD, survey=survey(), rest=rest)) == []


@pytest.mark.parametrize(
    ("height", "rival", "part", "is_refused"),
    [(0.5, 1.0, 5, True), (1.1, 1.0, 5, True), (2.0, 1.0, 5, False), (0.5, 1.0, 0, False)],
)
def test_what_two_views_have_not_in_common_must_not_match_elsewhere(
    height: float, rival: float, part: int, is_refused: bool
) -> None:
    """Walls are a second place, canopies are parts; drawn content over ground leaves both."""
    left = survey(part=part, height=height, rival=rival)
    left.surfaces[:part, SURVEY_RADIUS_PX - 5, SURVEY_RADIUS_PX + 9] = 6.0
    found = evidence(GOOD, survey=survey(), rest=in_common(Sensors.RADARS, left))
    assert refusing(found) == ["rest elsewhere"] * is_refused


@pytest.mark.parametrize(
    ("heights", "masks", "is_refused"),
    [
        ((0.9, 0.9), {}, True),
        ((1.1, 0.9), {}, False),
        ((1.1,), {}, False),
        ((0.9, 1.1), {}, False),
        ((0.9, 0.9), {"mask": masked(GROUND)}, False),
    ],
)
def test_what_two_sensors_have_in_common_is_not_all_that_matches(
    heights: tuple[float, ...], masks: dict[str, MaskUsed], is_refused: bool
) -> None:
    """The rest without windows or without edges must match; a town's ground is exempt."""
    found = evidence(GOOD, survey=survey(), rest=left_of_two_sensors(*heights), **masks)
    assert refusing(found) == ["nothing else in common"] * is_refused


@pytest.mark.parametrize(
    ("brighter", "height", "is_refused"),
    [(0.81, 0.9, True), (0.79, 0.9, False), (-0.9, 0.9, False), (0.81, 1.1, False)],
)
def test_soft_edges_of_clouds_are_no_reason_to_accept(
    brighter: float, height: float, is_refused: bool
) -> None:
    """Without its few coinciding edges a cloud is all there; without its windows it is not."""
    rest = left_of_two_sensors(height, 4.0, brighter=brighter)
    found = evidence(GOOD, survey=survey(), rest=rest)
    assert refusing(found) == ["nothing else in common"] * is_refused


@pytest.mark.parametrize(
    ("brighter", "height", "is_refused"),
    [(0.81, 0.49, True), (0.79, 0.49, False), (0.81, 0.51, False)],
)
def test_what_is_brighter_in_two_radar_images_is_not_all_that_matches(
    brighter: float, height: float, is_refused: bool
) -> None:
    """Speckle and what is drawn leave hardly anything; bright ground leaves more."""
    left = survey(height=height, rival=0.1)
    rest = in_common(Sensors.RADARS, left, brighter=brighter)
    found = evidence(GOOD, survey=survey(), rest=rest)
    assert refusing(found) == ["nothing else in common"] * is_refused


@pytest.mark.parametrize(("height", "is_refused"), [(0.49, True), (0.51, False)])
def test_a_thin_watermark_is_not_all_that_matches(height: float, is_refused: bool) -> None:
    """So little varies alike that only the edges are left out."""
    rest = replace(in_common(Sensors.CAMERAS, survey()), survey=None)
    rest = replace(rest, without_edges=survey(height=height, rival=0.1))
    found = evidence(GOOD, survey=survey(), rest=rest)
    assert refusing(found) == ["nothing else in common"] * is_refused


@pytest.mark.parametrize(
    ("chips", "height", "is_refused"),
    [(49, 1.9, True), (49, 2.1, False), (190, 1.9, True), (200, 1.9, False)],
)
def test_a_quarter_of_the_chips_that_copies_leave_must_show_something(
    chips: int, height: float, is_refused: bool
) -> None:
    """One cloud deck over two grounds leaves no match; a plain copy leaves few chips."""
    rest = leaving(survey(height=height, rival=0.2), VIEWS, chips=chips)
    found = evidence(GOOD, survey=survey(), rest=rest)
    assert refusing(found) == ["pixel-locked content"] * is_refused


# The standard deviation of the mean surface of 49 chips is a seventh.
@pytest.mark.parametrize("masks", [{}, {"mask": masked(GROUND)}])
@pytest.mark.parametrize(("peak", "is_refused"), [(11.9 / 7, False), (12.1 / 7, True)])
def test_a_second_peak_is_other_ground_however_high_the_first_is(
    peak: float, is_refused: bool, masks: dict[str, MaskUsed]
) -> None:
    found = evidence(GOOD, survey=survey(height=40.0, peak=peak), **masks)
    assert refusing(found) == ["second place nearby"] * is_refused


@pytest.mark.parametrize("sameness", [DRAWN_OVER, VIEWS])
@pytest.mark.parametrize(("peak", "is_refused"), [(5.9 / 7, False), (6.1 / 7, True)])
def test_what_is_left_must_have_no_second_peak(
    peak: float, is_refused: bool, sameness: Sameness
) -> None:
    found = evidence(GOOD, survey=survey(), rest=leaving(survey(peak=peak), sameness))
    assert refusing(found) == ["pixel-locked content"] * is_refused


# Within 12 px there are roofs and canopies, of which one camera's views leave little.
@pytest.mark.parametrize(
    ("peak_px", "deviations", "sameness", "is_refused"),
    [
        (13, 5.9, None, False),
        (13, 6.1, None, True),
        (9, 20.0, None, False),
        (9, 11.9, VIEWS, False),
        (9, 12.1, VIEWS, True),
        (13, 6.1, VIEWS, True),
    ],
)
def test_what_is_not_explained_must_not_lie_elsewhere(
    peak_px: int, deviations: float, sameness: Sameness | None, is_refused: bool
) -> None:
    left = survey(height=1.7, rival=0.0, peak=deviations / 7, peak_px=peak_px)
    rest = None if sameness is None else leaving(None, sameness)
    found = evidence(GOOD, survey=survey(), rest=rest, unexplained=left)
    assert refusing(found) == ["unexplained elsewhere"] * is_refused


@pytest.mark.parametrize("noise", [0.1, 6.0])
def test_a_peak_of_what_is_not_explained_stands_out_of_its_noise(noise: float) -> None:
    left = survey(height=2.0, rival=0.0, peak=2.0, peak_px=13)
    drawn = noise * np.random.default_rng(3).normal(size=left.surfaces.shape)
    surfaces = np.where(left.surfaces == 0, drawn, left.surfaces).astype(np.float32)
    found = evidence(GOOD, survey=survey(), unexplained=replace(left, surfaces=surfaces))
    assert refusing(found) == ["unexplained elsewhere"] * (noise < 1)


@pytest.mark.parametrize(("chips", "is_refused"), [(12, False), (13, True)])
def test_of_copies_too_little_is_left_that_is_not_explained(chips: int, is_refused: bool) -> None:
    """A rest in few of 49 windows is an effect of resampling."""
    left = survey(height=1.0, rival=0.0, peak=6.0, peak_px=13)
    left.surfaces[chips:] = 0
    found = evidence(GOOD, survey=survey(), unexplained=left)
    assert refusing(found) == ["unexplained elsewhere"] * is_refused


@pytest.mark.parametrize(
    ("kind", "expected"),
    [(LAYER, []), (SURFACE, []), (GROUND, ["ground not found"])],
)
def test_a_layer_is_believed_where_there_is_no_speckle(kind: str, expected: list[str]) -> None:
    despeckled = scene(facts(is_known_radar=True, strong_share=0.25))
    assert refusing(ImagesEvidence(despeckled, masked(kind), 3.0)) == expected
    assert refusing(evidence(GOOD, scene=despeckled, mask=masked(kind))) == expected


@pytest.mark.parametrize(
    ("variation2", "has_pixel_size", "expected"),
    [(0.2, True, []), (0.2, False, ["ground not found"])],
)
def test_the_ground_of_a_town_is_not_found_in_pixels_of_unknown_size(
    variation2: float, has_pixel_size: bool, expected: list[str]
) -> None:
    town = facts(variation2, strong_share=0.25, has_pixel_size=has_pixel_size)
    assert refusing(ImagesEvidence(scene(town), masked(NONE), 3.0)) == expected


@pytest.mark.parametrize(
    ("name", "has_chosen_band", "expected"),
    [("input", False, ["bands apart"]), ("input", True, ["bands apart"])]
    + [("reference", False, ["bands apart"]), ("reference", True, [])],
)
def test_bands_of_the_reference_may_be_apart_if_one_is_chosen(
    name: str, has_chosen_band: bool, expected: list[str]
) -> None:
    """All bands of the input are registered."""
    displaced = facts(has_chosen_band=has_chosen_band, band_shifts=[BandShift((2, 3), 9.0)])
    assert refusing(ImagesEvidence(scene(**{name: displaced}), masked(NONE), 3.0)) == expected
    assert refusing(evidence(GOOD, scene=scene(**{name: displaced}))) == expected


@pytest.mark.parametrize(("agreeing", "is_needed"), [(5, True), (6, False), (9, False)])
def test_what_chance_explains_with_less_than_its_squared_limit_needs_no_second_pass(
    agreeing: int, is_needed: bool
) -> None:
    """A random match within 12 px lies within 2 px with 4 π / 25²: 5 of 9 do with 10^-6.4."""
    errors = np.concatenate([scatter(agreeing, 0.3), np.full((9 - agreeing, 2), 9.0)])
    probability = 4 * math.pi / 25**2
    tail = binom.sf(agreeing - 1, 9, probability)
    found = evidence(errors)
    assert found.held_out.log10_chance == pytest.approx(math.log10(tail), abs=1e-6)
    assert found.needs_second_confirmation == is_needed


@pytest.mark.parametrize(
    ("errors", "is_refused"),
    [
        (np.full((9, 2), 1.3), False),
        (np.full((9, 2), 1.5), True),
        (np.full((9, 2), np.nan), True),
        (np.zeros((0, 2)), True),
    ],
    ids=["within 2 px", "beyond", "nowhere", "nothing found"],
)
def test_points_of_the_exchanged_pair_must_agree_with_the_transform(
    errors: np.ndarray, is_refused: bool
) -> None:
    found = evidence(GOOD, exchanged=evidence(errors).held_out)
    assert refusing(found) == (["exchanged roles"] if is_refused else [])


def test_a_part_may_lie_beyond_the_chips_surfaces() -> None:
    def of(excess: float) -> Evidence:
        far = Part("lower", (60.0, 0.0), excess, tuple(range(11)))
        return evidence(GOOD, survey=replace(survey(38), far=far))

    assert refusing(of(LEAST_EXCESS)) == ["part elsewhere"]
    assert refusing(of(LEAST_EXCESS - 0.1)) == []


@pytest.mark.parametrize(
    ("images", "is_refused"),
    [(RADARS, True), (CAMERAS, False)],
)
def test_ground_of_one_camera_must_stand_out_more(images: SceneInfo, is_refused: bool) -> None:
    """A place elsewhere is seven times as high as the mean of 49 chips of noise."""
    elsewhere = survey(height=1.2, rival=1.0)
    found = evidence(GOOD, scene=images, survey=survey(), ground=[elsewhere])
    assert refusing(found) == (["ground elsewhere"] if is_refused else [])
