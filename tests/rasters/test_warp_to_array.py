"""Rasters warped into memory hold what their files would."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from raster_files import utm_grid, waves, write_raster

from groundtie.arrays import Raster
from groundtie.errors import ParameterError
from groundtie.rasters import tiling
from groundtie.rasters.delivery import warp_raster, warp_to_array
from groundtie.rasters.grid import Grid
from groundtie.rasters.reading import open_raster

RNG = np.random.default_rng(0)
GRID = utm_grid(90, 70)
TARGET = utm_grid(80, 75, 11.0)
IMAGE = RNG.integers(1, 200, (3, 70, 90))
MASK = RNG.random((70, 90)) > 0.1


@pytest.fixture(autouse=True)
def _small_tiles(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tiling, "_TILE", 32)
    monkeypatch.setattr(tiling, "_TILE_BYTES", 32 * 32 * 8)


def both_ways(path: Path, target: Grid, **more: Any) -> tuple[Raster, Any]:
    """Return a raster warped into memory, and the open file of the same warp."""
    source = open_raster(path)

    def to_px(xy: Any) -> Any:
        return source.grid.map_to_pixel(xy + [7.0, -12.0])

    out = path.with_name("out.tif")
    warp_raster(source, to_px, target, out, **more)
    return warp_to_array(source, to_px, target, **more), rasterio.open(out)


@pytest.mark.parametrize("target", [GRID, TARGET, GRID.window(30, 20, 20, 20)])
@pytest.mark.parametrize(
    ("dtype", "stated"),
    [
        ("uint8", {}),
        ("uint8", {"nodata": 7}),
        ("uint8", {"mask": MASK}),
        ("int16", {"nodata": -5}),
        ("float32", {}),
        ("complex64", {}),
    ],
)
def test_the_array_is_the_file(
    tmp_path: Path, target: Grid, dtype: str, stated: dict[str, Any]
) -> None:
    path = write_raster(tmp_path / "a.tif", IMAGE.astype(dtype), GRID, **stated)
    found, expected = both_ways(path, target)
    with expected:
        assert (found.transform, found.crs) == (expected.transform, expected.crs)
        assert (found.values.dtype, found.values.shape) == (dtype, (3, *expected.shape))
        np.testing.assert_equal(found.nodata, expected.nodata)
        np.testing.assert_array_equal(np.ma.getdata(found.values), expected.read())
        has_mask = rasterio.enums.MaskFlags.per_dataset in expected.mask_flag_enums[0]
        assert isinstance(found.values, np.ma.MaskedArray) == has_mask
        if has_mask:
            masked = np.ma.getmaskarray(found.values)[0]
            np.testing.assert_array_equal(masked, expected.read_masks(1) == 0)


def test_an_array_of_an_array() -> None:
    """A smooth field, moved by a shift, is the field again when the shift is taken out."""
    cols, rows = np.meshgrid(np.arange(90), np.arange(70))
    xy = GRID.pixel_to_map(np.column_stack([cols.ravel(), rows.ravel()]))
    field = waves(xy - [13.0, 4.0], 600).reshape(70, 90)
    with open_raster(Raster(field, GRID.transform, GRID.crs)) as source:
        found = warp_to_array(source, lambda xy: GRID.map_to_pixel(xy + [13.0, 4.0]), GRID)
    expected = waves(xy, 600).reshape(70, 90)
    assert np.abs(found.values[0] - expected)[5:-5, 5:-5].max() < 0.05
    assert np.isnan(found.values).any()  # what came into sight


def test_pixel_coordinates_stay() -> None:
    image = RNG.random((40, 50))
    with open_raster(image) as source:
        found = warp_to_array(source, source.grid.map_to_pixel, source.grid)
    assert (found.transform, found.crs) == (None, None)
    np.testing.assert_array_equal(found.values[0], image)


def test_a_nodata_value_that_does_not_fit() -> None:
    image = Raster(np.zeros((40, 50), np.uint8), nodata=-1)
    with open_raster(image) as source, pytest.raises(ParameterError):
        warp_to_array(source, source.grid.map_to_pixel, source.grid)


def test_a_part_of_plain_pixels_keeps_its_place(tmp_path: Path) -> None:
    """Pixels without georeferencing: another lattice on them needs a geotransform, its own none."""
    path = write_raster(tmp_path / "in.tif", IMAGE.astype(np.uint8))
    own = open_raster(path).grid
    for target, expected in (
        (own, None),
        (own.window(30, 20, 20, 20), Affine.translation(29.5, 19.5)),
    ):
        array, file = both_ways(path, target)
        with file:
            assert array.transform == expected
            assert file.transform == (expected or Affine.identity())
