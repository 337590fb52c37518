from __future__ import annotations

import threading
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
import rasterio.shutil
from raster_files import UTM, utm_grid, write_raster
from rasterio._err import CPLE_AppDefinedError
from rasterio.control import GroundControlPoint
from rasterio.enums import ColorInterp

from groundtie.errors import BandError, GeoreferencingError, RasterOpenError
from groundtie.rasters import averaging
from groundtie.rasters.grid import PIXEL_COORDINATES
from groundtie.rasters.metadata import BandInfo, stated
from groundtie.rasters.reading import Window, open_raster

pytestmark = pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")

RNG = np.random.default_rng(0)
IMAGE = RNG.integers(1, 1000, (40, 60)).astype(np.uint16)
GRID = utm_grid(60, 40)


def test_what_the_file_says(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "a.tif", IMAGE, GRID, nodata=0)
    with rasterio.open(path, "r+") as dataset:
        dataset.update_tags(SENSOR="X")
        dataset.update_tags(1, POLARISATION="VV")
        dataset.set_band_description(1, "amplitude")
        dataset.scales, dataset.offsets = [0.5], [3.0]
        dataset.units = ["dB"]
    source = open_raster(path)
    band = source.bands[0]
    assert source.grid == GRID
    assert (source.count, source.dtype, source.is_complex) == (1, np.uint16, False)
    assert (band.nodata, band.scale, band.offset, band.unit) == (0, 0.5, 3.0, "dB")
    assert (band.description, band.tags["POLARISATION"]) == ("amplitude", "VV")
    assert source.tags[""]["SENSOR"] == "X"
    assert not source.has_mask_band


def test_all_pixels_come_back(tmp_path: Path) -> None:
    source = open_raster(write_raster(tmp_path / "a.tif", IMAGE, GRID))
    values, valid = source.read(source.window)
    np.testing.assert_array_equal(values, IMAGE)
    assert values.dtype == np.float32
    assert valid.all()


@pytest.mark.parametrize("window", [(-5, -3, 20, 10), (50, 35, 20, 10), (-2, -2, 70, 50)])
def test_beyond_the_raster_nothing_is_valid(
    tmp_path: Path, window: tuple[int, int, int, int]
) -> None:
    source = open_raster(write_raster(tmp_path / "a.tif", IMAGE, GRID))
    values, valid = source.read(Window(*window))
    col, row, width, height = window
    padded = np.zeros((200, 200))
    padded[100:140, 100:160] = IMAGE
    expected = padded[100 + row : 100 + row + height, 100 + col : 100 + col + width]
    np.testing.assert_array_equal(values, expected)
    np.testing.assert_array_equal(valid, expected > 0)


def test_a_window_far_away_is_empty(tmp_path: Path) -> None:
    source = open_raster(write_raster(tmp_path / "a.tif", IMAGE, GRID))
    for window in (Window(100, 0, 5, 4), Window(-50, -50, 5, 4)):
        values, valid = source.read(window)
        assert values.shape == (4, 5)
        assert not values.any()
        assert not valid.any()


def test_the_mean_of_all_bands_where_all_are_valid(tmp_path: Path) -> None:
    bands = np.stack([IMAGE, 3 * IMAGE, 5 * IMAGE]).astype(np.int32)
    bands[1, 4, 7] = -1
    source = open_raster(write_raster(tmp_path / "a.tif", bands, GRID, nodata=-1))
    values, valid = source.read(source.window)
    expected = 3.0 * IMAGE
    expected[4, 7] = 0
    np.testing.assert_allclose(values, expected)
    assert np.argwhere(~valid).tolist() == [[4, 7]]
    np.testing.assert_array_equal(source.read(source.window, band=3)[0], 5 * IMAGE)
    assert source.read(source.window, band=3)[1].all()


@pytest.mark.parametrize("nodata", [-9999.0, float("nan"), 0.1, -3.4028234663852886e38])
def test_nodata_of_floating_point_rasters(tmp_path: Path, nodata: float) -> None:
    image = IMAGE.astype(np.float32)
    image[3:6, 10:20] = nodata
    source = open_raster(write_raster(tmp_path / "a.tif", image, GRID, nodata=nodata))
    values, valid = source.read(source.window)
    expected = np.ones(image.shape, bool)
    expected[3:6, 10:20] = False
    np.testing.assert_array_equal(valid, expected)
    np.testing.assert_array_equal(values, np.where(expected, IMAGE, 0))


@pytest.mark.parametrize("bad", [1e39, -1.7976931348623157e308, 1e300 + 1e300j])
@pytest.mark.parametrize("bands", [1, 2])
@pytest.mark.parametrize("out_shape", [None, (20, 30)])
def test_what_single_precision_cannot_hold_is_as_nan(
    bad: complex, bands: int, out_shape: tuple[int, int] | None
) -> None:
    """Fill values that other programs do not declare, as the lowest number that there is."""
    values = np.full((bands, 40, 60), 5.0, np.result_type(type(bad)))
    holed = values.copy()
    values[:, :2, :3], holed[:, :2, :3] = bad, np.nan
    found, expected = (
        open_raster(image).read(Window(0, 0, 60, 40), out_shape=out_shape)
        for image in (values, holed)
    )
    np.testing.assert_array_equal(found, expected)
    assert not found[1][0, 0] and found[1][-1, -1]


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("lowest", [float(np.finfo(np.float32).min), -3.4028235e38, -3.402823e38])
def test_the_lowest_number_of_single_precision_is_no_measurement(
    lowest: float, dtype: type[np.floating]
) -> None:
    """ArcGIS' fill value, also as text has it, in files that do not declare it."""
    values = np.full((2, 40, 60), 5.0, dtype)
    values[:, :2, :3] = max(lowest, float(np.finfo(dtype).min))
    expected = values[0] == 5
    source = open_raster(values)
    for band in (None, 1):
        found, valid = source.read(source.window, band)
        np.testing.assert_array_equal(valid, expected)
        np.testing.assert_array_equal(found, np.where(expected, 5, 0))
    found, valid = source.read_bands(source.window)
    np.testing.assert_array_equal(valid, np.stack([expected] * 2))
    np.testing.assert_array_equal(found, np.where(valid, 5, 0))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_low_and_high_numbers_are_measurements(dtype: type[np.floating]) -> None:
    values = np.array([[-1e30, 1e30, float(np.finfo(np.float32).max)]], dtype)
    assert open_raster(values).read(Window(0, 0, 3, 1))[1].all()
    assert open_raster(values).read_bands(Window(0, 0, 3, 1))[1].all()


def test_amplitudes_that_single_precision_cannot_hold_are_as_nan() -> None:
    values = np.full((4, 6), 3 + 4j, np.complex64)
    values[0, 0] = 3e38 + 3e38j
    found, valid = open_raster(values).read(Window(0, 0, 6, 4))
    np.testing.assert_array_equal(valid, found == 5)
    assert not valid[0, 0]


def test_means_that_single_precision_cannot_hold_are_as_nan() -> None:
    values = np.full((40, 60), 5.0, np.float32)
    values[:4, :4] = np.finfo(np.float32).max
    found, valid = open_raster(values).read(Window(0, 0, 60, 40), out_shape=(20, 30))
    assert np.isfinite(found).all()
    np.testing.assert_array_equal(valid, (found == 5))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_numbers_that_are_not_finite_are_invalid(tmp_path: Path, bad: float) -> None:
    image = IMAGE.astype(np.float32)
    image[0, 0] = bad
    source = open_raster(write_raster(tmp_path / "a.tif", image, GRID))
    for band in (None, 1):
        values, valid = source.read(source.window, band)
        assert np.argwhere(~valid).tolist() == [[0, 0]]
        assert values[0, 0] == 0


def test_a_nodata_value_that_the_type_cannot_hold_hides_nothing(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "a.tif", IMAGE, GRID)
    vrt = tmp_path / "a.vrt"
    vrt.write_text(
        f"""<VRTDataset rasterXSize="60" rasterYSize="40"><VRTRasterBand dataType="UInt16" band="1">
        <NoDataValue>-9999</NoDataValue><SimpleSource><SourceFilename>{path}</SourceFilename>
        <SourceBand>1</SourceBand></SimpleSource></VRTRasterBand></VRTDataset>"""
    )
    values, valid = open_raster(vrt).read(Window(0, 0, 60, 40))
    np.testing.assert_array_equal(values, IMAGE)
    assert valid.all()


def test_an_internal_mask(tmp_path: Path) -> None:
    mask = np.full(IMAGE.shape, 255, np.uint8)
    mask[5, :9] = 0
    source = open_raster(write_raster(tmp_path / "a.tif", IMAGE, GRID, mask=mask))
    assert source.has_mask_band
    values, valid = source.read(source.window)
    np.testing.assert_array_equal(valid, mask > 0)
    np.testing.assert_array_equal(values, np.where(mask > 0, IMAGE, 0))


def test_transparent_pixels_are_invalid_and_alpha_is_no_colour(tmp_path: Path) -> None:
    alpha = np.full(IMAGE.shape, 255, np.uint16)
    alpha[7, 7:11] = 0
    alpha[8, 7] = 1
    colors = [ColorInterp.red, ColorInterp.green, ColorInterp.blue, ColorInterp.alpha]
    bands = np.stack([IMAGE, IMAGE, IMAGE, alpha])
    path = write_raster(tmp_path / "a.tif", bands, GRID, colorinterp=colors, photometric="RGB")
    source = open_raster(path)
    assert (source.alpha_band, source.image_bands) == (4, (1, 2, 3))
    values, valid = source.read(source.window)
    np.testing.assert_array_equal(valid, alpha > 0)
    np.testing.assert_allclose(values, np.where(alpha > 0, IMAGE, 0), rtol=1e-6)


@pytest.mark.parametrize("dtype", ["complex64", "complex_int16"])
def test_complex_pixels_give_their_amplitude(tmp_path: Path, dtype: str) -> None:
    image = (3 * IMAGE.astype(np.complex64) + 4j * IMAGE).astype(np.complex64)
    source = open_raster(write_raster(tmp_path / "a.tif", image, GRID, dtype=dtype))
    assert source.is_complex
    values, valid = source.read(source.window)
    np.testing.assert_allclose(values, 5.0 * IMAGE, rtol=1e-6)
    assert valid.all()
    reduced, _ = source.read(source.window, None, (20, 30))
    np.testing.assert_allclose(
        reduced, 5.0 * IMAGE.reshape(20, 2, 30, 2).mean(axis=(1, 3)), rtol=1e-5
    )


@pytest.mark.parametrize("strip_pixels", [100, 4_000_000])
def test_reduced_reading_averages_valid_pixels(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, strip_pixels: int
) -> None:
    monkeypatch.setattr(averaging, "HELD_PIXELS", strip_pixels)
    image = IMAGE.copy()
    image[8:12, 16:20] = 65535
    image[20, 20] = 65535
    source = open_raster(write_raster(tmp_path / "a.tif", image, GRID, nodata=65535))
    values, valid = source.read(source.window, 1, (10, 15))
    kept = np.where(image == 65535, np.nan, image).reshape(10, 4, 15, 4)
    with np.errstate(invalid="ignore"):
        expected = np.nansum(kept, axis=(1, 3)) / np.isfinite(kept).sum(axis=(1, 3))
    assert np.argwhere(~valid).tolist() == [[2, 4]]
    np.testing.assert_allclose(values[valid], expected[valid], rtol=1e-6)
    assert values[2, 4] == 0


def test_reduced_reading_by_a_broken_factor_keeps_the_place(tmp_path: Path) -> None:
    source = open_raster(write_raster(tmp_path / "a.tif", IMAGE, GRID))
    values, _ = source.read(Window(3, 2, 50, 30), None, (7, 12))
    # In pixels 7 and 12 times as small, the broken edges are whole.
    fine = IMAGE[2:32, 3:53].astype(float).repeat(7, axis=0).repeat(12, axis=1)
    np.testing.assert_allclose(values, fine.reshape(7, 30, 12, 50).mean(axis=(1, 3)), rtol=1e-5)


def test_several_bands_keep_their_type_and_validity(tmp_path: Path) -> None:
    bands = np.stack([IMAGE, IMAGE])
    bands[0, 0, 0] = 0
    source = open_raster(write_raster(tmp_path / "a.tif", bands, GRID, nodata=0))
    values, valid = source.read_bands(source.window)
    np.testing.assert_array_equal(values, bands)
    assert values.dtype == np.uint16
    np.testing.assert_array_equal(valid, bands > 0)
    reduced, _ = source.read_bands(source.window, [2], (20, 30))
    assert reduced.shape == (1, 20, 30)
    np.testing.assert_allclose(reduced[0], IMAGE.reshape(20, 2, 30, 2).mean(axis=(1, 3)))


@pytest.mark.parametrize("band", [0, 2, -1])
def test_a_band_that_is_not_there(tmp_path: Path, band: int) -> None:
    source = open_raster(write_raster(tmp_path / "a.tif", IMAGE, GRID))
    with pytest.raises(BandError, match=rf"a\.tif has no band {band}"):
        source.read(source.window, band)


def test_files_that_are_no_rasters(tmp_path: Path) -> None:
    text = tmp_path / "text.tif"
    text.write_text("no raster")
    for path in (tmp_path / "missing.tif", text, tmp_path):
        with pytest.raises(RasterOpenError, match=path.name):
            open_raster(path)


@pytest.mark.parametrize("compress", ["none", "deflate"])
def test_a_truncated_file_fails_when_its_pixels_are_read(tmp_path: Path, compress: str) -> None:
    image = RNG.integers(0, 60000, (300, 300)).astype(np.uint16)
    path = write_raster(tmp_path / "cut.tif", image, utm_grid(300, 300), compress=compress)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])

    def read() -> None:
        source = open_raster(path)
        source.read(source.window)

    with pytest.raises(RasterOpenError, match=r"cut\.tif"):
        read()


@pytest.mark.parametrize("stated", [{}, {"crs": UTM}, {"crs": "EPSG:4326"}])
def test_an_image_without_georeferencing_has_pixel_coordinates(
    tmp_path: Path, stated: dict[str, Any]
) -> None:
    """A CRS alone tells of no place."""
    source = open_raster(write_raster(tmp_path / "a.tif", IMAGE, **stated))
    assert source.grid.crs is None
    assert source.grid.transform == PIXEL_COORDINATES
    assert not source.grid.is_georeferenced
    np.testing.assert_array_equal(source.grid.pixel_to_map([[5, 6]]), [[5, 6]])


RPCS = {
    "HEIGHT_OFF": "0", "HEIGHT_SCALE": "1", "LAT_OFF": "45", "LAT_SCALE": "1",
    "LINE_OFF": "0", "LINE_SCALE": "1", "LONG_OFF": "9", "LONG_SCALE": "1",
    "SAMP_OFF": "0", "SAMP_SCALE": "1", "LINE_NUM_COEFF": " ".join(["1"] * 20),
    "LINE_DEN_COEFF": " ".join(["1"] * 20), "SAMP_NUM_COEFF": " ".join(["1"] * 20),
    "SAMP_DEN_COEFF": " ".join(["1"] * 20),
}  # fmt: skip


@pytest.mark.parametrize(
    ("kind", "remedy"), [("RPCs", "orthorectify"), ("ground control points", "gdalwarp -tps")]
)
@pytest.mark.parametrize("stated", [{}, {"crs": "EPSG:4326"}])
def test_sensor_geometry_needs_orthorectification(
    tmp_path: Path, kind: str, remedy: str, stated: dict[str, Any]
) -> None:
    path = write_raster(tmp_path / "raw.tif", IMAGE, **stated)
    with rasterio.open(path, "r+") as dataset:
        if kind == "RPCs":
            dataset.update_tags(ns="RPC", **RPCS)
        else:
            corners = [(0, 0, 5e5, 5e6), (0, 60, 5.1e5, 5e6), (40, 0, 5e5, 4.9e6)]
            dataset.gcps = ([GroundControlPoint(*corner) for corner in corners], UTM)
    with pytest.raises(GeoreferencingError, match=f"raw.tif is located by {kind} only; .*{remedy}"):
        open_raster(path)
    source = open_raster(path, allow_sensor_geometry=True)
    assert source.grid.transform == PIXEL_COORDINATES
    np.testing.assert_array_equal(source.read(source.window)[0], IMAGE)


def test_names_that_only_gdal_understands(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "a.tif", IMAGE, GRID)
    with zipfile.ZipFile(tmp_path / "a.zip", "w") as archive:
        archive.write(path, "inner/a.tif")
    for name in (f"/vsizip/{tmp_path}/a.zip/inner/a.tif", f"GTIFF_DIR:1:{path}"):
        source = open_raster(name)
        np.testing.assert_array_equal(source.read(source.window)[0], IMAGE)


def test_a_container_of_several_rasters_names_them(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "a.tif", IMAGE.astype(np.uint8), GRID)
    container = tmp_path / "two.gpkg"
    for table in ("first", "second"):
        rasterio.shutil.copy(
            path, container, driver="GPKG", RASTER_TABLE=table, APPEND_SUBDATASET="YES"
        )
    with pytest.raises(RasterOpenError, match=r"two\.gpkg holds no bands itself.*:FIRST") as raised:
        open_raster(container)
    name = str(raised.value).split(": ", 1)[1].split(", ")[0]
    assert open_raster(name).count > 0


def test_reading_from_many_threads(tmp_path: Path) -> None:
    source = open_raster(
        write_raster(
            tmp_path / "a.tif", IMAGE, GRID, compress="deflate", tiled=True, blockxsize=16,
            blockysize=16,
        )
    )  # fmt: skip
    windows = [Window(c, r, 13, 11) for c in range(0, 40, 3) for r in range(0, 25, 3)]
    gate = threading.Barrier(4)

    def read(group: int) -> None:
        gate.wait()
        for w in windows[group::4] * 3:
            values, _ = source.read(w)
            np.testing.assert_array_equal(
                values, IMAGE[w.row : w.row + w.height, w.col : w.col + w.width]
            )

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(read, range(4)))
    # Handles decompress blocks for themselves: of a file there is one.
    assert len(source._handles._free) == 1
    source.close()
    np.testing.assert_array_equal(source.read(source.window)[0], IMAGE)


def test_a_closed_source_lets_go_of_its_file(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "a.tif", IMAGE, GRID)
    with open_raster(path) as source:
        source.read(source.window)
    assert source._handles._free == []


def test_no_property_of_all_bands_is_asked_for_each_band(tmp_path: Path) -> None:
    """Each costs calls of GDAL for every band: asked for each, opening is quadratic work."""
    path = write_raster(tmp_path / "a.tif", np.zeros((9, 4, 4), np.uint8), GRID)
    asked: list[str] = []

    class Asked:
        def __init__(self, dataset: object) -> None:
            self._dataset = dataset

        def __getattr__(self, name: str) -> object:
            asked.append(name)
            return getattr(self._dataset, name)

    with rasterio.open(path) as dataset:
        bands = BandInfo.all_of(Asked(dataset))
    assert len(bands) == 9
    assert {name for name in asked if asked.count(name) > 1} == {"tags"}


def test_an_old_message_of_gdal_is_no_failure() -> None:
    left = ["an odd tag"]

    def read() -> str:
        if left:
            raise CPLE_AppDefinedError(1, 1, left.pop())
        return "grey"

    assert stated(read) == "grey"


def test_a_file_that_is_missing_is_named_once(tmp_path: Path) -> None:
    path = tmp_path / "none.tif"
    with pytest.raises(RasterOpenError) as raised, open_raster(path):
        pass
    assert str(raised.value) == f"cannot read {path}: No such file or directory"
