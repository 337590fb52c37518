"""Geometry and radiometry of the simulated optical image against theory."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy import ndimage

from groundtie.errors import ParameterError
from groundtie.simulation import optical
from groundtie.simulation.optical import (
    MAX_DN,
    OpticalOptions,
    blur,
    direction,
    quantise,
    render_radiance,
)
from groundtie.simulation.scene import Scene

GROUND, ROOF = 0.1, 0.5
SHAPE = (160, 180)
BOX = (slice(70, 90), slice(80, 110))

MakeScene = Callable[..., Scene]


@pytest.fixture(autouse=True)
def smooth(monkeypatch: pytest.MonkeyPatch) -> None:
    """Take the texture off, so that single pixels can be compared with theory."""
    for name in ("_FINE", "_PATCH", "_ROWS"):
        monkeypatch.setattr(optical, name, np.zeros(7, np.float32))


def red(scene: Scene, **options: float) -> np.ndarray:
    defaults: dict = {"off_nadir_deg": 0, "sun_elevation_deg": 90, "bands": ("red",)}
    return render_radiance(scene, OpticalOptions(**(defaults | options)))[0]


def centroid(mask: np.ndarray) -> np.ndarray:
    """Mean (col, row) of the pixels of a mask."""
    return np.array(np.nonzero(mask)).mean(axis=1)[::-1]


class TestDirection:
    @pytest.mark.parametrize(
        ("azimuth_deg", "step"), [(0, (0, -1)), (90, (1, 0)), (180, (0, 1)), (270, (-1, 0))]
    )
    def test_compass(self, azimuth_deg: float, step: tuple[float, float]) -> None:
        assert direction(azimuth_deg) == pytest.approx(step, abs=1e-12)


class TestNadir:
    def test_level_ground_under_the_sun_has_its_reflectance(self, make_scene: MakeScene) -> None:
        np.testing.assert_allclose(red(make_scene(SHAPE), sun_elevation_deg=40), GROUND, rtol=1e-5)

    def test_roof_stands_on_its_footprint(self, make_scene: MakeScene) -> None:
        image = red(make_scene(SHAPE, ((*BOX, 25.0),)))
        expected = np.full(SHAPE, GROUND)
        expected[BOX] = ROOF
        np.testing.assert_allclose(image, expected, rtol=1e-5)

    def test_bands_come_in_the_order_asked_for(self, make_scene: MakeScene) -> None:
        scene = make_scene((20, 20))
        scene.parcels.reflectance[0] = (0.1, 0.2, 0.3, 0.4)
        options = OpticalOptions(bands=("nir", "green"))
        image = render_radiance(scene, options)
        assert image.shape == (2, 20, 20)
        np.testing.assert_allclose(image.mean(axis=(1, 2)), [0.4, 0.2], rtol=1e-5)


class TestLean:
    """A roof of height h appears h · tan(off-nadir) further from the camera."""

    @pytest.mark.parametrize("azimuth_deg", [0, 45, 90, 130, 200, 270, 315])
    @pytest.mark.parametrize(("height_m", "off_nadir_deg"), [(20.0, 20.0), (8.0, 35.0)])
    def test_roof_is_displaced_away_from_the_camera(
        self, make_scene: MakeScene, azimuth_deg: float, height_m: float, off_nadir_deg: float
    ) -> None:
        scene = make_scene(SHAPE, ((*BOX, height_m),))
        image = red(scene, view_azimuth_deg=azimuth_deg, off_nadir_deg=off_nadir_deg)
        moved = centroid(np.isclose(image, ROOF)) - [94.5, 79.5]
        length = height_m * math.tan(math.radians(off_nadir_deg))
        expected = -length * np.array(direction(azimuth_deg))
        # Whole pixels: the distance is rounded, and then each of its components.
        assert moved == pytest.approx(expected, abs=0.75)

    def test_roof_keeps_its_size(self, make_scene: MakeScene) -> None:
        scene = make_scene(SHAPE, ((*BOX, 20.0),))
        image = red(scene, view_azimuth_deg=200, off_nadir_deg=25)
        assert np.isclose(image, ROOF).sum() == pytest.approx(20 * 30, rel=0.1)

    def test_wall_fills_the_place_between_foot_and_roof(self, make_scene: MakeScene) -> None:
        scene = make_scene(SHAPE, ((*BOX, 30.0),))
        image = red(scene, view_azimuth_deg=270, off_nadir_deg=20)
        line = image[80]
        # The camera stands in the west: wall from the foot at 80 to the roof's edge, 10.9 px on.
        assert np.allclose(line[:80], GROUND)
        assert np.allclose(line[92:120], ROOF)
        wall = line[80:90]
        assert np.allclose(wall, wall[0])
        assert not np.isclose(wall[0], GROUND)

    def test_ground_behind_is_hidden(self, make_scene: MakeScene) -> None:
        parcel = np.zeros(SHAPE, np.int32)
        parcel[:, 112:118] = 2
        scene = make_scene(SHAPE, ((slice(0, 160), slice(80, 110), 30.0),), parcel=parcel)
        seen_from_west = red(scene, view_azimuth_deg=270, off_nadir_deg=20)
        seen_from_east = red(scene, view_azimuth_deg=90, off_nadir_deg=20)
        # The roof, moved by 10.9 px, covers columns 91 to 120.
        assert not np.isclose(seen_from_west, 0.3).any()
        assert np.isclose(seen_from_east[:, 112:118], 0.3).all()

    def test_higher_building_hides_the_lower_one_behind(self, make_scene: MakeScene) -> None:
        front = (slice(0, 160), slice(60, 80), 40.0)
        behind = (slice(0, 160), slice(85, 90), 5.0)
        scene = make_scene(SHAPE, (front, behind))
        scene.parcel[:, 85:90] = 2
        image = red(scene, view_azimuth_deg=270, off_nadir_deg=20)
        assert not np.isclose(image, 0.3).any()

    def test_pixel_size_scales_heights(self, make_scene: MakeScene) -> None:
        fine = make_scene(SHAPE, ((*BOX, 10.0),))
        coarse = make_scene(SHAPE, ((*BOX, 20.0),), pixel_size_m=2.0)
        images = [red(s, view_azimuth_deg=250, off_nadir_deg=30) for s in (fine, coarse)]
        assert np.array_equal(*images)


class TestShadow:
    """A shadow of the length h / tan(elevation), away from the sun."""

    @pytest.mark.parametrize(("height_m", "elevation_deg"), [(10.0, 45.0), (20.0, 35.0), (6, 20)])
    @pytest.mark.parametrize("azimuth_deg", [0, 90, 180, 270])
    def test_length_along_the_raster(
        self, make_scene: MakeScene, height_m: float, elevation_deg: float, azimuth_deg: float
    ) -> None:
        scene = make_scene(SHAPE, ((*BOX, height_m),))
        image = red(scene, sun_azimuth_deg=azimuth_deg, sun_elevation_deg=elevation_deg)
        dark = image < 0.5 * GROUND
        across = dark[:, 95] if azimuth_deg in (0, 180) else dark[80]
        expected = height_m / math.tan(math.radians(elevation_deg))
        assert across.sum() == pytest.approx(expected, abs=0.51)

    @pytest.mark.parametrize("azimuth_deg", [30, 155, 200, 300])
    def test_shape_in_any_direction(self, make_scene: MakeScene, azimuth_deg: float) -> None:
        """The footprint, swept along the shadow."""
        height_m, elevation_deg = 20.0, 40.0
        scene = make_scene(SHAPE, ((*BOX, height_m),))
        dark = red(scene, sun_azimuth_deg=azimuth_deg, sun_elevation_deg=elevation_deg) < 0.5 * 0.1
        length = height_m / math.tan(math.radians(elevation_deg))
        away = -np.array(direction(azimuth_deg))
        footprint = np.zeros(SHAPE, bool)
        footprint[BOX] = True
        expected = np.zeros(SHAPE, bool)
        for distance in np.arange(0, length, 0.25):
            shift = np.rint(distance * away[::-1]).astype(int)
            expected |= np.roll(footprint, tuple(shift), (0, 1))
        expected &= ~footprint
        overlap = (dark & expected).sum() / (dark | expected).sum()
        assert overlap > 0.9
        assert np.abs(centroid(dark) - centroid(expected)).max() < 0.75

    def test_roof_of_a_lower_building_is_shaded_above_its_height_only(
        self, make_scene: MakeScene
    ) -> None:
        tower = (slice(70, 90), slice(120, 130), 30.0)
        low = (slice(70, 90), slice(80, 115), 10.0)
        image = red(make_scene(SHAPE, (tower, low)), sun_azimuth_deg=90, sun_elevation_deg=45)
        # On a roof 10 m high the tower's shadow is 20 m long: from 120 back to 100.
        line = image[80]
        assert np.all(line[101:115] < 0.4 * ROOF)
        assert np.allclose(line[80:99], ROOF)

    def test_none_with_the_sun_overhead(self, make_scene: MakeScene) -> None:
        image = red(make_scene(SHAPE, ((*BOX, 30.0),)), sun_elevation_deg=90)
        assert image.min() == pytest.approx(GROUND)


class TestRelief:
    @pytest.mark.parametrize("slope", [-0.3, 0.2, 0.5])
    def test_lambert(self, make_scene: MakeScene, slope: float) -> None:
        """Direct light goes with the cosine of the angle between the sun and the normal."""
        elevation = math.radians(40)
        terrain = np.broadcast_to(slope * np.arange(60), (50, 60))
        image = red(
            make_scene((50, 60), terrain_m=terrain), sun_azimuth_deg=270, sun_elevation_deg=40
        )
        # It rises to the east and the sun is in the west.
        normal = np.array([-slope, 1]) / math.hypot(slope, 1)
        cosine = normal @ [-math.cos(elevation), math.sin(elevation)]
        direct = max(cosine, 0) / math.sin(elevation)
        expected = GROUND * (optical._AMBIENT + (1 - optical._AMBIENT) * direct)
        np.testing.assert_allclose(image, expected, rtol=1e-4)

    def test_terrain_does_not_lean(self, make_scene: MakeScene) -> None:
        parcel = np.zeros((50, 60), np.int32)
        parcel[:, 30:] = 2
        scene = make_scene((50, 60), parcel=parcel, terrain_m=np.full((50, 60), 500.0))
        image = red(scene, off_nadir_deg=30)
        assert np.array_equal(image > 0.2, parcel == 2)


class TestStrips:
    @pytest.mark.parametrize("azimuth_deg", [0, 180, 225])
    def test_building_across_the_border_of_two_strips(
        self, make_scene: MakeScene, azimuth_deg: float
    ) -> None:
        """Shadow and lean reach over from one strip to the next."""
        light = {
            "view_azimuth_deg": azimuth_deg,
            "off_nadir_deg": 25,
            "sun_azimuth_deg": azimuth_deg + 70,
            "sun_elevation_deg": 35,
        }
        box = ((slice(245, 265), slice(80, 110), 25.0),)
        whole = red(make_scene((400, 180), box), **light)
        moved = ((slice(95, 115), slice(80, 110), 25.0),)
        inside = red(make_scene((200, 180), moved), **light)
        np.testing.assert_allclose(whole[180:320], inside[30:170])


class TestOptics:
    def test_point_spread_is_a_gaussian(self) -> None:
        image = np.zeros((41, 41), np.float32)
        image[20, 20] = 1
        blur(image, 1.5)
        row, column = np.mgrid[-20:21, -20:21]
        expected = np.exp(-(row**2 + column**2) / (2 * 1.5**2)) / (2 * math.pi * 1.5**2)
        np.testing.assert_allclose(image, expected, atol=1e-4)

    def test_grey_values_have_eleven_bits_and_leave_zero_free(self) -> None:
        light = np.array([[-0.1, 0.0, 0.1, 5.0]], np.float32)
        for noise_dn in (0.0, 50.0):
            dn = quantise(light, OpticalOptions(noise_dn=noise_dn), np.random.default_rng(0))
            assert dn.dtype == np.uint16
            assert dn.min() >= 1
            assert dn.max() == MAX_DN == 2**11 - 1

    def test_grey_values_are_linear_without_noise(self) -> None:
        light = np.linspace(0.05, 0.5, 10, dtype=np.float32)[None]
        dn = quantise(light, OpticalOptions(noise_dn=0), np.random.default_rng(0))[0].astype(float)
        assert np.ptp(np.diff(dn)) <= 1

    @pytest.mark.parametrize("reflectance", [0.0, 0.3])
    def test_noise_grows_with_the_root_of_the_signal(self, reflectance: float) -> None:
        light = np.full((200, 200), reflectance, np.float32)
        quiet = quantise(light, OpticalOptions(noise_dn=0), np.random.default_rng(0))
        dark = quantise(np.zeros((1, 1), "f4"), OpticalOptions(noise_dn=0), np.random.default_rng())
        noisy = quantise(light, OpticalOptions(noise_dn=4), np.random.default_rng(0))
        expected = 4 * math.sqrt(quiet[0, 0] / dark[0, 0])
        assert noisy.std() == pytest.approx(expected, rel=0.03)
        assert noisy.mean() == pytest.approx(quiet.mean(), abs=0.5)


class TestTexture:
    def test_plough_rows_run_across_the_direction_of_the_field(
        self, make_scene: MakeScene, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(optical, "_ROWS", np.full(7, 0.2, np.float32))
        scene = make_scene((64, 64), parcel=np.full((64, 64), 2), pixel_size_m=0.625)
        scene.parcels.rows_rad[2] = 0.0
        image = red(scene)
        # A period of 5 m is 8 pixels along the columns; along a row of plants nothing changes.
        assert np.ptp(image, axis=0).max() < 1e-4
        spectrum = np.abs(np.fft.rfft(image[0] - image[0].mean()))
        assert int(np.argmax(spectrum)) == 64 // 8

    def test_is_the_same_each_time(
        self, make_scene: MakeScene, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr(optical, "_FINE", np.full(7, 0.1, np.float32))
        first, second = red(make_scene(SHAPE, seed=1)), red(make_scene(SHAPE, seed=1))
        other = red(make_scene(SHAPE, seed=2))
        assert np.array_equal(first, second)
        assert ndimage.standard_deviation(other - first) == pytest.approx(
            GROUND * 0.1 * math.sqrt(2), rel=0.05
        )


@pytest.mark.parametrize(
    "wrong",
    [
        {"sun_elevation_deg": 5},
        {"off_nadir_deg": 70},
        {"bands": ()},
        {"bands": ("thermal",)},
        {"psf_sigma_px": 0.2},
        {"noise_dn": -1},
    ],
    ids=str,
)
def test_refuses_what_cannot_be(wrong: dict) -> None:
    with pytest.raises(ParameterError):
        OpticalOptions(**wrong)
