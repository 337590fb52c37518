from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from affine import Affine
from raster_files import write_raster
from rasterio.crs import CRS
from rpc_models import relief, write_dem
from scipy.interpolate import RegularGridInterpolator

from groundtie.errors import GeoreferencingError, NoOverlapError, RasterContentError
from groundtie.rasters.grid import LON_LAT, Grid, reproject
from groundtie.rasters.reading import open_raster
from groundtie.sensor.geoids import declared_datum, find_geoid
from groundtie.sensor.heights import ConstantHeight, surface_over, terrain_heights

REGION = np.array([[8.998, 45.148], [9.002, 45.152]])
PLACES = np.random.default_rng(0).uniform(*REGION, (400, 2))


def write_geoid(path: Path, crs: str = "EPSG:4326") -> Path:
    """Write undulations that rise to the north-east, 0.25° apart."""
    grid = Grid(Affine(0.25, 0, 7.875, 0, -0.25, 46.125), CRS.from_user_input(crs), 9, 9)
    rows, cols = np.mgrid[:9, :9]
    return write_raster(path, (48 + 0.8 * cols - 0.5 * rows).astype(np.float32), grid)


def undulation(lon_lat: np.ndarray) -> np.ndarray:
    return 48 + 0.8 * (lon_lat[:, 0] - 8.0) / 0.25 - 0.5 * (46.0 - lon_lat[:, 1]) / 0.25


@pytest.mark.parametrize("crs", ["EPSG:4326", "EPSG:32632", "EPSG:3035"])
def test_heights_are_bilinear_between_the_pixels_of_any_crs(tmp_path: Path, crs: str) -> None:
    with open_raster(write_dem(tmp_path / "dem.tif", crs)) as dem:
        values = dem.read(dem.window)[0]
        px = dem.grid.map_to_pixel(reproject(PLACES, LON_LAT, dem.grid.crs))
        found = terrain_heights(dem, None, REGION).at(PLACES)
    expected = RegularGridInterpolator((np.arange(60), np.arange(60)), values)(px[:, ::-1])
    assert np.abs(found - expected).max() < 0.01
    # What bilinear interpolation of 25 m pixels leaves of this relief.
    assert np.abs(found - relief(PLACES)).max() < 4


def test_heights_above_a_geoid_are_raised_by_it(tmp_path: Path) -> None:
    with (
        open_raster(write_dem(tmp_path / "dem.tif")) as dem,
        open_raster(write_geoid(tmp_path / "geoid.tif")) as geoid,
    ):
        plain = terrain_heights(dem, None, REGION)
        raised = terrain_heights(dem, geoid, REGION)
        np.testing.assert_allclose(
            raised.at(PLACES) - plain.at(PLACES), undulation(PLACES), atol=1e-4
        )
        assert abs(raised.typical_m - plain.typical_m - 48) < 5


@pytest.mark.slow
def test_large_regions_are_read_in_blocks(tmp_path: Path) -> None:
    size = 2600
    grid = Grid(Affine(1e-4, 0, 8.9, 0, -1e-4, 45.3), LON_LAT, size, size)
    rows, cols = np.mgrid[:size, :size]
    write_raster(tmp_path / "dem.tif", (0.1 * cols + 0.2 * rows).astype(np.float32), grid)
    px = np.random.default_rng(1).uniform(0, size - 1, (5000, 2))
    lon_lat = grid.pixel_to_map(px)
    with open_raster(tmp_path / "dem.tif") as dem:
        found = surface_over(dem, lon_lat).at(lon_lat)
    np.testing.assert_allclose(found, px @ [0.1, 0.2], atol=1e-3)


def test_voids_are_filled_also_those_that_nobody_declared(tmp_path: Path) -> None:
    holes = np.zeros((60, 60), bool)
    holes[28:33, 27:32] = True
    path = write_dem(tmp_path / "dem.tif", holes=holes)
    undeclared = write_dem(tmp_path / "bad.tif", holes=holes, nodata=-1)
    for each in (path, undeclared):
        with open_raster(each) as dem:
            surface = surface_over(dem, REGION)
            found = surface.at(PLACES)
        assert np.abs(found - relief(PLACES)).max() < 60


@pytest.mark.parametrize("crs", ["EPSG:4326", "EPSG:32632"])
def test_beyond_the_region_heights_are_known_but_voids_are_not_filled(
    tmp_path: Path, crs: str
) -> None:
    holes = np.zeros((60, 60), bool)
    holes[:, 52:56] = True
    with open_raster(write_dem(tmp_path / "dem.tif", crs, holes=holes)) as dem:
        values = np.where(holes, np.nan, dem.read(dem.window)[0])
        place = np.stack(np.meshgrid(np.arange(59.0), np.arange(59.0)), -1).reshape(-1, 2) + 0.3
        lon_lat = reproject(dem.grid.pixel_to_map(place), dem.grid.crs, LON_LAT)
        heights = terrain_heights(dem, None, REGION)
        found, measured = heights.at(lon_lat), heights.is_measured(lon_lat)
    expected = RegularGridInterpolator((np.arange(60), np.arange(60)), values)(place[:, ::-1])
    np.testing.assert_allclose(found, expected, atol=0.02, equal_nan=True)
    np.testing.assert_array_equal(measured, np.isfinite(expected))


def test_beyond_the_terrain_model_heights_are_not_known(tmp_path: Path) -> None:
    with open_raster(write_dem(tmp_path / "dem.tif")) as dem:
        heights = terrain_heights(dem, None, REGION)
        found = heights.at(np.array([[9.0, 45.15], [9.5, 45.15], [np.nan, 45.0]]))
    assert np.isfinite(found).tolist() == [True, False, False]


@pytest.mark.parametrize(
    ("changes", "error"),
    [
        ({"crs": None}, GeoreferencingError),
        ({"transform": Affine(0.001, 0, 40, 0, -0.001, 20)}, NoOverlapError),
        ({"nodata": 5.0}, RasterContentError),
    ],
)
def test_what_is_no_terrain_model_is_refused(
    tmp_path: Path, changes: dict[str, object], error: type[Exception]
) -> None:
    profile = {"crs": LON_LAT, "transform": Affine(0.001, 0, 8.95, 0, -0.001, 45.2)} | changes
    write_raster(tmp_path / "dem.tif", np.full((100, 100), 5, np.float32), **profile)
    with open_raster(tmp_path / "dem.tif") as dem, pytest.raises(error, match=r"dem\.tif"):
        terrain_heights(dem, None, REGION)


def test_a_geoid_that_does_not_cover_is_named(tmp_path: Path) -> None:
    write_raster(
        tmp_path / "geoid.tif",
        np.ones((4, 4), np.float32),
        crs=LON_LAT,
        transform=Affine(1, 0, 40, 0, -1, 20),
    )
    with (
        open_raster(write_dem(tmp_path / "dem.tif")) as dem,
        open_raster(tmp_path / "geoid.tif") as geoid,
        pytest.raises(NoOverlapError, match="geoid cannot be used"),
    ):
        terrain_heights(dem, geoid, REGION)


def test_a_constant_height_is_the_same_everywhere() -> None:
    heights = ConstantHeight(560.0)
    assert np.all(heights.at(PLACES) == 560.0)
    assert heights.typical_m == 560.0


def test_projs_geoid_grids_are_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PROJ_DATA", str(tmp_path))
    assert find_geoid("ellipsoidal") is None
    (tmp_path / "egm08_25.gtx").touch()
    assert find_geoid("EGM2008") == tmp_path / "egm08_25.gtx"


def test_a_geoid_grid_that_is_not_installed_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("groundtie.sensor.geoids._proj_folders", lambda: [])
    with pytest.raises(GeoreferencingError, match=r"us_nga_egm96_15\.tif"):
        find_geoid("EGM96")


@pytest.mark.parametrize(
    ("crs", "expected"),
    [
        ("EPSG:4326", None),
        ("EPSG:4979", "ellipsoidal"),
        ("EPSG:4326+5773", "EGM96"),
        ("EPSG:4326+3855", "EGM2008"),
        ("EPSG:4326+5798", "EGM84 height"),
        ("EPSG:32632+5703", "NAVD88 height"),
        ("EPSG:32632+6360", "NAVD88 height (ftUS)"),
        ("EPSG:4326+5783", "DHHN92 height"),
    ],
)
def test_a_crs_names_the_datum(tmp_path: Path, crs: str, expected: str | None) -> None:
    with open_raster(write_dem(tmp_path / "dem.tif", crs)) as dem:
        assert declared_datum(dem.grid.crs) == expected
