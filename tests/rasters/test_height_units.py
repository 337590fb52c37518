from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine
from raster_files import write_raster
from rasterio.crs import CRS

from groundtie.arrays import Raster
from groundtie.errors import RasterContentError
from groundtie.masks.object_heights import RasterModel
from groundtie.rasters.grid import Grid
from groundtie.rasters.height_surfaces import read_heights, surface_around
from groundtie.rasters.height_units import in_metres
from groundtie.rasters.reading import open_raster
from groundtie.rasters.rendered import SUN, Light, rendered

UTM = "EPSG:32633"
FEET = "EPSG:32633+6360"  # NAVD 88 in US survey feet
ROWS, COLS = np.mgrid[:30, :40]
HEIGHTS_M = 500 + 20 * np.sin(COLS / 5) + 15 * np.cos(ROWS / 7)
VOID = np.s_[10:13, 20:24]


def stored(path: Path, form: str) -> Path:
    """Write HEIGHTS_M, with a void, in some form."""
    metres, scale, offset, unit, crs = {
        "metres": (1, 1, 0, "m", UTM),
        "scaled": (1, 0.1, 0, None, UTM),
        "offset": (1, 1, 400, None, UTM),
        "feet": (0.3048, 1, 0, "ft", UTM),
        "scaled feet": (0.3048, 0.01, -100, "foot", UTM),
        "survey feet": (1200 / 3937, 1, 0, "US survey foot", UTM),
        "vertical CRS": (1200 / 3937, 1, 0, None, FEET),
        "metres in spite of the CRS": (1, 1, 0, "metre", FEET),
        "centimetres": (0.01, 1, 0, "cm", UTM),
    }[form]
    values = (HEIGHTS_M / metres - offset) / scale
    # A height that in metres there may be.
    values[VOID] = 1000
    grid = Grid(Affine(10, 0, 4e5, 0, -10, 5e6), CRS.from_user_input(crs), 40, 30)
    write_raster(path, values.astype(np.float32), grid, nodata=1000)
    with rasterio.open(path, "r+") as dataset:
        dataset.scales, dataset.offsets = (scale,), (offset,)
        if unit is not None:
            dataset.units = (unit,)
    return path


FORMS = ["metres", "scaled", "offset", "feet", "scaled feet", "survey feet", "vertical CRS"]
FORMS += ["metres in spite of the CRS", "centimetres"]


@pytest.mark.parametrize("form", FORMS)
def test_heights_are_metres_however_they_are_stored(tmp_path: Path, form: str) -> None:
    void = np.zeros(HEIGHTS_M.shape, bool)
    void[VOID] = True
    with open_raster(stored(tmp_path / "dem.tif", form)) as dem:
        values, valid = read_heights(dem, dem.window)
        np.testing.assert_array_equal(valid, ~void)
        np.testing.assert_allclose(values[valid], HEIGHTS_M[valid], atol=1e-3)
        surface = surface_around(
            dem, dem.grid.map_to_pixel, dem.grid.pixel_to_map([[0, 0], [39, 29]])
        )
        found = surface.at(dem.grid.pixel_to_map([[3, 4], [30, 20]]))
        np.testing.assert_allclose(found, HEIGHTS_M[[4, 20], [3, 30]], atol=1e-3)


@pytest.mark.parametrize("form", ["scaled", "feet", "vertical CRS"])
def test_what_is_rendered_and_what_stands_are_of_metres(tmp_path: Path, form: str) -> None:
    with (
        open_raster(stored(tmp_path / "plain.tif", "metres")) as plain,
        open_raster(stored(tmp_path / "dem.tif", form)) as dem,
    ):
        light = Light(SUN, 100.0)
        expected, valid = rendered(plain, light).read(plain.window)
        found, also_valid = rendered(dem, light).read(dem.window)
        np.testing.assert_array_equal(also_valid, valid)
        np.testing.assert_allclose(found, expected, atol=1e-4)
        (expected_m, _), (found_m, _) = (
            RasterModel(model).heights(plain.grid) for model in (plain, dem)
        )
        np.testing.assert_allclose(found_m.surface_m, expected_m.surface_m, atol=1e-3)


def test_other_bands_are_no_heights(tmp_path: Path) -> None:
    """As a band of errors or of sources, which many products have beside their heights."""
    grid = {"transform": Affine(10, 0, 4e5, 0, -10, 5e6), "crs": UTM}
    heights = np.stack([np.full((30, 40), height, np.float32) for height in (30, 100)])
    source = open_raster(Raster(heights, **grid))
    found, _ = RasterModel(source).heights(source.grid)
    np.testing.assert_array_equal(found.surface_m, 30)


def test_a_unit_that_is_not_known_is_refused(tmp_path: Path) -> None:
    path = stored(tmp_path / "dem.tif", "metres")
    with rasterio.open(path, "r+") as dataset:
        dataset.units = ("furlong",)
    with open_raster(path) as dem, pytest.raises(RasterContentError, match=r"unit .*furlong"):
        read_heights(dem, dem.window)


def test_arrays_have_the_unit_of_their_crs() -> None:
    values = np.full((30, 40), 1000, np.float32)
    place = Affine(10, 0, 4e5, 0, -10, 5e6)
    assert in_metres(values, open_raster(Raster(values, place, UTM))) is values
    in_feet = in_metres(values, open_raster(Raster(values, place, FEET)))
    np.testing.assert_allclose(in_feet, 1000 * 1200 / 3937, rtol=1e-6)


@pytest.mark.parametrize(
    ("unit", "metres"),
    [
        ("US survey foot", 1200 / 3937),
        ("foot (US survey)", 1200 / 3937),
        ("Foot_US", 1200 / 3937),
        ("us-ft", 1200 / 3937),
        ("survey feet", 1200 / 3937),
        ("feet", 0.3048),
        ("foot (international)", 0.3048),
        ("International Feet", 0.3048),
    ],
)
def test_feet_have_many_names(tmp_path: Path, unit: str, metres: float) -> None:
    path = write_raster(tmp_path / "dem.tif", np.full((4, 5), 1000, np.float32))
    with rasterio.open(path, "r+") as dataset:
        dataset.units = (unit,)
    with open_raster(path) as source:
        heights, _ = read_heights(source, source.window)
    np.testing.assert_allclose(heights, 1000 * metres, rtol=1e-6)
