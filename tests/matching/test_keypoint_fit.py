from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from affine import Affine
from raster_files import write_raster
from speckled_pairs import write_speckled_pair
from textured_pairs import TexturedPair, error_px, pixels, shift_on_map

from groundtie.context import threads
from groundtie.errors import TooFewPointsError
from groundtie.features import tiles
from groundtie.features.descriptors import SiftDescriptor
from groundtie.features.detectors import SiftOctDetector
from groundtie.features.matching import GATE_PX
from groundtie.features.tiles import Describing, Detecting
from groundtie.geometry.estimation import Estimate
from groundtie.geometry.models import Model
from groundtie.geometry.transform import Transform
from groundtie.matching import keypoints
from groundtie.matching.chips import ChipMatcher
from groundtie.matching.feature_fit import ConsensusFit
from groundtie.matching.held_out import HeldOut
from groundtie.matching.keypoint_fit import KeypointFit, agreeing_keypoints
from groundtie.matching.keypoints import KeypointMatcher
from groundtie.matching.matcher import Correspondences
from groundtie.matching.surface_fit import SurfaceFit
from groundtie.rasters.grid import Grid
from groundtie.rasters.pair import Image, ImagePair
from groundtie.rasters.reading import Window, open_raster
from groundtie.similarity.surface import SimilaritySettings
from groundtie.studies.sift_variants import SiftVariantDescriptor, sift_detector

SIZE = (300, 280)
NMI = SimilaritySettings("nmi")
KEYPOINTS = SiftOctDetector(0.075), SiftDescriptor()
# The truth is 60 m east and 45 m south, pixels are 10 m: the coarse model is wrong by 5 px.
TRUTH, COARSE = shift_on_map(60.0, -45.0), shift_on_map(30.0, -5.0)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> TexturedPair:
    return write_speckled_pair(tmp_path_factory.mktemp("speckled"), SIZE, TRUTH)


def estimate_of(
    pair: ImagePair,
    kind: str = "auto",
    coarse: Model = COARSE,
    detector: Detecting = KEYPOINTS[0],
    descriptor: Describing = KEYPOINTS[1],
) -> Estimate:
    held_out = HeldOut.of(pair)
    matcher = KeypointMatcher(pair, detector, descriptor, held_out=held_out)
    with threads(2) as context:
        return fit_of(pair, held_out, matcher).estimate(coarse, kind, context)


def fit_of(pair: ImagePair, held_out: HeldOut, matcher: KeypointMatcher) -> KeypointFit:
    chips = SurfaceFit(ChipMatcher(pair, SimilaritySettings("fused"), held_out), held_out.layout)
    return KeypointFit(matcher, chips, ChipMatcher(pair, NMI, held_out))


def keypoints_of(
    pair: ImagePair,
    kind: str = "auto",
    coarse: Model = COARSE,
    detector: Detecting = KEYPOINTS[0],
    descriptor: Describing = KEYPOINTS[1],
) -> tuple[Correspondences, ConsensusFit]:
    """Return the correspondences and the fit from keypoints without chips."""
    matcher = KeypointMatcher(pair, detector, descriptor, held_out=HeldOut.of(pair))
    with threads(2) as context:
        return agreeing_keypoints(matcher, coarse, kind, context)


def error_of(fit: ConsensusFit, files: TexturedPair) -> float:
    nominal = Transform.nominal(files.grid.crs, files.truth.input_grid)
    model = fit.model.on_map(files.grid.centre_transform)
    return error_px(replace(nominal, model=model), files)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["auto", "affine", "polynomial2", "tps"])
def test_a_misregistration_is_recovered(files: TexturedPair, kind: str) -> None:
    with files.opened() as pair:
        found = estimate_of(pair, kind)
    # A spline follows each of its points.
    assert error_px(found.transform, files) < (0.6 if kind == "tps" else 0.4)
    assert found.points.used.sum() > 15
    assert not found.points.is_check.any()
    residuals = found.points.take(found.points.used).residual_px(found.transform)
    assert np.median(np.hypot(*residuals.T)) < 1.0
    if kind != "auto":
        assert found.transform.model.kind == kind


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["auto", "affine", "polynomial2"])
def test_keypoints_alone_recover_it(files: TexturedPair, kind: str) -> None:
    with files.opened() as pair:
        _, found = keypoints_of(pair, kind)
    assert error_of(found, files) < 0.4
    assert found.mixture.inliers.sum() > 15


@pytest.mark.slow
@pytest.mark.parametrize("detector", ["sift", "sift-isef-oct"])
@pytest.mark.parametrize("gradient", ["recursive", "roewa"])
def test_other_detectors_and_gradients_find_it_too(
    files: TexturedPair, detector: str, gradient: str
) -> None:
    with files.opened() as pair:
        _, found = keypoints_of(
            pair, detector=sift_detector(detector), descriptor=SiftVariantDescriptor(gradient)
        )
    assert error_of(found, files) < 0.5


@pytest.mark.slow
@pytest.mark.parametrize("emptied", [False, True])
def test_pixels_held_out_of_the_fit_change_nothing_of_it(
    files: TexturedPair, tmp_path: Path, emptied: bool
) -> None:
    with files.opened() as pair:
        layout = HeldOut.of(pair).layout
        size = pair.grid.width, pair.grid.height
        held_out = layout.held_out(np.arange(float(size[0])), np.arange(float(size[1]))[:, None])
        expected = estimate_of(pair, "affine")
    values = pixels(files.reference)[0]
    assert held_out.shape == values.shape and 0.15 < held_out.mean() < 0.4
    noise = np.random.default_rng(9).integers(1, 60_000, values.shape, dtype=np.uint16)
    values = np.where(held_out, 0 if emptied else noise, values).astype(np.uint16)
    spoiled = replace(files, reference=write_raster(tmp_path / "r.tif", values, files.grid))
    with spoiled.opened() as pair:
        found = estimate_of(pair, "affine")
    assert found.transform.to_json() == expected.transform.to_json()
    for name, column in vars(expected.points).items():
        np.testing.assert_array_equal(getattr(found.points, name), column, err_msg=name)


@dataclass(frozen=True)
class Astray:
    """Matches whose error grows to the right."""

    pair: ImagePair
    held_out: HeldOut
    most_px: float = 7.0
    wrong_px: float = 0.0

    def match(self, coarse: Model, radius_px: int, context: object) -> Correspondences:
        grid = self.pair.grid
        sides = [np.arange(30.0, size - 30, 12) for size in (grid.width, grid.height)]
        px = np.stack(np.meshgrid(*sides), -1).reshape(-1, 2)
        px = px[~self.held_out.layout.held_out(*px.T)]
        partner = grid.map_to_pixel(TRUTH(grid.pixel_to_map(px)))
        partner = partner - (grid.map_to_pixel(coarse(grid.pixel_to_map(px))) - px)
        partner[:, 0] += self.most_px * px[:, 0] / grid.width
        # Nearly all agree on a wrong place; the few others are no rival.
        partner[np.arange(len(px)) % 20 > 0, 1] += self.wrong_px
        return Correspondences(px, partner, np.full(len(px), 2.0), float(np.pi * radius_px**2))


@pytest.mark.slow
def test_chips_are_matched_again_where_the_first_model_went_astray(files: TexturedPair) -> None:
    """Right chips lie up to 7 px off the first model, and are searched for within 4 px of it."""
    with files.opened() as pair, threads(2) as context:
        held_out = HeldOut.of(pair)
        fit = fit_of(pair, held_out, Astray(pair, held_out))  # type: ignore[arg-type]
        found = fit.estimate(COARSE, "affine", context)
        right = files.grid.map_to_pixel(found.points.reference_xy[found.points.used])[:, 0]
    assert error_px(found.transform, files) < 0.4
    assert right.max() > 0.8 * SIZE[0]


@pytest.mark.slow
def test_the_coarse_model_is_taken_where_keypoints_agree_on_a_wrong_one(
    files: TexturedPair,
) -> None:
    """Nothing matches 14 px beside the truth."""
    with files.opened() as pair, threads(2) as context:
        held_out = HeldOut.of(pair)
        astray = Astray(pair, held_out, most_px=0.0, wrong_px=14.0)
        fit = fit_of(pair, held_out, astray)  # type: ignore[arg-type]
        found = fit.estimate(TRUTH, "affine", context)
    assert error_px(found.transform, files) < 0.4


@pytest.mark.slow
def test_tiles_change_next_to_nothing(files: TexturedPair, monkeypatch: pytest.MonkeyPatch) -> None:
    with files.opened() as pair, threads(2) as context:
        whole = KeypointMatcher(pair, *KEYPOINTS).match(COARSE, GATE_PX, context)
        monkeypatch.setattr(keypoints, "TILE_PX", 128)
        parts = KeypointMatcher(pair, *KEYPOINTS).match(COARSE, GATE_PX, context)

    def places(matches: Correspondences) -> set[tuple[float, ...]]:
        return {tuple(row) for row in np.rint(np.hstack([matches.px, matches.partner_px]))}

    # Each tile is stretched by its own grey values.
    shared = places(whole) & places(parts)
    assert len(shared) > 0.6 * len(places(whole))


def test_a_tile_sees_all_that_its_keypoints_see_but_not_far_beyond_the_grid() -> None:
    grid = Grid(Affine.identity(), None, 3000, 1200)
    middle, last = Window(1024, 0, 1024, 1024), Window(2048, 1024, 952, 176)
    far = 16 + tiles.MARGIN_PX
    left, right, down = 1024 - far, 1024 + 2 * far, 1024 + 16 + far
    assert keypoints.seen_around(middle, grid, 16) == Window(left, -16, right, down)
    # Up to 16 px beyond the last column and the last row.
    assert keypoints.seen_around(last, grid, 16) == Window(
        2048 - far, 1024 - far, 952 + far + 16, 176 + far + 16
    )


def test_only_keypoints_on_the_ground_are_matched(files: TexturedPair, tmp_path: Path) -> None:
    ground_px = np.zeros((SIZE[1], SIZE[0]), np.uint8)
    ground_px[:, 100:] = 1
    mask = write_raster(tmp_path / "ground.tif", ground_px, files.grid)
    with files.opened() as pair, open_raster(mask) as ground, threads(2) as context:
        masked = replace(pair, reference=Image(pair.reference.source, None, ground))
        found, everywhere = (
            KeypointMatcher(pair, *KEYPOINTS, shown=shown).match(COARSE, GATE_PX, context)
            for shown in (masked, None)
        )
    assert 50 < len(found.px) < len(everywhere.px)
    assert found.px[:, 0].min() > 99


def test_a_coarse_model_that_is_off_by_more_than_the_gate_finds_nothing_right(
    files: TexturedPair,
) -> None:
    far = shift_on_map(60.0 + 400.0, -45.0)
    with files.opened() as pair:
        try:
            _, found = keypoints_of(pair, "affine", coarse=far)
        except TooFewPointsError:
            return
    # The remaining agreement is by chance: a small part.
    assert found.mixture.inliers.mean() < 0.35


def test_another_place_has_too_few_matches_that_agree(tmp_path: Path) -> None:
    other = write_speckled_pair(tmp_path, SIZE, TRUTH, input_seed=77)
    with other.opened() as pair:
        try:
            _, found = keypoints_of(pair, "affine")
        except TooFewPointsError:
            return
    assert found.mixture.inliers.sum() < 12


@pytest.mark.slow
def test_chips_between_the_keypoints_take_part(files: TexturedPair) -> None:
    with files.opened() as pair:
        few = SiftOctDetector(contrast=0.12)
        alone, _ = keypoints_of(pair, "affine", detector=few)
        refined = estimate_of(pair, "affine", detector=few)
    assert len(refined.points) > 1.5 * len(alone.px)
    assert error_px(refined.transform, files) < 0.4


@pytest.mark.slow
def test_chips_alone_do_where_there_are_no_keypoints(files: TexturedPair) -> None:
    none = SiftOctDetector(contrast=0.9)
    with files.opened() as pair:
        with pytest.raises(TooFewPointsError):
            keypoints_of(pair, detector=none)
        found = estimate_of(pair, detector=none)
        with_keypoints = estimate_of(pair)
    assert error_px(found.transform, files) < 0.4
    assert found.notes == ("too few keypoints match: the model is that of chips alone",)
    assert with_keypoints.notes == ()
