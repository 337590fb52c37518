"""Bands that hold no data at different pixels, or say so in different ways."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from raster_files import utm_grid, write_raster

from groundtie.arrays import Raster
from groundtie.errors import ParameterError
from groundtie.rasters.delivery import warp_raster, warp_to_array, write_with_geotransform
from groundtie.rasters.reading import RasterSource, open_raster
from groundtie.tools.filter_speckle import filter_speckle

GRID = utm_grid(40, 30)
HOLE = np.s_[5:15, 10:20]

EXACT_IN_64_BITS = pytest.mark.skipif(
    rasterio.__version__ < "1.4",
    reason="masks by nodata values of 64 bits are computed in double precision",
)


def virtual(folder: Path, values: np.ndarray, kind: str, nodata: tuple[Any, ...]) -> Path:
    """Return a virtual raster of bands, each with its own nodata value."""
    write_raster(folder / "a.tif", values, GRID)
    bands = "".join(
        f'<VRTRasterBand dataType="{kind}" band="{i}">'
        + ("" if value is None else f"<NoDataValue>{value}</NoDataValue>")
        + '<SimpleSource><SourceFilename relativeToVRT="1">a.tif</SourceFilename>'
        f"<SourceBand>{i}</SourceBand></SimpleSource></VRTRasterBand>"
        for i, value in enumerate(nodata, start=1)
    )
    path = folder / "a.vrt"
    size = f'rasterXSize="{GRID.width}" rasterYSize="{GRID.height}"'
    place = ", ".join(map(repr, GRID.transform.to_gdal()))
    path.write_text(
        f"<VRTDataset {size}><SRS>EPSG:32632</SRS>"
        f"<GeoTransform>{place}</GeoTransform>{bands}</VRTDataset>"
    )
    return path


def assert_refused(source: RasterSource, folder: Path, match: str) -> None:
    """Assert that no raster of all bands is written."""
    moved = GRID.shifted(3, -2)
    with pytest.raises(ParameterError, match=match):
        warp_raster(source, source.grid.map_to_pixel, GRID, folder / "out.tif")
    with pytest.raises(ParameterError, match=match):
        warp_to_array(source, source.grid.map_to_pixel, GRID)
    with pytest.raises(ParameterError, match=match):
        write_with_geotransform(source, moved, folder / "out.tif")
    assert not (folder / "out.tif").exists()


@pytest.mark.parametrize("nodata", [(0, -9999), (None, -9999), (-9999, None)])
def test_different_nodata_values_have_no_place_in_a_geotiff(
    tmp_path: Path, nodata: tuple[Any, ...]
) -> None:
    values = np.full((2, 30, 40), 50, np.int16)
    for band, value in zip(values, nodata, strict=True):
        band[HOLE] = 50 if value is None else value
    path = virtual(tmp_path, values, "Int16", nodata)
    with open_raster(path) as source:
        assert_refused(source, tmp_path, "different nodata values .*-9999")
        for band, value in enumerate(nodata, start=1):
            assert source.read(source.window, band)[1][HOLE].any() == (value is None)
    with pytest.raises(ParameterError, match="different nodata values"):
        filter_speckle(path, tmp_path / "out.tif", looks=4)


def test_nan_is_no_data_whether_or_not_that_is_declared(tmp_path: Path) -> None:
    values = np.full((2, 30, 40), 50, np.float32)
    values[:, 5:15, 10:20] = np.nan
    with open_raster(virtual(tmp_path, values, "Float32", (None, "nan"))) as source:
        write_with_geotransform(source, GRID, tmp_path / "out.tif")
    with rasterio.open(tmp_path / "out.tif") as dataset:
        np.testing.assert_array_equal(dataset.read_masks() == 0, np.isnan(values))


def test_different_masks_have_no_place_in_a_geotiff(tmp_path: Path) -> None:
    mask = np.zeros((2, 30, 40), bool)
    mask[1][HOLE] = True
    values = np.ma.MaskedArray(np.full(mask.shape, 50, np.uint8), mask)
    with open_raster(Raster(values, GRID.transform, GRID.crs)) as source:
        assert_refused(source, tmp_path, "at different pixels.* instead of masks")
        assert not source.read(source.window, 2)[1][HOLE].any()
        assert source.read(source.window, 1)[1].all()


def test_one_mask_of_all_bands_is_kept(tmp_path: Path) -> None:
    mask = np.zeros((2, 30, 40), bool)
    mask[:, 5:15, 10:20] = True
    values = np.ma.MaskedArray(np.full(mask.shape, 50, np.uint8), mask)
    with open_raster(Raster(values, GRID.transform, GRID.crs)) as source:
        write_with_geotransform(source, GRID, tmp_path / "out.tif")
    with rasterio.open(tmp_path / "out.tif") as dataset:
        np.testing.assert_array_equal(dataset.read_masks() == 0, mask)


def test_nan_of_complex_numbers_stays_no_data_within_the_image(tmp_path: Path) -> None:
    values = np.full((2, 30, 40), 50 + 1j, np.complex64)
    values[:, 5:15, 10:20] = np.nan
    with open_raster(Raster(values, GRID.transform, GRID.crs)) as source:
        warp_raster(source, source.grid.map_to_pixel, GRID, tmp_path / "out.tif")
        array = warp_to_array(source, source.grid.map_to_pixel, GRID)
    with rasterio.open(tmp_path / "out.tif") as dataset:
        np.testing.assert_array_equal(dataset.read_masks() == 0, np.isnan(values))
    np.testing.assert_array_equal(np.ma.getmaskarray(array.values), np.isnan(values))


@pytest.mark.parametrize("bands", [2, 20])
def test_nan_of_complex_numbers_at_different_pixels_has_no_place(
    tmp_path: Path, bands: int
) -> None:
    """One mask cannot tell it, in bands that are worked through together or not."""
    values = np.full((bands, 30, 40), 50 + 1j, np.complex64)
    values[-1][HOLE] = np.nan
    with open_raster(Raster(values, GRID.transform, GRID.crs)) as source:
        with pytest.raises(ParameterError, match="at different pixels"):
            warp_raster(source, source.grid.map_to_pixel, GRID, tmp_path / "out.tif")
        with pytest.raises(ParameterError, match="at different pixels"):
            warp_to_array(source, source.grid.map_to_pixel, GRID)


@EXACT_IN_64_BITS
@pytest.mark.parametrize(
    ("kind", "nodata"),
    [("Int64", -(2**63)), ("Int64", -(10**17)), ("Int64", 2**63 - 1), ("UInt64", 2**64 - 1)],
)
def test_nodata_values_of_64_bits(tmp_path: Path, kind: str, nodata: int) -> None:
    values = np.full((1, 30, 40), 50, kind.lower())
    values[0][HOLE] = nodata
    hole = values == nodata
    with open_raster(virtual(tmp_path, values, kind, (nodata,))) as source:
        np.testing.assert_array_equal(source.read_bands(source.window)[1], ~hole)
        warp_raster(source, source.grid.map_to_pixel, GRID, tmp_path / "warped.tif")
        write_with_geotransform(source, GRID, tmp_path / "untouched.tif")
    for name in ("warped.tif", "untouched.tif"):
        with rasterio.open(tmp_path / name) as dataset:
            np.testing.assert_array_equal(dataset.read_masks() == 0, hole)
            np.testing.assert_array_equal(dataset.read()[~hole], 50)


@EXACT_IN_64_BITS
def test_a_nodata_value_of_64_bits_of_an_array(tmp_path: Path) -> None:
    nodata = 2**63 - 1
    values = np.full((600, 600), 50, np.int64)
    values[:300] = nodata
    with open_raster(Raster(values, GRID.transform, GRID.crs, nodata)) as source:
        write_with_geotransform(source, source.grid, tmp_path / "out.tif")
    for level in ({}, {"overview_level": 0}):
        with rasterio.open(tmp_path / "out.tif", **level) as dataset:
            valid = dataset.read_masks(1) > 0
            assert not valid[: dataset.height // 2].any()
            assert valid[dataset.height // 2 :].all()
            np.testing.assert_array_equal(np.unique(dataset.read()), [50, nodata])


def test_masks_of_single_bands_count(tmp_path: Path) -> None:
    """GDAL's VRT has them; only where they stand alone one GeoTIFF can tell them."""
    values = np.full((2, 30, 40), 50, np.uint8)
    mask = np.full((30, 40), 255, np.uint8)
    mask[HOLE] = 0
    write_raster(tmp_path / "m.tif", mask, GRID)
    path = virtual(tmp_path, values, "Byte", (None, None))
    of_band = (
        '<MaskBand><VRTRasterBand dataType="Byte"><SimpleSource>'
        '<SourceFilename relativeToVRT="1">m.tif</SourceFilename><SourceBand>1</SourceBand>'
        "</SimpleSource></VRTRasterBand></MaskBand></VRTRasterBand></VRTDataset>"
    )
    path.write_text(path.read_text().replace("</VRTRasterBand></VRTDataset>", of_band))
    with open_raster(path) as source:
        assert source.read(source.window, 1)[1].all()
        np.testing.assert_array_equal(source.read(source.window, 2)[1], mask > 0)
        assert_refused(source, tmp_path, "at different pixels")
