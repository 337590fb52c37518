"""Masks by values lie where their own map says, whatever their grid."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rasterio
from raster_files import UTM, utm_grid, write_raster
from rasterio.warp import calculate_default_transform, reproject

from groundtie.masks.scene import Scene
from groundtie.masks.values import RasterMask, mask_values
from groundtie.rasters.reading import Window, open_raster

GRID = utm_grid(80, 60, 2.0)


def scene_of(folder: Path) -> Scene:
    image = np.ones((60, 80), np.uint8)
    image[:5] = 0
    return Scene.of(open_raster(write_raster(folder / "a.tif", image, GRID, nodata=0)))


def classes(cols: int, rows: int) -> np.ndarray:
    """Return a classification of clear ground with a cloud over the right half."""
    values = np.full((rows, cols), 4, np.uint8)
    values[:, cols // 2 :] = 9
    return values


def test_a_coarser_mask_covers_the_pixels_below_its_own(tmp_path: Path) -> None:
    coarse = utm_grid(8, 6, 20.0)
    path = write_raster(tmp_path / "m.tif", classes(8, 6), coarse)
    mask = RasterMask(scene_of(tmp_path), open_raster(path), mask_values("scl"))
    chosen = mask.select(mask.scene.whole)
    expected = np.zeros((60, 80), bool)
    expected[5:, :40] = True
    np.testing.assert_array_equal(chosen.part, expected)
    np.testing.assert_array_equal(mask.select(Window(33, 20, 20, 10)).part, expected[20:30, 33:53])


def test_what_a_finer_mask_leaves_out_is_left_out_however_narrow(tmp_path: Path) -> None:
    values = np.full((180, 240), 4, np.uint8)
    values[:, 0:120:3] = 9
    path = write_raster(tmp_path / "m.tif", values, utm_grid(240, 180, 2.0 / 3))
    mask = RasterMask(scene_of(tmp_path), open_raster(path), mask_values("scl"))
    expected = np.zeros((60, 80), bool)
    expected[5:, 40:] = True
    np.testing.assert_array_equal(mask.select(mask.scene.whole).part, expected)
    np.testing.assert_array_equal(mask.select(Window(33, 20, 20, 10)).part, expected[20:30, 33:53])


def test_a_mask_on_another_map_lies_where_it_should(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "utm.tif", classes(80, 60), GRID)
    with rasterio.open(path) as source:
        transform, width, height = calculate_default_transform(
            UTM, "EPSG:4326", source.width, source.height, *source.bounds, resolution=5e-6
        )
        profile = {"driver": "GTiff", "count": 1, "dtype": "uint8", "crs": "EPSG:4326"}
        size = {"width": width, "height": height, "transform": transform}
        with rasterio.open(tmp_path / "deg.tif", "w", **profile, **size) as target:
            reproject(rasterio.band(source, 1), rasterio.band(target, 1))
    mask = RasterMask(scene_of(tmp_path), open_raster(tmp_path / "deg.tif"), mask_values("9,0"))
    part = mask.select(mask.scene.whole).part
    assert part[6:59, 1:39].all() and not part[:, 41:].any()


def test_nodata_of_a_mask_is_a_value_and_beyond_it_nothing_takes_part(tmp_path: Path) -> None:
    """Cloud masks state 0 as nodata, and mean clear sky."""
    values = np.zeros((60, 40), np.uint8)
    values[:, :10] = 1
    path = write_raster(tmp_path / "m.tif", values, utm_grid(40, 60, 2.0), nodata=0)
    mask = RasterMask(scene_of(tmp_path), open_raster(path), mask_values("1"))
    part = mask.select(mask.scene.whole).part
    assert not part[:, :10].any() and part[5:, 10:40].all() and not part[:, 40:].any()
