"""The ground that both images show, by a surface model: against the simulator, and by hand."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import cv2
import fiona
import numpy as np
import pytest
from affine import Affine
from raster_files import UTM, utm_grid, write_raster
from rasterio.crs import CRS

from groundtie.errors import NoOverlapError, VectorLayerError
from groundtie.geometry.views import View
from groundtie.masks.object_heights import FootprintModel, RasterModel, bare_ground, read_footprints
from groundtie.masks.scene import Scene
from groundtie.masks.surface_model import Reason, SurfaceGround
from groundtie.rasters.grid import Grid, compose
from groundtie.rasters.reading import Window, open_raster
from groundtie.simulation import optical
from groundtie.simulation.cover import Cover
from groundtie.simulation.optical import OpticalOptions
from groundtie.simulation.sar import SarOptions, sar_power
from groundtie.simulation.scene import Scene as Country
from groundtie.simulation.scene import SceneOptions, generate_scenes

GRID = utm_grid(200, 180, 1.0)
CAPE = Grid(Affine(-1, 0, 100, 0, 1, 3_320_000), CRS.from_epsg(2048), 200, 180)
RADAR, CAMERA = View("radar", 270.0, 40.0), View("camera", 250.0, 18.0, 155.0, 48.0)
HOUSE = np.s_[80:110, 90:120]


def house(slope: float = 0.0, height_m: float = 12.0) -> np.ndarray:
    heights = np.tile(np.arange(200) * slope, (180, 1)) + 100
    heights[HOUSE] += height_m
    return heights.astype(np.float32)


def ground_of(
    path: Path, heights: np.ndarray, grid: Grid = GRID, nodata: float | None = None
) -> SurfaceGround:
    """Return the ground of an image by a model on the same pixels."""
    image = write_raster(path / "image.tif", np.ones(heights.shape, np.uint8), grid)
    model = write_raster(path / "dsm.tif", heights, grid, nodata=nodata)
    scene = Scene.of(open_raster(image))
    return SurfaceGround(scene, RasterModel(open_raster(model)), (RADAR, CAMERA))


def test_a_house_on_a_slope_is_found_and_the_slope_is_not(tmp_path: Path) -> None:
    ground = ground_of(tmp_path, house(slope=0.1))
    heights, known = ground.model.heights(GRID)
    assert known.all()
    # The lowest of a cell of 4 m counts; within half of the widest building of the model's end,
    # a slope's upper side cannot be distinguished from one.
    np.testing.assert_allclose(
        heights.ground_m[:, :150], house(slope=0.1, height_m=0)[:, :150], atol=0.5
    )
    raised = (ground.reasons(ground.scene.whole)[:, :150] & Reason.RAISED) > 0
    assert raised[HOUSE].all() and raised.sum() == 32 * 32


def test_noise_does_not_lower_the_ground(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).normal(0, 0.3, (180, 200))
    heights, _ = ground_of(tmp_path, (house() + noise).astype(np.float32)).model.heights(GRID)
    # The lowest of a cell of 16 pixels lies 0.5 m too low, that of cells around it even more.
    np.testing.assert_allclose(heights.ground_m.mean(), 100, atol=0.1)
    assert np.abs(heights.ground_m - 100).max() < 0.5


def test_the_rims_of_voids_are_no_walls(tmp_path: Path) -> None:
    heights = house(height_m=0)
    heights[40:160, 40:160] = -9999
    found, known = ground_of(tmp_path, heights, nodata=-9999).model.heights(GRID)
    np.testing.assert_array_equal(known, heights != -9999)
    np.testing.assert_array_equal(found.surface_m[known], 100)
    np.testing.assert_array_equal(found.ground_m[known], 100)


@pytest.mark.parametrize("grid", [GRID, CAPE], ids=["north-up", "x west, y south"])
def test_each_reason_lies_where_geometry_puts_it(tmp_path: Path, grid: Grid) -> None:
    seen = ground_of(tmp_path, house(), grid).reasons(Window(0, 0, 200, 180))
    layover_px = 12 / math.tan(math.radians(40))
    shadow_px = 12 * math.tan(math.radians(40))
    before, behind = seen[95, :89], seen[95, 121:]
    # One pixel of the margin lies on the house's own.
    assert np.sum((before & Reason.LAYOVER) > 0) == pytest.approx(layover_px, abs=1)
    assert np.sum((behind & Reason.RADAR_SHADOW) > 0) == pytest.approx(shadow_px, abs=1)
    assert not (before & Reason.RADAR_SHADOW).any() and not (behind & Reason.LAYOVER).any()
    # The camera stands in the west-south-west, the sun in the south-south-east.
    assert seen[94, 122] & Reason.HIDDEN and not seen[94, 87] & Reason.HIDDEN
    assert seen[74, 98] & Reason.CAST_SHADOW and not seen[116, 98] & Reason.CAST_SHADOW
    assert (seen[1:60, 1:-1] == 0).all()


def test_the_image_of_a_house_has_its_layover_radar_shadow_and_double_bounce(
    tmp_path: Path,
) -> None:
    """Echoes of level ground, of a wall and of a roof that is wider than its layover, as power."""
    ground = ground_of(tmp_path, house())
    row = ground.image(Window(0, 95, 200, 1), RADAR)[0] ** 2 - 0.1
    # Three for each of the wall's 12 m, besides ground, wall and roof at its foot.
    assert row[89] == pytest.approx(3 + 3 * 12, abs=1e-3)
    layover_m, shadow_m = (12 * f(math.radians(40)) for f in (lambda a: 1 / math.tan(a), math.tan))
    # Ground, wall and roof fall together before the house; the roof alone lies on its near part.
    pieces = [(90 - layover_m, 1), (90, 3), (120 - layover_m, 1), (120 + shadow_m, 0), (200, 1)]
    start = 0.0
    for end, echoes in pieces:
        inside = row[math.ceil(start) + 1 : math.floor(end) - 1]
        np.testing.assert_allclose(inside, echoes, atol=1e-5)
        start = end


def test_nothing_is_imaged_where_heights_are_not_known(tmp_path: Path) -> None:
    heights = house()
    heights[20:40, 30:60] = -9999
    image = ground_of(tmp_path, heights, nodata=-9999).image(Window(0, 0, 200, 180), RADAR)
    np.testing.assert_array_equal(np.isnan(image), heights == -9999)


def test_tiles_are_those_of_the_whole(tmp_path: Path) -> None:
    """Blocks on rough ground with a void, at an oblique azimuth."""
    generator = np.random.default_rng(1)
    heights = np.kron(generator.integers(0, 4, (18, 20)) * 5.0, np.ones((10, 10)))
    heights = (heights + generator.normal(0, 0.5, heights.shape)).astype(np.float32)
    heights[50:70, 20:90] = -9999
    ground = ground_of(tmp_path, heights, nodata=-9999)
    view = replace(RADAR, azimuth_deg=251.0)
    whole = ground.image(ground.scene.whole, view)
    for window in (Window(0, 0, 61, 77), Window(61, 13, 100, 90), Window(150, 101, 50, 79)):
        np.testing.assert_array_equal(ground.image(window, view), whole[window.slices])


@pytest.mark.slow
def test_windows_join(tmp_path: Path) -> None:
    ground = ground_of(tmp_path, house())
    whole, windows = Window(0, 0, 200, 180), [Window(0, 0, 87, 180), Window(87, 0, 113, 180)]
    parts = np.hstack([ground.reasons(window) for window in windows])
    np.testing.assert_array_equal(ground.reasons(whole), parts)
    for view in (RADAR, CAMERA, replace(RADAR, azimuth_deg=251.0)):
        ground = replace(ground, views=(view,))
        parts = np.hstack([ground.image(window, view) for window in windows])
        np.testing.assert_array_equal(ground.image(whole, view), parts)


@pytest.mark.parametrize(("void", "nodata"), [(-9999, -9999), (-9999, None), (32767, None)])
def test_what_is_not_known_takes_no_part_and_hides_nothing(
    tmp_path: Path, void: float, nodata: float | None
) -> None:
    """Heights that no place on Earth has are voids, declared or not."""
    heights = house(height_m=0)
    heights[HOUSE] = void
    ground = ground_of(tmp_path, heights, nodata=nodata)
    part = ground.select(ground.scene.whole).part
    expected = np.ones(part.shape, bool)
    expected[79:111, 89:121] = False
    # Nor is it known how the pixels beyond the border stand.
    expected[[0, -1]] = expected[:, [0, -1]] = False
    np.testing.assert_array_equal(part, expected)


def test_a_model_of_another_place_is_refused(tmp_path: Path) -> None:
    ground = ground_of(tmp_path, house())
    ground.require_cover()
    away = replace(GRID, transform=compose(Affine.translation(5000, 0), GRID.transform))
    far = write_raster(tmp_path / "far.tif", house(), away)
    with pytest.raises(NoOverlapError, match="does not cover"):
        replace(ground, model=RasterModel(open_raster(far))).require_cover()


def test_an_offset_moves_what_stands(tmp_path: Path) -> None:
    ground = ground_of(tmp_path, house())
    window = Window(50, 50, 100, 100)
    # By whole cells of the ground; oblique rays are those of the map, so that borders may differ.
    moved = replace(ground, offset_px=(8, -4)).reasons(window)
    there = ground.reasons(Window(42, 54, 100, 100))
    straight = Reason.RAISED | Reason.LAYOVER | Reason.RADAR_SHADOW | Reason.UNKNOWN
    np.testing.assert_array_equal(moved & straight, there & straight)
    inside, around = (cv2.erode(there, np.ones((3, 3))), cv2.dilate(there, np.ones((3, 3))))
    assert np.all((inside <= moved) & (moved <= around))


def test_directions_follow_the_map_not_the_pixels(tmp_path: Path) -> None:
    """On a grid of degrees, turned by 90°, shadows are as long and lie in the same direction."""
    side = 1 / 111_195.0
    grid = Grid(
        compose(Affine.translation(11.0, 0.001), Affine.scale(side), Affine.rotation(90)),
        CRS.from_epsg(4326),
        200,
        180,
    )
    seen = ground_of(tmp_path, house(), grid).reasons(Window(0, 0, 200, 180))
    rows, cols = np.nonzero((seen & Reason.RADAR_SHADOW) > 0)
    lonlat = grid.pixel_to_map(np.column_stack([cols, rows]))
    east = (lonlat[:, 0] - grid.pixel_to_map([[104.5, 94.5]])[0, 0]) / side
    assert east.max() == pytest.approx(15 + 12 * math.tan(math.radians(40)), abs=2)


@pytest.fixture(scope="module")
def country() -> Country:
    options = SceneOptions((220, 220), density="city", relief_m=10, seed=4)
    return generate_scenes(options, margin_px=128).radar


@pytest.fixture(scope="module")
def part(country: Country, tmp_path_factory: pytest.TempPathFactory) -> np.ndarray:
    """Return what of a simulated city takes part."""
    grid = utm_grid(*country.terrain_m.shape[::-1], 1.0)
    ground = ground_of(tmp_path_factory.mktemp("city"), country.surface_m, grid)
    rows, cols = country.window
    return ground.select(Window(cols.start, rows.start, 220, 220)).part


@pytest.mark.slow
def test_the_simulators_radar_shows_nothing_else_with_it(
    country: Country, part: np.ndarray
) -> None:
    """Without all that stands, the power of what takes part is the same."""
    sar = SarOptions(incidence_deg=RADAR.incidence_deg)
    stands = country.cover() != Cover.CAR
    bare = replace(country, object_m=np.where(stands, 0, country.object_m).astype(np.float32))
    change_db = 10 * np.abs(np.log10(sar_power(country, sar) / sar_power(bare, sar)))
    assert 0.05 < part.mean() < 0.6
    assert np.mean(change_db[part] > 1.0) < 0.01
    assert np.mean(change_db[~part] > 1.0) > 0.6


@pytest.mark.slow
def test_the_simulators_camera_sees_it_in_the_sun(country: Country, part: np.ndarray) -> None:
    stands = country.cover() != Cover.CAR
    alone = replace(country, object_m=np.where(stands, country.object_m, 0).astype(np.float32))
    options = OpticalOptions(
        view_azimuth_deg=CAMERA.azimuth_deg, off_nadir_deg=CAMERA.incidence_deg
    )
    rows = slice(0, alone.object_m.shape[0])
    seen, _ = optical._visible(alone, rows, options, rows)
    own = np.arange(seen.size).reshape(seen.shape)
    assert np.mean((seen == own)[country.window][part]) > 0.99
    shaded = optical._in_shadow(alone.object_m, options)[country.window]
    assert np.mean(shaded[part]) < 0.01


def footprints(path: Path, heights: list[object], field: str = "height") -> Path:
    schema = {"geometry": "Polygon", "properties": {field: "str"}}
    with fiona.open(path, "w", driver="GPKG", crs_wkt=UTM.to_wkt(), schema=schema) as layer:
        for number, height in enumerate(heights):
            left = 20.5 + 40 * number
            px = [(left, 50.5), (left + 20, 50.5), (left + 20, 80.5), (left, 80.5), (left, 50.5)]
            ring = [tuple(map(float, xy)) for xy in GRID.pixel_to_map(px)]
            layer.write(
                {
                    "type": "Feature",
                    "geometry": {"type": "Polygon", "coordinates": [ring]},
                    "properties": {field: height},
                }
            )
    return path


class TestFootprints:
    def test_heights_stand_on_level_ground(self, tmp_path: Path) -> None:
        model = read_footprints(footprints(tmp_path / "a.gpkg", ["12.5", "8 m", "high"]), GRID)
        heights, known = model.heights(GRID)
        assert not heights.ground_m.any()
        assert heights.surface_m[65, 30] == 12.5 and heights.surface_m[65, 70] == 8
        assert heights.surface_m[65, 110] == 0 and heights.surface_m[20, 30] == 0
        # A building whose height is not known is no ground.
        assert not known[51:80, 101:120].any() and known[:, :99].all() and known[:, 122:].all()

    def test_a_layer_without_a_building_here_is_refused(self, tmp_path: Path) -> None:
        away = replace(GRID, transform=compose(Affine.translation(5000, 0), GRID.transform))
        image = write_raster(tmp_path / "image.tif", np.ones((180, 200), np.uint8), away)
        model = read_footprints(footprints(tmp_path / "a.gpkg", ["12"]), away)
        ground = SurfaceGround(Scene.of(open_raster(image)), model, (RADAR,))
        with pytest.raises(NoOverlapError, match="does not cover"):
            ground.require_cover()

    def test_the_higher_of_two_counts(self) -> None:
        ring = [[x, y] for x, y in GRID.pixel_to_map([(9, 9), (30, 9), (30, 30), (9, 30), (9, 9)])]
        area = {"type": "Polygon", "coordinates": [ring]}
        heights, _ = FootprintModel(((area, 5.0), (area, 9.0))).heights(GRID)
        assert heights.surface_m[20, 20] == 9

    @pytest.mark.slow
    def test_no_field_or_no_height(self, tmp_path: Path) -> None:
        with pytest.raises(VectorLayerError, match="no field height"):
            read_footprints(footprints(tmp_path / "a.gpkg", ["3"], "levels"), GRID)
        with pytest.raises(VectorLayerError, match="no polygons with a height"):
            read_footprints(footprints(tmp_path / "b.gpkg", ["unknown"]), GRID)


def test_ground_beside_what_is_not_known_is_as_high_as_elsewhere() -> None:
    """Noise makes the lowest heights too low, beside a gap as far from it."""
    surface = np.random.default_rng(0).normal(100, 0.5, (400, 400)).astype(np.float32)
    known = np.ones(surface.shape, bool)
    known[:, :200] = False
    ground = bare_ground(surface, known, 1.0)
    beside, far = ground[:, 205:215].mean(), ground[:, 330:370].mean()
    assert beside == pytest.approx(far, abs=0.2) and far == pytest.approx(100, abs=0.4)
