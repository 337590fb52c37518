from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine
from raster_files import write_raster
from rasterio.crs import CRS
from rasterio.transform import RPCTransformer
from rpc_models import REAL, camera, camera_rpc, real_tags, to_rasterio, write_dem, write_positions

from groundtie.errors import NoOverlapError
from groundtie.rasters.grid import LON_LAT, Grid, compose, reproject
from groundtie.rasters.reading import open_raster
from groundtie.sensor import dense as dense_module
from groundtie.sensor.dense import DenseOrientation
from groundtie.sensor.orientation import Orientation, orient, sensor_grid
from groundtie.sensor.rpc_tags import rpc_from_tags

UTM = CRS.from_epsg(32632)
RPC = camera_rpc()


@contextmanager
def oriented(folder: Path, crs: CRS = UTM, **of_dem: object) -> Iterator[Orientation]:
    image = write_positions(folder / "image.tif", RPC)
    dem_path = write_dem(folder / "dem.tif", **of_dem)  # type: ignore[arg-type]
    with (
        open_raster(image, allow_sensor_geometry=True) as source,
        open_raster(dem_path) as dem,
    ):
        yield orient(source, RPC, crs, dem)


def tile_of(orientation: Orientation, size: int = 300, pixel_m: float = 1.0) -> Grid:
    centre = orientation.to_map([[300.0, 250.0]])[0]
    corner = centre + [-size / 2 * pixel_m, size / 2 * pixel_m]
    transform = Affine(pixel_m, 0, corner[0], 0, -pixel_m, corner[1])
    return Grid(transform, orientation.crs, size, size - 33)


def pixels(grid: Grid) -> np.ndarray:
    cols, rows = np.meshgrid(np.arange(grid.width), np.arange(grid.height))
    return grid.pixel_to_map(np.column_stack([cols.ravel(), rows.ravel()]))


@pytest.mark.parametrize("crs", [UTM, CRS.from_epsg(3035), LON_LAT])
def test_map_and_image_are_each_others_inverse(tmp_path: Path, crs: CRS) -> None:
    px = np.random.default_rng(0).uniform([0, 0], [600, 500], (2000, 2))
    with oriented(tmp_path, crs) as orientation:
        xy = orientation.to_map(px)
        assert np.isfinite(xy).all()
        assert np.abs(orientation.to_px(xy) - px).max() < 1e-3
        grid = sensor_grid_of(tmp_path, orientation)
        np.testing.assert_array_equal(grid.map_to_pixel(xy), orientation.to_px(xy))
        np.testing.assert_array_equal(grid.pixel_to_map(px), xy)
        assert grid.pixel_size_m == pytest.approx(1.0, rel=0.01)


def sensor_grid_of(folder: Path, orientation: Orientation) -> Grid:
    with open_raster(folder / "image.tif", allow_sensor_geometry=True) as source:
        return sensor_grid(source, orientation)


def test_positions_on_the_terrain_are_gdals(tmp_path: Path) -> None:
    with oriented(tmp_path) as orientation:
        px = np.random.default_rng(0).uniform([5, 5], [595, 495], (500, 2))
        xy = orientation.to_map(px)
        lon_lat = reproject(xy, UTM, LON_LAT)
        found = orientation.to_px(xy)
    with RPCTransformer(to_rasterio(RPC), RPC_DEM=str(tmp_path / "dem.tif")) as transformer:
        rows, cols = transformer.rowcol(*lon_lat.T, op=lambda value: value)
    assert np.abs(found - (np.column_stack([cols, rows]) - 0.5)).max() < 0.01


@pytest.mark.parametrize("pixel_m", [0.4, 1.0, 7.0])
@pytest.mark.parametrize("crs", ["EPSG:4326", "EPSG:32632"])
def test_the_dense_positions_are_the_single_ones(tmp_path: Path, crs: str, pixel_m: float) -> None:
    with oriented(tmp_path, crs=UTM) as orientation:
        tile = tile_of(orientation, 300 if pixel_m < 5 else 60, pixel_m)
        dense = DenseOrientation(orientation).coordinates(tile)
        single = orientation.to_px(pixels(tile)).T.reshape(dense.shape)
    assert dense.shape == (2, tile.height, tile.width)
    assert np.abs(dense - single).max() < 2e-3


@pytest.mark.slow
@pytest.mark.parametrize("largest_px", [4096, 50])
def test_houses_in_a_surface_model_are_seen_by_the_dense_positions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, largest_px: int
) -> None:
    """Also where the model is so fine that a tile is worked in parts."""
    monkeypatch.setattr(dense_module, "_LARGEST_PX", largest_px)
    grid = Grid(Affine(1, 0, 499_000, 0, -1, 5_000_800), UTM, 2000, 1800)
    heights = np.full((1800, 2000), 200, np.float32)
    heights[::37, ::41] += 60  # posts of a metre: no lattice meets them by chance
    write_raster(tmp_path / "dsm.tif", heights, grid)
    image = write_positions(tmp_path / "image.tif", RPC)
    with (
        open_raster(image, allow_sensor_geometry=True) as source,
        open_raster(tmp_path / "dsm.tif") as dsm,
    ):
        orientation = orient(source, RPC, UTM, dsm)
        tile = tile_of(orientation)
        dense = DenseOrientation(orientation).coordinates(tile)
        single = orientation.to_px(pixels(tile)).T.reshape(dense.shape)
    assert np.ptp(dense[0] - orientation.rpc.image_offset[0]) > 100
    assert np.abs(dense - single).max() < 2e-3


@pytest.mark.parametrize("turn_deg", [0.0, 45.0])
@pytest.mark.parametrize("pixel_m", [60.0, 100.0, 300.0])
def test_an_image_of_a_few_pixels_is_found_wherever_they_lie(
    tmp_path: Path, pixel_m: float, turn_deg: float
) -> None:
    with oriented(tmp_path) as orientation:
        centre = orientation.to_map([[300.0, 250.0]])[0]
        for shift in range(0, 32, 5):
            turn = compose(Affine.translation(*centre), Affine.rotation(turn_deg))
            scaled = compose(turn, Affine.scale(pixel_m, -pixel_m))
            transform = compose(scaled, Affine.translation(-60 - shift, -70 - shift))
            grid = Grid(transform, UTM, 150, 130)
            dense = DenseOrientation(orientation).coordinates(grid)
            single = orientation.to_px(pixels(grid)).T.reshape(dense.shape)
            inside = np.all((single > 0) & (single < [[[600]], [[500]]]), axis=0)
            assert inside.any()
            np.testing.assert_allclose(dense[:, inside], single[:, inside], atol=2e-3)


def test_far_places_are_not_in_the_image(tmp_path: Path) -> None:
    with oriented(tmp_path, pixel_m=100.0) as orientation:
        near = orientation.to_map([[300.0, 250.0]])
        assert np.isnan(orientation.to_px(near + [50_000.0, 0.0])).all()
        far = tile_of(orientation).shifted(50_000.0, 0.0)
        assert (DenseOrientation(orientation).coordinates(far) < -1e8).all()
        edge = tile_of(orientation, 400, 10.0)
        dense = DenseOrientation(orientation).coordinates(edge)
        single = orientation.to_px(pixels(edge)).T.reshape(dense.shape)
    both = (dense > -1e8).all(axis=0) & np.isfinite(single).all(axis=0)
    assert both.sum() > 1000
    assert np.abs(dense - single)[:, both].max() < 2e-3
    # What lies in the image is found by both.
    inside = np.all((single > 0) & (single < [[[600]], [[500]]]), axis=0)
    assert both[inside].all()


@pytest.mark.parametrize("height_m", [20.0, 780.0, 880.0, 985.0, -185.0])
def test_ground_is_whole_at_all_heights_that_the_rpcs_are_used_for(
    tmp_path: Path, height_m: float
) -> None:
    """The RPCs were made for 0 to 800 m; they hold to 1.5 times as far from the middle."""
    px = np.stack(np.meshgrid(np.linspace(0, 599, 20), np.linspace(0, 499, 20)), -1).reshape(-1, 2)
    # A part of a wide image that is seen from the side.
    wide, corner = {"size": (2400, 2000), "off_nadir": (1.2, -0.5)}, np.array([900, 750])
    rpc = camera_rpc(**wide).shifted(-corner)
    of_dem = {"size": 240, "steepness": 0.02, "offset_m": height_m - 300}
    image = write_positions(tmp_path / "image.tif", RPC)
    dem_path = write_dem(tmp_path / "dem.tif", **of_dem)
    with (
        open_raster(image, allow_sensor_geometry=True) as source,
        open_raster(dem_path) as dem,
    ):
        orientation = orient(source, rpc, UTM, dem)
        assert orientation.known_share == 1
        xy = orientation.to_map(px)
        assert np.abs(orientation.to_px(xy) - px).max() < 1e-3
        heights = orientation.heights_at(xy)
        np.testing.assert_allclose(heights, height_m, atol=5)
        lon_lat = reproject(xy, UTM, LON_LAT)
        # The RPCs are that right beyond the heights that they were made for.
        assert np.abs(camera(lon_lat, heights, **wide) - corner - px).max() < 0.01


def test_lines_of_sight_that_miss_the_terrain_are_nan(tmp_path: Path) -> None:
    with oriented(tmp_path) as orientation:
        xy = orientation.to_map([[300.0, 250.0], [90_000.0, 250.0], [np.nan, 1.0]])
    assert np.isfinite(xy).all(axis=1).tolist() == [True, False, False]
    assert np.isnan(xy[1:]).all()


def test_a_terrain_model_may_cover_a_part_of_the_image(tmp_path: Path) -> None:
    """Beyond it there is no height, and no pixel; nominal places are there all the same."""
    with oriented(tmp_path) as whole:
        assert whole.known_share == 1
        xy = whole.to_map(CENTRE_AND_CORNER)
    with oriented(tmp_path, size=16) as part:
        # 400 m to the north, at 45° of latitude 283 m to the east, of 600 × 500 m; relief and
        # obliqueness move the outline.
        assert part.known_share == pytest.approx(400 * 283 / (600 * 500), abs=0.05)
        np.testing.assert_allclose(part.to_map(CENTRE_AND_CORNER)[0], xy[0], atol=1e-3)
        assert np.isnan(part.to_map(CENTRE_AND_CORNER)[1]).all()
        assert np.isnan(part.to_px(xy)[1]).all()
        nominal = part.to_nominal_map(CENTRE_AND_CORNER)
        np.testing.assert_allclose(nominal[0], xy[0], atol=1e-3)
        # Its typical height is wrong by what the relief is.
        assert np.hypot(*(nominal - xy)[1]) < 200
        assert np.isfinite(sensor_grid_of(tmp_path, part).pixel_to_map(CENTRE_AND_CORNER)).all()


@pytest.mark.parametrize("void", [0, 3])
def test_ground_at_the_border_of_the_terrain_model_is_met(tmp_path: Path, void: int) -> None:
    """On cliffs at either border, 500 m high, where lines of sight at other heights pass it.

    Beyond the border there is nothing, or pixels without a value.
    """
    image = write_positions(tmp_path / "image.tif", RPC)
    middle = reproject(np.array([[9.0, 45.15]]), LON_LAT, UTM)[0]
    grid = Grid(Affine(10, 0, middle[0] - 200, 0, -10, middle[1] + 600), UTM, 40, 120)
    to_border = np.minimum(np.arange(40), np.arange(40)[::-1]) - void
    heights = np.tile(np.clip(650.0 - 100 * to_border, 100, 600), (120, 1)).astype(np.float32)
    heights[:, to_border < 0] = -32768
    dem_path = write_raster(tmp_path / "dem.tif", heights, grid, nodata=-32768)
    with (
        open_raster(image, allow_sensor_geometry=True) as source,
        open_raster(dem_path) as dem,
    ):
        orientation = orient(source, RPC, UTM, dem)
        columns, rows = np.linspace(void, 39 - void, 200), np.linspace(30, 90, 20)
        xy = grid.pixel_to_map(np.stack(np.meshgrid(columns, rows), -1).reshape(-1, 2))
        px = orientation.to_px(xy)
        seen = source.grid.contains(px)
        assert seen.sum() > 2000
        # A line of sight may meet other ground, too: whatever it meets is shown there.
        again = orientation.to_px(orientation.to_map(px[seen]))
    np.testing.assert_allclose(again, px[seen], atol=1e-3)


CENTRE_AND_CORNER = [[300.0, 250.0], [5.0, 5.0]]


def test_a_terrain_model_elsewhere_is_an_error(tmp_path: Path) -> None:
    image = write_positions(tmp_path / "image.tif", RPC)
    path = write_dem(tmp_path / "dem.tif", size=40)
    with rasterio.open(path, "r+") as dem:
        dem.transform = compose(Affine.translation(3.0, 0.0), dem.transform)
    with (
        open_raster(image, allow_sensor_geometry=True) as source,
        open_raster(path) as dem,
        pytest.raises(NoOverlapError, match="does not cover"),
    ):
        orient(source, RPC, UTM, dem)


@pytest.mark.parametrize("name", REAL)
def test_real_images_meet_their_surface_model(real_data: Path, name: str) -> None:
    """Lines of sight that hit the surface model return to where they came from."""
    rpc = rpc_from_tags(real_tags(real_data / name), name)
    with (
        open_raster(real_data / name, allow_sensor_geometry=True) as source,
        open_raster(real_data / "rpc-triplet" / "dsm.tif") as dsm,
    ):
        orientation = orient(source, rpc, dsm.grid.crs, None, None, 180.0)
        from groundtie.sensor.heights import terrain_heights  # the model covers a part only

        px = np.random.default_rng(0).uniform(450, 650, (300, 2))
        region = orientation.rpc.localise(px, 180.0)
        terrain = Orientation(
            rpc,
            terrain_heights(dsm, None, region),
            dsm.grid.crs,
            orientation.to_lon_lat,
        )
        xy = terrain.to_map(px)
        seen = np.isfinite(xy).all(axis=1)
        assert seen.mean() > 0.9
        assert np.abs(terrain.to_px(xy[seen]) - px[seen]).max() < 1e-3
