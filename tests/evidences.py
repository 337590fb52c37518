"""Evidence for verdicts, made without any image: what the rules of a registration read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from raster_files import UTM, utm_grid

from groundtie.errors import NothingFoundError
from groundtie.geometry.accuracy import NOTHING_COMMON, Common
from groundtie.geometry.estimation import Estimate
from groundtie.geometry.fitting import fit_model
from groundtie.geometry.model_choice import left_out_blocks
from groundtie.geometry.tie_points import TiePoints
from groundtie.geometry.transform import Transform
from groundtie.masks.used import MaskUsed
from groundtie.matching.band_shifts import BandShift
from groundtie.matching.check import CHECK_RADIUS_PX
from groundtie.matching.contrast_signs import ContrastSigns
from groundtie.matching.parts import ELSEWHERE_PX, FarPlace
from groundtie.matching.shared_content import Sensors, SharedContent
from groundtie.matching.survey import SURVEY_RADIUS_PX, Survey
from groundtie.matching.surveys import Rest, Surveys
from groundtie.registration.evidence import Evidence, RegistrationEvidence
from groundtie.registration.refinement import RefinementEvidence
from groundtie.registration.registration import Registration
from groundtie.registration.scene import ImageFacts, SceneInfo
from groundtie.registration.specification import BOTH, NEITHER
from groundtie.registration.verdict import judge_search, refusals
from groundtie.sensor.adjustment import Control, adjust
from groundtie.similarity.in_common import Sameness

GRID = utm_grid(600, 500)

# Pixels of the image whose RPCs are refined.
IMAGE_SIZE = (1000, 800)

# Where heights displace things: along range, here off the axes of the map.
RANGE = np.array([np.cos(0.3), np.sin(0.3)])

# The verdict if nothing was found.
LOST = judge_search(NothingFoundError("nothing in common was found"))


def refused(registration: Registration) -> Registration:
    """Return a registration as if nothing had been found."""
    return replace(registration, evidence=None, check=None, verdict=LOST)


def points(px: np.ndarray, error_px: np.ndarray, *, check: bool) -> TiePoints:
    """Return points of an image that is registered already, with errors of their matches."""
    count = len(px)
    return TiePoints(
        reference_xy=GRID.pixel_to_map(px),
        input_px=px + error_px,
        score=np.full(count, 8.0),
        covariance_px2=np.tile(0.04 * np.eye(2), (count, 1, 1)),
        forward_backward_error_px=np.zeros(count),
        is_check=np.full(count, check),
        state=np.full(count, "used"),
    )


def fit_points(within: tuple[float, float] = (1.0, 1.0), sigma: float = 0.3) -> TiePoints:
    """Return points on a lattice over a part of the overlap."""
    rng = np.random.default_rng(1)
    cols, rows = np.meshgrid(np.linspace(20, 579, 9), np.linspace(20, 479, 8))
    px = np.column_stack([cols.ravel(), rows.ravel()]) * within
    return points(px, sigma * rng.normal(size=px.shape), check=False)


def estimated(fit: TiePoints, kind: str = "affine") -> Estimate:
    """Fit a model to points as the search does: on the map, and in pixels without each block."""
    px, nominal_px = GRID.map_to_pixel(fit.reference_xy), fit.input_px
    on_map = fit_model(kind, fit.reference_xy, GRID.pixel_to_map(nominal_px))
    left_out = [fit_model(kind, px[~out], nominal_px[~out]) for out in left_out_blocks(px)]
    return Estimate(Transform(on_map, UTM, GRID), fit, tuple(left_out))


def check_points(error_px: np.ndarray) -> TiePoints:
    """Return check points anywhere in the overlap."""
    rng = np.random.default_rng(2)
    px = rng.uniform([30, 30], [570, 470], (len(error_px), 2))
    return points(px, error_px, check=True)


def scatter(count: int, sigma: float, seed: int = 3) -> np.ndarray:
    """Return errors of inliers, shape (n, 2)."""
    return sigma * np.random.default_rng(seed).normal(size=(count, 2))


def fallen(count: int, seed: int = 4) -> np.ndarray:
    """Return errors of matches that fell anywhere, shape (n, 2)."""
    return np.random.default_rng(seed).uniform(-CHECK_RADIUS_PX, CHECK_RADIUS_PX, (count, 2))


def displaced(count: int, low: float, high: float, seed: int = 5) -> np.ndarray:
    """Return errors of matches on things of various heights, exact across the range."""
    lengths = np.random.default_rng(seed).uniform(low, high, count)
    return lengths[:, None] * RANGE + scatter(count, 0.2, seed)


def evidence(
    check_errors: np.ndarray,
    estimate: Estimate | None = None,
    max_error_px: float = 3.0,
    *,
    survey: Survey | None = None,
    rest: Rest | None = None,
    ground: Sequence[Survey] = (),
    unexplained: Survey | None = None,
    signs: ContrastSigns | None = None,
    far: FarPlace | None = None,
    stripes: FarPlace | None = None,
    **more: Any,
) -> RegistrationEvidence:
    """Return the evidence of a registration whose check points have errors, shape (n, 2)."""
    estimate, check = estimate or estimated(fit_points()), check_points(check_errors)
    surveys = Surveys(
        survey, rest, ground, unexplained=unexplained, signs=signs, far=far, stripes=stripes
    )
    images = (more.pop("scene", scene()), more.pop("mask", MaskUsed.none("")), max_error_px)
    return RegistrationEvidence(*images, estimate, check, GRID, surveys=surveys, **more)


def survey(
    confirming: int = 49,
    part: int = 0,
    height: float = 8.0,
    rival: float = 2.0,
    peak: float = 0.0,
    peak_px: int = 9,
) -> Survey:
    """Return a survey of 7 × 7 chips, of which some confirm and some rows' first ones lie off.

    The others have a rival beside where they confirm, which is no peak, and a peak so far off.
    """
    centres = np.stack(np.meshgrid(*[np.arange(7) * 70 + 40] * 2), -1).reshape(-1, 2)
    random = np.random.default_rng(7)
    shifts = random.uniform(5, 24, (49, 2)) * random.choice([-1, 1], (49, 2))
    shifts[49 - confirming :] = scatter(confirming, 0.4)
    shifts[:part] = [9.0, -5.0]
    side = 2 * SURVEY_RADIUS_PX + 1
    surfaces = np.zeros((49, side, side), np.float32)
    surfaces[part:, SURVEY_RADIUS_PX, SURVEY_RADIUS_PX] = height
    beside = SURVEY_RADIUS_PX + int(ELSEWHERE_PX)
    surfaces[part:, beside, SURVEY_RADIUS_PX] = rival + 0.1
    surfaces[part:, beside + 1, SURVEY_RADIUS_PX] = rival
    surfaces[part:, SURVEY_RADIUS_PX + peak_px, SURVEY_RADIUS_PX] = peak
    surfaces[:part, SURVEY_RADIUS_PX - 5, SURVEY_RADIUS_PX + 9] = height
    return Survey(GRID, centres, shifts, surfaces)


# How much is the same: of two grounds beneath something drawn, and of one sensor's views.
DRAWN_OVER = Sameness(sharpness=1.0, area=0.4, reduced_area=0.5, coarse_area=0.5, ground=0.0)
VIEWS = replace(DRAWN_OVER, ground=0.4)


def leaving(left: Survey | None = None, sameness: Sameness = DRAWN_OVER, **more: Any) -> Rest:
    """Return what 49 chips show of two cameras' images without what these have the same."""
    return Rest(SharedContent(sameness, Sensors.CAMERAS), more.pop("chips", 49), left, **more)


def in_common(
    sensors: Sensors, left: Survey, without_edges: Survey | None = None, brighter: float = 0.0
) -> Rest:
    """Return what chips show without what two images have in common, if only a little."""
    shared = SharedContent(replace(DRAWN_OVER, area=0.1, brighter=brighter), sensors)
    return Rest(shared, 49, left, without_edges=without_edges)


def left_of_two_sensors(*heights: float, brighter: float = 0.0) -> Rest:
    """Return how high chips are without windows that vary alike, and without edges."""
    surveys = (survey(height=height) for height in heights)
    return in_common(Sensors.DIFFERENT, *surveys, brighter=brighter)


def facts(
    variation2: float = 0.001,
    strong_share: float = 0.02,
    is_known_radar: bool = False,
    is_in_sensor_geometry: bool = False,
    has_colours: bool = False,
    has_pixel_size: bool = True,
    has_chosen_band: bool = False,
    band_shifts: Sequence[BandShift] = (),
) -> ImageFacts:
    """Return facts about an image that need no image: by default a camera's, of fields."""
    found = ImageFacts(None, None)  # type: ignore[arg-type]
    vars(found).update(
        variation2=variation2,
        strong_share=strong_share,
        is_known_radar=is_known_radar,
        is_in_sensor_geometry=is_in_sensor_geometry,
        has_colours=has_colours,
        has_pixel_size=has_pixel_size,
        has_chosen_band=has_chosen_band,
        band_shifts=band_shifts,
    )
    return found


def scene(
    reference: ImageFacts | None = None, input: ImageFacts | None = None, declared: str = "auto"
) -> SceneInfo:
    """Return what two images are, by given facts."""
    return SceneInfo(reference or facts(), input or facts(), declared)


RADARS, CAMERAS = scene(declared=BOTH), scene(declared=NEITHER)


def control(
    shift: tuple[float, float],
    count: int = 40,
    noise_px: float = 0.3,
    corner: float = 1.0,
    seed: int = 0,
) -> Control:
    """Return ground control on a part of an image, shifted against its RPCs."""
    random = np.random.default_rng(seed)
    px = random.uniform(0, 1, (count, 2)) * IMAGE_SIZE * corner
    found = px + shift + random.normal(0, noise_px, px.shape)
    return Control(px, found, np.tile(0.01 * np.eye(2), (count, 1, 1)), IMAGE_SIZE)


def refinement(
    fit: Control,
    check: Control | None = None,
    pixel_m: float = 1.0,
    max_error_px: float = 3.0,
    kind: str = "auto",
    folding_px: float = 0.0,
    common: Common = NOTHING_COMMON,
) -> RefinementEvidence:
    """Return the evidence of RPCs that are refined by ground control."""
    adjusted = adjust(fit, kind)
    return RefinementEvidence(
        fit, adjusted, check, pixel_m, max_error_px, folding_px, common=common
    )


# Check points that all agree.
GOOD = scatter(36, 0.4)

# A dense town, of who knows which sensor.
TOWN = {"strong_share": 0.25}
PERHAPS = scene(facts(**TOWN))


def two_thirds(right: int) -> np.ndarray:
    """Return errors of 36 check points of which so many agree."""
    return np.concatenate([scatter(right, 0.4), fallen(36 - right)])


def masked(kind: str) -> MaskUsed:
    return MaskUsed(kind, "reference", 0.3, "as asked for")


def refusing(found: Evidence) -> list[str]:
    """Return the names of all rules that refuse, whichever decides."""
    return [rule.name for rule, _ in refusals(found)]
