"""Images across the antimeridian, where longitudes jump by a turn."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine
from raster_files import write_raster
from rasterio.warp import transform
from rpc_models import camera_rpc, rasterio_project, to_rasterio, write_positions

import groundtie
from groundtie.errors import GeoreferencingError
from groundtie.rasters.grid import LON_LAT, Grid, apply_affine
from groundtie.rasters.reading import open_raster
from groundtie.sensor.heights import terrain_heights
from groundtie.sensor.rpc import RPC
from groundtie.sensor.rpc_files import read_rpc

HERE = camera_rpc()


def across(longitude: float) -> RPC:
    """Return the camera's RPCs around another longitude."""
    return replace(HERE, offset=(longitude, *HERE.offset[1:]))


def by_turns(lon_lat: np.ndarray) -> np.ndarray:
    """Return positions with longitudes from -180 to 180°."""
    return np.column_stack([(lon_lat[:, 0] + 180) % 360 - 180, lon_lat[:, 1]])


def write_slope(path: Path, middle: float, west: float, east: float, step: float) -> Path:
    """Write `slope` in degrees."""
    width = round((east - west) / step)
    grid = Grid(Affine(step, 0, west, 0, -step, 45.25), LON_LAT, width, round(0.2 / step) or 1)
    lon = grid.pixel_to_map(np.column_stack([np.arange(width), np.zeros(width)]))[:, 0]
    heights = np.broadcast_to(slope(lon, middle), (grid.height, width))
    return write_raster(path, heights.astype(np.float32), grid)


def slope(lon: np.ndarray, middle: float) -> np.ndarray:
    """Return heights that rise to the east of a longitude, and fall to the west."""
    beyond = np.mod(lon - middle + 180, 360) - 180
    return 300 + 2000 * np.clip(beyond, -0.1, 0.1)


@pytest.mark.parametrize("longitude", [180.0, -180.0, 179.999])
def test_positions_are_those_of_gdal(longitude: float) -> None:
    rpc = across(longitude)
    ground = np.random.default_rng(0).uniform(-1, 1, (200, 3)) * rpc.scale + rpc.offset
    lon_lat = by_turns(ground[:, :2])
    expected = rasterio_project(to_rasterio(rpc), lon_lat, ground[:, 2])
    assert np.ptp(lon_lat[:, 0]) > 359
    np.testing.assert_allclose(rpc.project(lon_lat, ground[:, 2]), expected, atol=1e-6)
    assert rpc.is_valid(lon_lat, ground[:, 2]).all()
    unknown = np.array([[np.nan, 45.0], [np.inf, 45.0], [-179.9999, rpc.offset[1]]])
    assert np.isfinite(rpc.project(unknown, 300.0)).all(axis=1).tolist() == [False, False, True]


@pytest.mark.parametrize("crs", ["EPSG:4326", "EPSG:32660", "EPSG:32601"])
@pytest.mark.parametrize("longitude", [180.0, -180.0])
def test_an_orthoimage_is_whole(tmp_path: Path, longitude: float, crs: str) -> None:
    rpc = across(longitude)
    image = write_positions(tmp_path / "image.tif", rpc)
    groundtie.orthorectify(image, tmp_path / "ortho.tif", height=300.0, crs=crs)
    require_positions(tmp_path / "ortho.tif", rpc, lambda lon: np.full(len(lon), 300.0))


@pytest.mark.parametrize("longitude", [180.0, -180.0, 179.998])
@pytest.mark.parametrize("crs", ["EPSG:3857", "EPSG:6933", "ESRI:54008"])
def test_a_map_that_ends_within_the_image_is_refused(
    tmp_path: Path, longitude: float, crs: str
) -> None:
    image = write_positions(tmp_path / "image.tif", across(longitude))
    ortho = tmp_path / "ortho.tif"
    with pytest.raises(GeoreferencingError, match=r"both edges of the map .* take another CRS"):
        groundtie.orthorectify(image, ortho, height=300.0, crs=crs)
    # Beside the edge, it is a map as any.
    write_positions(image, across(longitude - 0.1))
    groundtie.orthorectify(image, ortho, height=300.0, crs=crs)
    with rasterio.open(ortho) as written:
        assert np.isfinite(written.read(1)).sum() == pytest.approx(600 * 500, rel=0.05)


def require_positions(path: Path, rpc: RPC, heights: Callable[[np.ndarray], np.ndarray]) -> None:
    """Require that an orthoimage of columns and rows shows all of the image where GDAL does."""
    with rasterio.open(path) as ortho:
        own = ortho.read()
        rows, cols = np.nonzero(np.isfinite(own).all(axis=0))
        x, y = apply_affine(ortho.transform, np.column_stack([cols, rows]) + 0.5).T
        lon_lat = np.column_stack(transform(ortho.crs, "EPSG:4326", x, y)[:2])
    expected = rasterio_project(to_rasterio(rpc), lon_lat, heights(lon_lat[:, 0]))
    assert len(x) == pytest.approx(600 * 500, rel=0.05)
    # The outermost pixels' halves hold the values of their centres.
    expected = np.clip(expected, 0, [599, 499])
    assert np.abs(own[:, rows, cols].T - expected).max() < 0.05


@pytest.mark.parametrize("west", [179.99, -180.01])
def test_the_grid_of_a_reference_is_filled(tmp_path: Path, west: float) -> None:
    """Whichever side's longitudes it continues."""
    image = write_positions(tmp_path / "image.tif", across(180.0))
    grid = Grid(Affine(1e-4, 0, west, 0, -1e-4, 45.16), LON_LAT, 200, 200)
    reference = write_raster(tmp_path / "reference.tif", np.ones((200, 200), np.uint8), grid)
    groundtie.orthorectify(image, tmp_path / "ortho.tif", height=300.0, reference=reference)
    with rasterio.open(tmp_path / "ortho.tif") as ortho:
        valid = np.isfinite(ortho.read(1)).sum()
    metres = 11.1195
    assert valid == pytest.approx(600 * 500 / metres**2 / np.cos(np.deg2rad(45.15)), rel=0.05)


@pytest.mark.parametrize(
    ("middle", "west", "east", "step"),
    [
        (180.0, 179.8, 180.2, 0.001),
        (180.0, -180.2, -179.8, 0.001),
        (-180.0, 179.8, 180.2, 0.001),
        (-100.0, 259.8, 260.2, 0.001),
        (-100.0, 0.0, 360.0, 0.1),
        (180.0, 0.0, 360.0, 0.1),
    ],
)
def test_heights_are_found_by_either_longitude(
    tmp_path: Path, middle: float, west: float, east: float, step: float
) -> None:
    path = write_slope(tmp_path / "dem.tif", middle, west, east, step)
    region = np.array([[middle - 0.005, 45.14], [middle + 0.005, 45.16]])
    places = np.random.default_rng(0).uniform(*region, (100, 2))
    with open_raster(path) as dem:
        heights = terrain_heights(dem, None, region)
        for each in (places, by_turns(places)):
            np.testing.assert_allclose(heights.at(each), slope(places[:, 0], middle), atol=0.5)


def test_a_geoid_of_the_whole_earth_serves_both_sides(tmp_path: Path) -> None:
    grid = Grid(Affine(0.25, 0, -180.125, 0, -0.25, 90.125), LON_LAT, 1440, 721)
    geoid = write_raster(tmp_path / "geoid.tif", np.full((721, 1440), 40, np.float32), grid)
    dem = write_slope(tmp_path / "dem.tif", 180.0, 179.8, 180.2, 0.001)
    region = np.array([[179.995, 45.14], [180.005, 45.16]])
    with open_raster(dem) as terrain, open_raster(geoid) as undulation:
        heights = terrain_heights(terrain, undulation, region)
        places = np.random.default_rng(0).uniform(*region, (100, 2))
        np.testing.assert_allclose(heights.at(places), slope(places[:, 0], 180.0) + 40, atol=0.5)


@pytest.mark.parametrize("middle", [179.8, 179.88, 179.99, 180.0, -179.95])
@pytest.mark.parametrize("first", [-180.0, -179.875, 0.0])
def test_a_geoid_is_interpolated_where_its_first_and_last_column_meet(
    tmp_path: Path, middle: float, first: float
) -> None:
    middle += first + 180
    lon = first + 0.25 * np.arange(1440)
    undulations = 20 + 40 * np.cos(np.deg2rad(lon - first - 60))
    grid = Grid(Affine(0.25, 0, first - 0.125, 0, -0.25, 90.125), LON_LAT, 1440, 721)
    rows = np.broadcast_to(undulations.astype(np.float32), (721, 1440))
    geoid = write_raster(tmp_path / "geoid.tif", rows, grid)
    dem = write_slope(tmp_path / "dem.tif", middle, middle - 0.2, middle + 0.2, 0.001)
    region = np.array([[middle - 0.04, 45.14], [middle + 0.04, 45.16]])
    places = np.random.default_rng(0).uniform(*region, (200, 2))
    expected = np.interp(places[:, 0], lon, undulations, period=360)
    with open_raster(dem) as terrain, open_raster(geoid) as undulation:
        plain = terrain_heights(terrain, None, region)
        raised = terrain_heights(terrain, undulation, region)
        for each in (places, by_turns(places)):
            np.testing.assert_allclose(raised.at(each) - plain.at(each), expected, atol=1e-3)


@pytest.mark.parametrize("crs", ["EPSG:4326", "EPSG:4258", "EPSG:32660"])
def test_errors_are_those_of_the_rpcs(tmp_path: Path, crs: str) -> None:
    truth = across(180.0)
    image = write_positions(tmp_path / "image.tif", truth.shifted((3.0, 4.0)))
    px = np.random.default_rng(0).uniform(20, 480, (12, 2))
    ground = by_turns(truth.localise(px, 300.0))
    x, y = transform("EPSG:4326", crs, *ground.T)
    lines = ["reference_x,reference_y,height_m,input_col,input_row,reference_crs"]
    for place in zip(x, y, *px.T, strict=True):
        east, north, col, row = (repr(float(value)) for value in place)
        lines.append(f"{east},{north},300,{col},{row},{crs}")
    points = tmp_path / "points.csv"
    points.write_text("\n".join(lines))
    found = groundtie.assess_sensor(image, points, height=300.0).errors["before"]
    np.testing.assert_allclose(found.error_px, [(-3.0, -4.0)] * 12, atol=1e-5)
    np.testing.assert_allclose(np.hypot(*found.error_m.T), 5.0, rtol=0.01)
    refined = tmp_path / "refined.txt"
    groundtie.refine_rpc(image, refined, gcps=points, height=300.0, model="shift")
    np.testing.assert_allclose(read_rpc(refined).project(ground, 300.0), px, atol=1e-3)


def test_an_orthoimage_by_a_terrain_model_is_whole(tmp_path: Path) -> None:
    rpc = across(180.0)
    image = write_positions(tmp_path / "image.tif", rpc)
    dem = write_slope(tmp_path / "dem.tif", 180.0, 179.8, 180.2, 0.001)
    output = tmp_path / "ortho.tif"
    groundtie.orthorectify(image, output, dem, dem_datum="ellipsoidal", crs="EPSG:32660")
    require_positions(output, rpc, lambda lon: slope(lon, 180.0))
