from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy import ndimage

from groundtie.errors import CancelledError, ParameterError
from groundtie.progress import Progress
from groundtie.simulation.cover import OPEN_GROUND, Cover
from groundtie.simulation.misregistration import DISTORTIONS, DistortionOptions
from groundtie.simulation.optical import OpticalOptions
from groundtie.simulation.pair import PairOptions, SimulatedPair, simulate_pair
from groundtie.simulation.sar import SarOptions
from groundtie.simulation.scene import SceneOptions

SMALL = PairOptions(
    scene=SceneOptions((240, 200), seed=3),
    optical=OpticalOptions(bands=("green", "nir")),
    distortion=DistortionOptions("shift", 6.0),
)


@pytest.fixture(scope="module")
def small() -> SimulatedPair:
    return simulate_pair(SMALL)


@pytest.fixture(scope="module")
def country() -> SimulatedPair:
    """Both images of a rural scene without misregistration, for comparing them by class."""
    return simulate_pair(
        PairOptions(
            scene=SceneOptions((500, 500), density="rural", seed=11),
            sar=SarOptions(looks=8),
            optical=OpticalOptions(bands=("red",), off_nadir_deg=0),
            distortion=DistortionOptions("shift", 0.0),
        )
    )


class TestShapes:
    def test_images(self, small: SimulatedPair) -> None:
        assert small.reference.shape == (1, 200, 240)
        assert small.input.shape == (2, 200, 240)
        assert small.reference.dtype == small.input.dtype == np.uint16

    def test_grids_claim_the_same_place(self, small: SimulatedPair) -> None:
        assert small.truth.input_grid == small.reference_grid
        assert small.reference_grid.crs.to_epsg() == 32633
        assert small.reference_grid.is_georeferenced

    @pytest.mark.slow
    @pytest.mark.parametrize(("size_m", "shape"), [(0.5, (400, 480)), (2.5, (80, 96))])
    def test_input_of_another_pixel_size(self, size_m: float, shape: tuple[int, int]) -> None:
        pair = simulate_pair(replace(SMALL, input_pixel_size_m=size_m))
        assert pair.input.shape[1:] == shape
        assert pair.truth.input_grid.pixel_size == (size_m, size_m)
        assert pair.reference.shape == (1, 200, 240)

    @pytest.mark.slow
    def test_pixel_size_of_the_scene(self) -> None:
        pair = simulate_pair(replace(SMALL, scene=replace(SMALL.scene, pixel_size_m=3.0)))
        assert pair.reference_grid.pixel_size == (3.0, 3.0)

    def test_coarser_input_is_smoother_on_the_ground(self, small: SimulatedPair) -> None:
        """Its point spread grows with its pixels: averaged, both show the same brightness."""
        coarse = simulate_pair(replace(SMALL, input_pixel_size_m=2.0))
        blocks = small.input.reshape(2, 100, 2, 120, 2).mean(axis=(2, 4))
        assert coarse.input.mean() == pytest.approx(blocks.mean(), rel=0.02)
        assert coarse.input.std() < blocks.std()

    def test_refuses_a_ratio_that_makes_no_sense(self) -> None:
        with pytest.raises(ParameterError, match="input_pixel_size_m"):
            simulate_pair(replace(SMALL, input_pixel_size_m=50.0))

    def test_refuses_a_scene_that_is_larger_than_its_map(self) -> None:
        scene = replace(SMALL.scene, pixel_size_m=1e6)
        with pytest.raises(ParameterError, match="is larger than its map: take smaller pixels"):
            simulate_pair(replace(SMALL, scene=scene))


class TestContent:
    def test_no_pixel_is_empty(self, small: SimulatedPair) -> None:
        assert small.reference.min() >= 1
        assert small.input.min() >= 1

    @pytest.mark.slow
    @pytest.mark.parametrize(
        "distortion",
        [DistortionOptions("shift", 500.0), DistortionOptions("similarity", 10, 40, 0.7)],
        ids=["500 px", "40 degrees"],
    )
    def test_input_is_full_of_content_however_far_it_is_off(
        self, distortion: DistortionOptions
    ) -> None:
        pair = simulate_pair(replace(SMALL, distortion=distortion))
        # Constant or mirrored filling would repeat lines; textured ground does not.
        lines = pair.input[0].astype(int)
        for image in (lines, lines.T):
            assert np.abs(np.diff(image, axis=0)).mean(axis=1).min() > 1
        assert 1 < np.percentile(lines, 1) < np.percentile(lines, 99) < 2047

    def test_optical_image_has_eleven_bits(self, small: SimulatedPair) -> None:
        assert 300 < small.input.max() <= 2047

    def test_images_show_the_same_place(self, country: SimulatedPair) -> None:
        """Water is dark to the radar and to the camera in the same pixels."""
        cover = country.scene.cover()[country.scene.window]
        water, land = cover == Cover.WATER, cover == Cover.FIELD
        for image in (country.reference[0], country.input[0]):
            assert np.median(image[water]) < 0.6 * np.median(image[land])


class TestRadiometry:
    """The images are related by class and not monotonically."""

    def test_ranks_of_classes_differ(self, country: SimulatedPair) -> None:
        cover = country.scene.cover()[country.scene.window]
        radar, camera = (
            {c: np.median(image[cover == c]) for c in Cover if (cover == c).sum() > 500}
            for image in (country.reference[0], country.input[0])
        )
        assert radar[Cover.WATER] < radar[Cover.FIELD]
        assert camera[Cover.WATER] < camera[Cover.FIELD]
        assert radar[Cover.FOREST] > radar[Cover.ROAD]
        assert camera[Cover.FOREST] < camera[Cover.ROAD]

    def test_contrast_of_neighbouring_fields_is_partly_inverted(
        self, country: SimulatedPair
    ) -> None:
        labels = country.scene.parcel[country.scene.window]
        table = country.scene.parcels
        fields = [
            n
            for n, count in zip(*np.unique(labels, return_counts=True), strict=True)
            if table.cover[n] == Cover.FIELD and count > 500
        ]
        means = np.array(
            [
                [np.mean(image[labels == n]) for n in fields]
                for image in (country.reference[0], country.input[0])
            ]
        )
        i, j = np.triu_indices(len(fields), 1)
        signs = np.sign(means[:, i] - means[:, j])
        inverted = np.mean(signs[0] != signs[1])
        assert 0.25 < inverted < 0.75


class TestCheckPoints:
    @pytest.mark.parametrize("density", ["rural", "suburban", "urban"])
    def test_lie_on_open_ground(self, density: str) -> None:
        pair = simulate_pair(replace(SMALL, scene=replace(SMALL.scene, density=density)))
        column, row = np.rint(pair.check_points_px).astype(int).T
        cover = pair.scene.cover()[pair.scene.window]
        assert np.isin(cover[row, column], OPEN_GROUND).all()
        assert not pair.scene.object_m[pair.scene.window][row, column].any()
        assert len(pair.check_points_px) > 80

    def test_are_spread_and_inside_both_images(self, small: SimulatedPair) -> None:
        px = small.check_points_px
        assert small.reference_grid.contains(px).all()
        shown = small.truth(small.reference_grid.pixel_to_map(px))
        assert small.truth.input_grid.contains(shown).all()
        assert (np.ptp(px, axis=0) > [200, 160]).all()

    @pytest.mark.slow
    def test_none_where_the_input_shows_another_place(self) -> None:
        far = replace(SMALL, distortion=DistortionOptions("shift", 500.0))
        assert len(simulate_pair(far).check_points_px) == 0


class TestTruth:
    @pytest.mark.slow
    @pytest.mark.parametrize("kind", list(DISTORTIONS))
    def test_round_trip(self, kind: str) -> None:
        options = replace(SMALL, distortion=DistortionOptions(kind, 5.0), input_pixel_size_m=1.5)
        pair = simulate_pair(options)
        xy = pair.reference_grid.pixel_to_map(pair.check_points_px)
        np.testing.assert_allclose(pair.truth.inverse(pair.truth(xy)), xy, atol=1e-6)

    @pytest.mark.slow
    @pytest.mark.parametrize("kind", ["shift", "polynomial"])
    def test_takes_the_distorted_image_to_the_undistorted_one(self, kind: str) -> None:
        quiet = replace(SMALL, optical=OpticalOptions(bands=("green",), noise_dn=0))
        still, moved = (
            simulate_pair(replace(quiet, distortion=DistortionOptions(kind, shift, warp_px=warp)))
            for shift, warp in ((0.0, 0.0), (4.3, 3.0))
        )
        row, column = np.mgrid[30:170, 30:210]
        px = np.stack([column, row], axis=-1).reshape(-1, 2)
        there = moved.truth(moved.reference_grid.pixel_to_map(px))
        seen = ndimage.map_coordinates(moved.input[0].astype(float), there[:, ::-1].T, order=5)
        expected = still.input[0][30:170, 30:210].astype(float)
        assert np.std(seen - expected.ravel()) < 0.02 * np.std(expected)


class TestReproducible:
    def test_same_options_same_pair(self, small: SimulatedPair) -> None:
        again = simulate_pair(SMALL)
        assert np.array_equal(small.reference, again.reference)
        assert np.array_equal(small.input, again.input)
        assert np.array_equal(small.check_points_px, again.check_points_px)
        assert small.truth.to_json() == again.truth.to_json()

    def test_other_seed_other_pair(self, small: SimulatedPair) -> None:
        other = simulate_pair(replace(SMALL, scene=replace(SMALL.scene, seed=4)))
        assert not np.array_equal(small.reference, other.reference)
        assert small.truth.to_json() != other.truth.to_json()

    def test_distortion_and_pixel_size_leave_the_scene_as_it_is(self, small: SimulatedPair) -> None:
        other = simulate_pair(
            replace(SMALL, distortion=DistortionOptions("affine", 2.0), input_pixel_size_m=2.0)
        )
        assert np.array_equal(small.reference, other.reference)

    def test_looks_change_the_speckle_and_not_the_scene(self, small: SimulatedPair) -> None:
        many = simulate_pair(replace(SMALL, sar=SarOptions(looks=16)))
        assert np.array_equal(small.input, many.input)
        assert many.reference.astype(float).std() < small.reference.astype(float).std()


class TestProgress:
    def test_runs_from_start_to_end(self) -> None:
        seen: list[float] = []
        simulate_pair(SMALL, Progress(report=lambda fraction, _: seen.append(fraction)))
        assert seen == sorted(seen)
        assert seen[0] == 0
        assert seen[-1] > 0.7

    def test_can_be_cancelled(self) -> None:
        with pytest.raises(CancelledError):
            simulate_pair(SMALL, Progress(is_cancelled=lambda: True))
