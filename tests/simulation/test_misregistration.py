"""Misregistrations: their size, and images that carry them exactly."""

from __future__ import annotations

import math

import numpy as np
import pytest
from affine import Affine
from rasterio.crs import CRS
from scipy import ndimage

from groundtie.errors import ParameterError
from groundtie.geometry.models import DEGREE
from groundtie.geometry.transform import Transform
from groundtie.rasters.grid import Grid
from groundtie.simulation.misregistration import (
    DISTORTIONS,
    DistortionOptions,
    Positions,
    draw_misregistration,
    needed_margin,
    resample,
)
from groundtie.simulation.optical import OpticalOptions, blur, render_radiance
from groundtie.simulation.scene import SceneOptions, generate_scenes

UTM = CRS.from_epsg(32633)
GRID = Grid(Affine(2.0, 0, 412000, 0, -2.0, 5334000), UTM, 400, 300)
KINDS = list(DISTORTIONS)


def displacement_px(options: DistortionOptions, px: np.ndarray, seed: int = 0) -> np.ndarray:
    """How far the truth moves input pixels from where they would be without distortion."""
    truth = Transform(draw_misregistration(options, GRID, seed), UTM, GRID)
    return truth(GRID.pixel_to_map(px)) - px


CENTRE = np.array([GRID.centre_px])


class TestDraw:
    @pytest.mark.parametrize("kind", KINDS)
    @pytest.mark.parametrize("shift_px", [0.0, 0.37, 12.5, 500.0])
    def test_shift_at_the_centre_has_the_length_asked_for(self, kind: str, shift_px: float) -> None:
        moved = displacement_px(DistortionOptions(kind, shift_px), CENTRE)
        assert np.hypot(*moved[0]) == pytest.approx(shift_px, abs=1e-6)

    def test_direction_of_the_shift_is_drawn_from_all(self) -> None:
        moved = np.concatenate(
            [displacement_px(DistortionOptions("shift", 5), CENTRE, seed) for seed in range(60)]
        )
        quadrants = {tuple(np.sign(m).astype(int)) for m in moved}
        assert len(quadrants) == 4

    @pytest.mark.parametrize("turn_deg", [-30.0, 2.0, 90.0])
    def test_rotation_is_counter_clockwise_about_the_centre(self, turn_deg: float) -> None:
        options = DistortionOptions("rotation", shift_px=0, rotation_deg=turn_deg)
        arm = CENTRE + [[100.0, 0]]
        moved = (arm + displacement_px(options, arm) - CENTRE)[0]
        # Rows run down: counter-clockwise on the map is towards smaller rows.
        turn = math.radians(turn_deg)
        assert moved == pytest.approx([100 * math.cos(turn), -100 * math.sin(turn)], abs=1e-6)

    @pytest.mark.parametrize("scale", [0.5, 1.02, 2.0])
    def test_scale_about_the_centre(self, scale: float) -> None:
        options = DistortionOptions("scale", shift_px=0, scale=scale)
        arm = CENTRE + [[60.0, -80]]
        assert displacement_px(options, arm)[0] == pytest.approx(
            [60 * (scale - 1), -80 * (scale - 1)], abs=1e-6
        )

    def test_similarity_is_both(self) -> None:
        options = DistortionOptions("similarity", shift_px=0, rotation_deg=90, scale=1.5)
        arm = CENTRE + [[10.0, 0]]
        assert displacement_px(options, arm)[0] == pytest.approx([-10, -15], abs=1e-6)

    @pytest.mark.parametrize("kind", ["affine", "polynomial"])
    @pytest.mark.parametrize("seed", range(4))
    def test_warp_reaches_the_size_asked_for(self, kind: str, seed: int) -> None:
        """In the square around the longer side; in a wide image it may stay somewhat below."""
        side = np.linspace(-0.5, 399.5, 81)
        square = np.stack(np.meshgrid(side, side - 50), axis=-1).reshape(-1, 2)
        moved = displacement_px(DistortionOptions(kind, 0, warp_px=6.0), square, seed)
        assert np.hypot(*moved.T).max() == pytest.approx(6.0, rel=0.01)

    def test_polynomial_is_curved(self) -> None:
        line = np.column_stack([np.linspace(0, 399, 9), np.full(9, 150.0)])
        moved = displacement_px(DistortionOptions("polynomial", 0, warp_px=6.0), line)
        straight = np.polynomial.Polynomial.fit(line[:, 0], moved[:, 0], 1)(line[:, 0])
        assert np.abs(moved[:, 0] - straight).max() > 0.2

    @pytest.mark.parametrize("kind", KINDS)
    def test_kind_of_model(self, kind: str) -> None:
        model = draw_misregistration(DistortionOptions(kind), GRID, 0)
        assert model.kind == DISTORTIONS[kind]
        terms = (DEGREE[model.kind] + 1) * (DEGREE[model.kind] + 2) // 2
        assert model.coefficients.shape == (terms, 2)

    def test_follows_the_seed(self) -> None:
        first, second, other = (
            draw_misregistration(DistortionOptions("polynomial"), GRID, seed).coefficients
            for seed in (1, 1, 2)
        )
        assert np.array_equal(first, second)
        assert not np.array_equal(first, other)


class TestRefusals:
    @pytest.mark.parametrize(
        "wrong", [{"kind": "spline"}, {"shift_px": -1}, {"warp_px": -1}, {"scale": 0.0}], ids=str
    )
    def test_options(self, wrong: dict) -> None:
        with pytest.raises(ParameterError):
            DistortionOptions(**wrong)

    def test_warp_that_could_fold_the_image(self) -> None:
        with pytest.raises(ParameterError, match=r"twentieth.*: 60 px are more than"):
            draw_misregistration(DistortionOptions("polynomial", warp_px=60), GRID, 0)


class TestNeededMargin:
    def test_of_a_shift_is_its_larger_component(self) -> None:
        model = draw_misregistration(DistortionOptions("shift", 100), GRID, 0)
        component = np.abs(displacement_px(DistortionOptions("shift", 100), CENTRE)).max()
        assert component <= needed_margin(model, GRID, GRID) <= component + 6

    def test_of_a_quarter_turn(self) -> None:
        """Turned by 90°, an input of 400 by 300 shows 50 px beyond the top and the bottom."""
        model = draw_misregistration(DistortionOptions("rotation", 0, 90.0), GRID, 0)
        assert 50 <= needed_margin(model, GRID, GRID) <= 56

    def test_of_a_shrunk_content(self) -> None:
        """At half the scale the input shows twice the width."""
        model = draw_misregistration(DistortionOptions("scale", 0, scale=0.5), GRID, 0)
        assert 200 <= needed_margin(model, GRID, GRID) <= 206


class TestPositions:
    @pytest.mark.slow
    @pytest.mark.parametrize("kind", KINDS)
    @pytest.mark.parametrize("ratio", [0.5, 1.0, 2.5])
    def test_truth_takes_them_back_to_the_pixels(self, kind: str, ratio: float) -> None:
        claimed = GRID.scaled(ratio)
        options = DistortionOptions(kind, 7.3, rotation_deg=25, scale=1.2, warp_px=3)
        truth = Transform(draw_misregistration(options, claimed, 3), UTM, claimed)
        scene_grid = GRID.window(-50, -50, 500, 400)
        position = Positions.interpolated(truth, scene_grid).strip(0, claimed.height)
        xy = scene_grid.pixel_to_map(position[::-1].reshape(2, -1).T)
        row, column = np.mgrid[: claimed.height, : claimed.width]
        expected = np.stack([column, row], axis=-1).reshape(-1, 2)
        assert np.abs(truth(xy) - expected).max() < 1e-4

    def test_strip_is_a_part_of_the_whole(self) -> None:
        truth = Transform(draw_misregistration(DistortionOptions(), GRID, 3), UTM, GRID)
        positions = Positions.interpolated(truth, GRID)
        whole = positions.strip(0, 300)
        np.testing.assert_allclose(positions.strip(100, 140), whole[:, 100:140], atol=1e-9)


class TestResample:
    def test_smooth_function_keeps_its_values(self) -> None:
        def function(column: np.ndarray, row: np.ndarray) -> np.ndarray:
            return np.sin(column / 5) * np.cos(row / 7)

        truth = Transform(draw_misregistration(DistortionOptions("affine"), GRID, 1), UTM, GRID)
        scene_grid = GRID.window(-40, -40, 480, 380)
        row, column = np.mgrid[:380, :480]
        positions = Positions.interpolated(truth, scene_grid)
        image = resample(function(column, row).astype(np.float32), positions)
        source_row, source_column = positions.strip(0, 300)
        np.testing.assert_allclose(image, function(source_column, source_row), atol=1e-3)


@pytest.fixture(scope="module")
def light() -> np.ndarray:
    """An optical image of a town without noise, sharp as it is delivered."""
    scene = generate_scenes(SceneOptions((460, 360), seed=8)).radar
    image = render_radiance(scene, OpticalOptions(bands=("green",)))[0]
    blur(image, 0.8)
    return image


class TestDeliveredDistortion:
    """Warped back by the truth, the delivered image lies on the undistorted one."""

    grid = Grid(Affine(1.0, 0, 412000, 0, -1.0, 5334000), UTM, 400, 300)

    @pytest.mark.parametrize("kind", KINDS)
    @pytest.mark.parametrize("seed", [0, 5])
    def test_shift_left_over(self, light: np.ndarray, kind: str, seed: int) -> None:
        options = DistortionOptions(kind, shift_px=6.4, rotation_deg=3, scale=1.03, warp_px=4)
        truth = Transform(draw_misregistration(options, self.grid, seed), UTM, self.grid)
        scene_grid = self.grid.window(-30, -30, 460, 360)
        delivered = resample(light, Positions.interpolated(truth, scene_grid))

        row, column = np.mgrid[40:260, 40:360]
        px = np.stack([column, row], axis=-1).reshape(-1, 2)
        column_in, row_in = truth(self.grid.pixel_to_map(px)).T
        positions = [row_in.reshape(row.shape), column_in.reshape(row.shape)]
        # Another kernel and the forward truth: the simulator does not check itself.
        back = ndimage.map_coordinates(delivered, positions, order=5)
        undistorted = light[30:-30, 30:-30][40:260, 40:360]
        for part in _quarters(undistorted.shape):
            assert np.abs(_small_shift(undistorted[part], back[part])).max() < 0.01

    @pytest.mark.parametrize("shift", [(0.05, -0.02), (-0.01, 0.03)])
    def test_distortion_would_be_seen(self, light: np.ndarray, shift: tuple[float, float]) -> None:
        """The measure itself, on an image that Fourier's shift theorem has moved."""
        moved = np.fft.ifft2(ndimage.fourier_shift(np.fft.fft2(light), shift[::-1])).real
        part = slice(40, -40), slice(40, -40)
        # Differences flatten sharp edges, so that the measure errs to the larger side.
        found = _small_shift(light[part], moved[part])
        assert found == pytest.approx(shift, rel=0.12, abs=0.002)


def _quarters(shape: tuple[int, ...]) -> list[tuple[slice, slice]]:
    half_rows, half_columns = shape[0] // 2, shape[1] // 2
    return [
        (slice(r, r + half_rows), slice(c, c + half_columns))
        for r in (0, half_rows)
        for c in (0, half_columns)
    ]


def _small_shift(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Shift (col, row) of `second`, far below a pixel, by least squares on gradients."""
    inner = slice(4, -4), slice(4, -4)
    down, along = np.gradient((first + second) / 2)
    design = np.column_stack([along[inner].ravel(), down[inner].ravel()])
    step, *_ = np.linalg.lstsq(design, (first - second)[inner].ravel(), rcond=None)
    return step
