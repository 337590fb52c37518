"""Where roofs are shown: theory, and where the rendered images have them."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from groundtie.simulation.check_points import (
    _hidden_from_camera,
    _hidden_from_radar,
    camera_position,
    radar_position,
)
from groundtie.simulation.cover import OPEN_GROUND, Cover
from groundtie.simulation.misregistration import DistortionOptions
from groundtie.simulation.optical import OpticalOptions, direction, render_radiance
from groundtie.simulation.pair import PairOptions, SimulatedPair, simulate_pair
from groundtie.simulation.sar import SarOptions, sar_power
from groundtie.simulation.scene import Scene, SceneOptions

MakeScene = Callable[..., Scene]

SHAPE = (120, 300)
ROOF = (slice(30, 90), slice(130, 200), 24.0)
MARK = (slice(52, 61), slice(160, 169))
MARK_CENTRE = np.array([[164.0, 56.0]])


def marked(scene: Scene) -> Scene:
    """The scene with a spot on its roof that is brighter to both sensors."""
    scene.parcel[MARK] = 3
    parcels = scene.parcels
    return replace(
        scene,
        parcels=replace(
            parcels,
            **{
                name: np.concatenate([getattr(parcels, name), getattr(parcels, name)[1:2]])
                for name in ("cover", "height_m", "rows_rad", "window_m", "wall_reflectance")
            },
            backscatter_db=np.append(parcels.backscatter_db, np.float32(7)),
            reflectance=np.vstack([parcels.reflectance, np.full((1, 4), 2, np.float32)]),
        ),
    )


def centroid(image: np.ndarray, threshold: float) -> np.ndarray:
    """Centre (col, row) of what is brighter."""
    row, column = np.nonzero(image > threshold * image.max())
    return np.array([column.mean(), row.mean()])


class TestRadar:
    @pytest.mark.parametrize(("orbit", "sign"), [("ascending", -1), ("descending", 1)])
    @pytest.mark.parametrize("incidence_deg", [35.0, 47.0])
    def test_layover_on_level_ground(
        self, make_scene: MakeScene, orbit: str, sign: int, incidence_deg: float
    ) -> None:
        options = SarOptions(incidence_deg, orbit)
        px, height = np.array([[100.0, 50.0], [150.0, 60.0]]), np.array([10.0, 60.0])
        shown = radar_position(make_scene(SHAPE), px, height, options)
        expected = px[:, 0] + sign * height / math.tan(math.radians(incidence_deg))
        np.testing.assert_allclose(shown, np.column_stack([expected, px[:, 1]]), atol=1e-6)

    @pytest.mark.parametrize("slope", [-0.2, 0.15])
    def test_layover_on_a_slope(self, make_scene: MakeScene, slope: float) -> None:
        """The ground of the same range lies h · cot / (1 − m · cot) nearer, on a slope m."""
        options = SarOptions(40.0)
        terrain = np.broadcast_to(slope * np.arange(300), SHAPE)
        px, height = np.array([[200.0, 50.0]]), np.array([30.0])
        shown = radar_position(make_scene(SHAPE, terrain_m=terrain), px, height, options)
        cot = options.cot_incidence
        assert shown[0, 0] == pytest.approx(200 - 30 * cot / (1 - slope * cot), abs=1e-3)

    @pytest.mark.parametrize("orbit", ["ascending", "descending"])
    def test_the_image_has_it_there(self, make_scene: MakeScene, orbit: str) -> None:
        options = SarOptions(40.0, orbit)
        plain = sar_power(make_scene(SHAPE, (ROOF,)), options)
        scene = marked(make_scene(SHAPE, (ROOF,)))
        expected = radar_position(scene, MARK_CENTRE, np.array([24.0]), options)[0]
        found = centroid(sar_power(scene, options) - plain, 0.15)
        np.testing.assert_allclose(found, expected, atol=0.6)

    def test_hidden_in_the_shadow_of_a_higher_roof(self, make_scene: MakeScene) -> None:
        """40 m over 10 m at 45°: the shadow on the lower roof is 30 px long."""
        front, back = (slice(0, 120), slice(50, 100), 40.0), (slice(0, 120), slice(100, 220), 10.0)
        scene = make_scene(SHAPE, (front, back))
        column = np.array([110, 127, 133, 180])
        place = (np.full(4, 60), column)
        hidden = _hidden_from_radar(scene, place, SarOptions(45.0))
        assert hidden.tolist() == [True, True, False, False]
        assert not _hidden_from_radar(scene, place, SarOptions(45.0, "descending")).any()


class TestCamera:
    @pytest.mark.parametrize("azimuth_deg", [0.0, 90.0, 200.0])
    def test_lean(self, make_scene: MakeScene, azimuth_deg: float) -> None:
        options = OpticalOptions(view_azimuth_deg=azimuth_deg, off_nadir_deg=20.0)
        px = np.array([[100.0, 50.0]])
        shown = camera_position(make_scene(SHAPE, pixel_size_m=2.0), px, np.array([30.0]), options)
        step = np.array(direction(azimuth_deg)) * 30 * math.tan(math.radians(20)) / 2
        np.testing.assert_allclose(shown, px - step, atol=1e-9)

    @pytest.mark.parametrize("azimuth_deg", [250.0, 40.0])
    def test_the_image_has_it_there(self, make_scene: MakeScene, azimuth_deg: float) -> None:
        options = OpticalOptions(view_azimuth_deg=azimuth_deg, off_nadir_deg=25.0, bands=("red",))
        plain = render_radiance(make_scene(SHAPE, (ROOF,)), options)[0]
        scene = marked(make_scene(SHAPE, (ROOF,)))
        expected = camera_position(scene, MARK_CENTRE, np.array([24.0]), options)[0]
        found = centroid(render_radiance(scene, options)[0] - plain, 0.5)
        # The renderer takes the nearest pixels.
        np.testing.assert_allclose(found, expected, atol=0.8)

    def test_hidden_behind_a_higher_roof(self, make_scene: MakeScene) -> None:
        """From the east at 45°, 40 m hide 30 px of a roof of 10 m behind them."""
        options = OpticalOptions(view_azimuth_deg=90, off_nadir_deg=45.0)
        front, back = (slice(0, 120), slice(200, 250), 40.0), (slice(0, 120), slice(80, 200), 10.0)
        scene = make_scene(SHAPE, (front, back))
        place = (np.full(4, 60), np.array([120, 167, 173, 190]))
        assert _hidden_from_camera(scene, place, options).tolist() == [False, False, True, True]

    def test_nothing_is_hidden_from_above(self, make_scene: MakeScene) -> None:
        scene = make_scene(SHAPE, (ROOF,))
        place = (np.array([60]), np.array([129]))
        assert not _hidden_from_camera(scene, place, OpticalOptions(off_nadir_deg=0)).any()


@pytest.fixture(scope="module")
def city() -> SimulatedPair:
    return simulate_pair(
        PairOptions(
            SceneOptions((300, 300), density="city", relief_m=0.0, seed=3, changed=0.3),
            SarOptions(40.0),
            OpticalOptions(off_nadir_deg=20.0, bands=("red",)),
            DistortionOptions("similarity", 6.0),
            input_pixel_size_m=1.25,
        )
    )


class TestPair:
    @pytest.mark.slow
    def test_roofs_are_displaced_by_their_height(self, city: SimulatedPair) -> None:
        roofs = city.roof_points
        assert len(roofs.px) > 10
        assert roofs.height_m.min() > 2
        layover = roofs.px[:, 0] - roofs.reference_px[:, 0]
        np.testing.assert_allclose(layover, roofs.height_m / math.tan(math.radians(40)), atol=1e-6)
        lean = -np.array(direction(250.0)) * math.tan(math.radians(20)) * roofs.height_m[:, None]
        moved = city.reference_grid.pixel_to_map(roofs.px + lean)
        np.testing.assert_allclose(city.truth(moved), roofs.input_px, atol=1e-6)

    @pytest.mark.slow
    def test_ground_and_roofs_disagree(self, city: SimulatedPair) -> None:
        """The ground's truth does not take a roof in the one image to that in the other."""
        roofs = city.roof_points
        xy = city.reference_grid.pixel_to_map(roofs.reference_px)
        miss_m = 1.25 * np.hypot(*(city.truth(xy) - roofs.input_px).T)
        # To the radar and away from the camera, whose directions are 20° apart.
        east, north = math.sin(math.radians(70)), math.cos(math.radians(70))
        radar, camera = 1 / math.tan(math.radians(40)), math.tan(math.radians(20))
        per_m = math.hypot(radar + camera * east, camera * north)
        np.testing.assert_allclose(miss_m / 1.02, per_m * roofs.height_m, rtol=1e-6)

    def test_points_are_on_unchanged_roofs_and_open_ground(self, city: SimulatedPair) -> None:
        scene = city.scene
        for px, covers in (
            (city.check_points_px, OPEN_GROUND),
            (city.roof_points.px, (Cover.BUILDING,)),
        ):
            column, row = np.rint(px).astype(int).T + scene.margin_px
            assert np.all(np.isin(scene.parcels.cover[scene.parcel[row, column]], covers))
