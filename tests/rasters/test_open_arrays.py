"""Rasters that are no files: arrays and open datasets are read as files with the same pixels."""

from __future__ import annotations

import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import rasterio
from affine import Affine
from raster_files import UTM, utm_grid, write_raster
from rasterio.io import MemoryFile
from rasterio.vrt import WarpedVRT

from groundtie.arrays import Raster, in_memory
from groundtie.errors import (
    BandError,
    GeoreferencingError,
    ParameterError,
    RasterOpenError,
    SameFileError,
)
from groundtie.rasters.grid import PIXEL_COORDINATES, compose
from groundtie.rasters.pair import Image, make_pair
from groundtie.rasters.reading import Window, open_raster
from groundtie.rasters.writing import shared_nodata

RNG = np.random.default_rng(0)
GRID = utm_grid(60, 40)
TURNED = Affine(1.7, 1, 500_000, 1, -1.7, 5_000_000)
WINDOW = Window(-3, 5, 30, 50)


def image(dtype: Any, bands: int = 2) -> Any:
    values = RNG.integers(0, 200, (bands, 40, 60)).astype(dtype)
    if values.dtype.kind in "fc":
        values[0, 3:6, 4:9] = np.nan
    return values


def assert_read_alike(one: Any, other: Any) -> None:
    with open_raster(one) as a, open_raster(other) as b:
        assert a.grid == b.grid
        assert (a.count, a.dtype, a.says_what_is_valid) == (b.count, b.dtype, b.says_what_is_valid)
        for found, expected in (
            (a.read(WINDOW), b.read(WINDOW)),
            (a.read(a.window, 1, (10, 15)), b.read(b.window, 1, (10, 15))),
            (a.read_bands(WINDOW), b.read_bands(WINDOW)),
            (a.read_untouched(a.window), b.read_untouched(b.window)),
        ):
            np.testing.assert_array_equal(found[0], expected[0])
            np.testing.assert_array_equal(found[1], expected[1])


@pytest.mark.parametrize("dtype", ["uint8", "int16", "uint16", "float32", "float64", "complex64"])
@pytest.mark.parametrize("nodata", [None, 7])
def test_an_array_is_read_as_a_file_of_it(tmp_path: Path, dtype: str, nodata: int | None) -> None:
    values = image(dtype)
    path = write_raster(tmp_path / "a.tif", values, GRID, nodata=nodata)
    assert_read_alike(Raster(values, GRID.transform, UTM, nodata), path)


@pytest.mark.parametrize("nodata", [np.inf, -np.inf, np.nan])
def test_no_integer_is_infinite_or_nan(nodata: float) -> None:
    """Such a nodata value, as files of other programs state it, marks no pixel."""
    with open_raster(Raster(np.zeros((2, 3), np.uint8), nodata=nodata)) as source:
        assert source.read(source.window)[1].all()
        with pytest.raises(ParameterError, match="type uint8 cannot hold the nodata value"):
            shared_nodata(source)


@pytest.mark.parametrize("nodata", [7, 7.0, np.uint16(7), np.float32(7)])
def test_nodata_is_any_number(nodata: Any) -> None:
    with open_raster(Raster(np.array([[6, 7]], np.uint16), nodata=nodata)) as source:
        np.testing.assert_array_equal(source.read(source.window)[1], [[True, False]])


@pytest.mark.parametrize("dtype", ["<f2", ">f2"])
@pytest.mark.parametrize("nodata", [0.1, -9999, 65504, 1e6])
def test_nodata_is_what_the_array_can_hold(nodata: float, dtype: str) -> None:
    """The half-precision number next to -9999 is -10000."""
    values = np.ones((2, 3))
    values[0, 0] = nodata
    with (
        np.errstate(over="ignore"),
        open_raster(Raster(values.astype(dtype), nodata=nodata)) as one,
    ):
        valid = one.read(one.window)[1]
    np.testing.assert_array_equal(valid, [[False, True, True], [True, True, True]])


def test_a_masked_array_is_read_as_a_file_with_a_mask(tmp_path: Path) -> None:
    values = image("uint16", bands=1)
    mask = np.zeros((40, 60), bool)
    mask[10:20, 30:] = True
    path = write_raster(tmp_path / "a.tif", values, GRID, mask=~mask)
    assert_read_alike(Raster(np.ma.MaskedArray(values, mask[None]), GRID.transform, UTM), path)


def test_a_bare_array_is_in_pixel_coordinates(tmp_path: Path) -> None:
    values = image("uint8", bands=1)
    assert_read_alike(values[0], write_raster(tmp_path / "a.tif", values))
    with open_raster(values[0]) as source:
        assert source.grid.transform == PIXEL_COORDINATES
        assert not source.grid.is_georeferenced


def test_an_array_lies_where_its_transform_is_stated() -> None:
    """Pixels of 1 m at the map's origin, upside down."""
    with open_raster(Raster(image("uint8"), Affine.identity(), UTM)) as source:
        assert source.grid.transform == Affine.identity() and source.grid.crs == UTM


def test_reading_leaves_the_array_as_it_was() -> None:
    values = image("float32")
    before = values.copy()
    with open_raster(values) as source:
        source.read(source.window)
    np.testing.assert_array_equal(values, before)


@pytest.mark.parametrize("colours", [3, 4])
def test_colours_come_first(colours: int) -> None:
    with pytest.raises(ParameterError, match=r"transpose\(2, 0, 1\)"):
        Raster(np.zeros((40, 60, colours), np.uint8))
    assert Raster(np.zeros((colours, 40, 60), np.uint8)).values.shape == (colours, 40, 60)


def test_a_dataset_of_xarray_is_several_arrays() -> None:
    dataset = SimpleNamespace(dims={"x": 3}, coords={}, data_vars={})
    with pytest.raises(ParameterError, match="give one of them"):
        in_memory(dataset)


def test_messages_name_the_size() -> None:
    with (
        open_raster(np.zeros((400, 500))) as source,
        pytest.raises(BandError, match=r"^array of 500 × 400 has no band 2; it has 1$"),
    ):
        source.read(source.window, 2)


class TestDatasets:
    def test_an_open_dataset_is_read_as_its_file_and_stays_open(self, tmp_path: Path) -> None:
        path = write_raster(tmp_path / "a.tif", image("uint16"), GRID, nodata=7)
        with rasterio.open(path) as dataset:
            assert_read_alike(dataset, path)
            assert not dataset.closed

    def test_datasets_without_a_file(self, tmp_path: Path) -> None:
        values = image("uint16")
        path = write_raster(tmp_path / "a.tif", values, GRID, nodata=7)
        with (
            MemoryFile(path.read_bytes()) as memory,
            memory.open() as dataset,
            WarpedVRT(dataset) as warped,
        ):
            assert_read_alike(dataset, path)
            assert_read_alike(warped, path)

    def test_threads_take_turns(self, tmp_path: Path) -> None:
        values = RNG.integers(0, 60_000, (1, 700, 900)).astype(np.uint16)
        path = write_raster(
            tmp_path / "a.tif", values, utm_grid(900, 700), tiled=True, compress="deflate"
        )
        rows = [Window(0, row, 900, 20) for row in range(0, 700, 20)]
        with rasterio.open(path) as dataset, ThreadPoolExecutor(8) as pool:
            source = open_raster(dataset)
            strips = list(pool.map(lambda window: source.read(window)[0], rows * 4))
        np.testing.assert_array_equal(np.concatenate(strips[:35]), values[0])
        np.testing.assert_array_equal(strips[:35] * 4, strips)

    def test_a_closed_dataset_cannot_be_read(self, tmp_path: Path) -> None:
        path = write_raster(tmp_path / "a.tif", image("uint8"), GRID)
        with rasterio.open(path) as dataset:
            pass
        with pytest.raises(RasterOpenError, match="the dataset is closed: "):
            open_raster(dataset)


class TestIdentity:
    """Whether two sources are one raster, for arrays of one size, too."""

    def test_arrays_are_told_apart_by_their_pixels(self) -> None:
        one, other = np.zeros((40, 60)), np.zeros((40, 60))
        assert open_raster(one).is_same_as(open_raster(one))
        assert not open_raster(one).is_same_as(open_raster(other))

    @pytest.mark.parametrize("dtype", ["uint64", "complex64", ">f8"])
    def test_other_numbers_in_the_same_memory_are_another_raster(self, dtype: str) -> None:
        values = RNG.normal(size=(40, 60))
        other = open_raster(values.view(dtype))
        assert not open_raster(values).is_same_as(other)
        assert open_raster(values).is_same_as(open_raster(values[:]))

    def test_a_dataset_is_its_file(self, tmp_path: Path) -> None:
        path = write_raster(tmp_path / "a.tif", image("uint8"), GRID)
        with rasterio.open(path) as dataset:
            assert open_raster(dataset).is_same_as(open_raster(path))

    def test_a_pair_is_two_rasters(self) -> None:
        values = image("float64", 1)
        first, second = (open_raster(v) for v in (values, values.copy()))
        make_pair(Image(first), Image(second))
        with pytest.raises(SameFileError, match="same raster: array of 60 × 40"):
            make_pair(Image(first), Image(open_raster(values)))


class TestRaster:
    def test_the_crs_may_be_anything_that_names_one(self) -> None:
        for crs in (UTM, 32632, "EPSG:32632", UTM.to_wkt()):
            assert Raster(np.zeros((2, 3)), GRID.transform, crs).crs == UTM

    @pytest.mark.parametrize(
        ("values", "place", "message"),
        [
            (np.zeros(4), {}, r"must have the shape \(h, w\) or \(bands, h, w\), not \(4,\)"),
            (np.zeros((0, 4)), {}, "must have the shape"),
            (np.array([["a"]]), {}, "must hold numbers, not <U1"),
            (np.zeros((2, 3)), {"transform": (1, 0, 0)}, r"must be an affine\.Affine, not tuple"),
            (
                np.zeros((2, 3)),
                {"transform": Affine.identity(), "crs": "EPSG:no"},
                "no coordinate reference system: 'EPSG:no'",
            ),
            (np.zeros((2, 3)), {"crs": UTM}, "an array with a CRS needs its transform"),
            (np.zeros((2, 3)), {"nodata": "x"}, "nodata must be a number, not 'x'"),
            (np.zeros((2, 3)), {"nodata": [0]}, r"nodata must be a number, not \[0\]"),
        ],
    )
    def test_what_is_no_raster(self, values: Any, place: dict[str, Any], message: str) -> None:
        with pytest.raises(ValueError, match=message):
            Raster(values, **place)

    def test_types_that_files_cannot_hold(self) -> None:
        assert Raster(np.zeros((2, 3), bool)).values.dtype == np.uint8
        assert Raster(np.zeros((2, 3), np.float16)).values.dtype == np.float32
        assert Raster(np.zeros((2, 3), ">u2")).values.dtype == np.uint16
        assert Raster(np.zeros((2, 3), np.int64)).values.dtype == np.int64

    def test_it_is_an_array_for_numpy(self) -> None:
        raster = Raster(np.arange(6).reshape(2, 3), GRID.transform, UTM)
        np.testing.assert_array_equal(raster, [[0, 1, 2], [3, 4, 5]])
        assert (raster.width, raster.height, raster.bands.shape) == (3, 2, (1, 2, 3))
        assert str(raster) == "array of 3 × 2"
        assert repr(raster) == "<Raster (2, 3) int64, EPSG:32632>"


class TestXarray:
    """With rioxarray, where it is installed."""

    @pytest.fixture
    def opened(self, tmp_path: Path) -> Any:
        rioxarray = pytest.importorskip("rioxarray")
        values = image("uint16")
        path = write_raster(tmp_path / "a.tif", values, GRID, nodata=7)
        with rioxarray.open_rasterio(path) as array:
            yield path, array

    def test_it_is_read_as_its_file(self, opened: Any) -> None:
        assert_read_alike(opened[1], opened[0])

    def test_dimensions_in_any_order(self, opened: Any) -> None:
        path, array = opened
        assert_read_alike(array.transpose("x", "band", "y"), path)

    def test_a_part_lies_where_it_was(self, opened: Any) -> None:
        part = Raster.from_xarray(opened[1].isel(band=0, x=slice(10, 30), y=slice(4, 20)))
        moved = GRID.window(10, 4, 20, 16).transform
        np.testing.assert_allclose(part.transform[:6], moved[:6], atol=1e-6)
        assert (part.values.shape, part.crs, part.nodata) == ((16, 20), UTM, 7)

    def test_columns_that_are_cut_out_leave_no_grid(self, opened: Any) -> None:
        kept = np.r_[0:10, 14:30]
        for axis in ("x", "y"):
            with pytest.raises(GeoreferencingError, match=rf"coordinates {axis} .* uneven"):
                Raster.from_xarray(opened[1].isel({axis: kept}))
        # Every second one is even.
        part = Raster.from_xarray(opened[1].isel(band=0, x=slice(0, 20, 2)))
        assert part.transform is not None
        assert part.transform.a == pytest.approx(2 * GRID.transform.a)

    @pytest.mark.parametrize("turned", [TURNED, Affine(0, 2, 500_000, 2, 0, 5_000_000)])
    def test_a_part_of_a_rotated_array_lies_where_it_was(
        self, opened: Any, tmp_path: Path, turned: Affine
    ) -> None:
        import rioxarray

        path = write_raster(tmp_path / "turned.tif", image("uint16"), transform=turned, crs=UTM)
        array = rioxarray.open_rasterio(path)
        for whole in (array, Raster.from_xarray(array).to_xarray()):
            assert_read_alike(whole, path)
            part = Raster.from_xarray(whole.isel(x=slice(10, 30), y=slice(4, 20)))
            expected = compose(turned, Affine.translation(10, 4))
            np.testing.assert_allclose(part.transform[:6], expected[:6], atol=1e-6)
            with pytest.raises(GeoreferencingError, match=r"coordinates xc, yc .* uneven"):
                Raster.from_xarray(whole.isel(x=np.r_[0:10, 14:30]))

    def test_without_coordinates_a_crs_locates_nothing(self, opened: Any, tmp_path: Path) -> None:
        bare = opened[1].drop_vars(["x", "y", "spatial_ref"]).rio.write_crs(UTM)
        path = write_raster(tmp_path / "bare.tif", opened[1].values, crs=UTM, nodata=7)
        assert_read_alike(bare, path)

    def test_to_xarray_and_back(self, opened: Any) -> None:
        raster = Raster.from_xarray(opened[1])
        assert raster.transform == GRID.transform
        assert_read_alike(Raster.from_xarray(raster.to_xarray()), opened[0])

    def test_what_is_masked_becomes_nan(self, opened: Any) -> None:
        values = np.ma.MaskedArray([[1, 2], [3, 4]], [[False, True], [False, False]])
        array = Raster(values).to_xarray()
        np.testing.assert_array_equal(array, [[1, np.nan], [3, 4]])

    def test_dimensions_that_are_no_map(self, opened: Any) -> None:
        import xarray

        with pytest.raises(ParameterError, match="needs dimensions y and x"):
            Raster.from_xarray(xarray.DataArray(np.zeros((2, 3)), dims=("a", "b")))
        with pytest.raises(ParameterError, match="has bands, y and x, not time, band"):
            Raster.from_xarray(opened[1].expand_dims("time"))


def take_for_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    exceptions = SimpleNamespace(RioXarrayError=KeyError)
    monkeypatch.setitem(sys.modules, "rioxarray", SimpleNamespace(exceptions=exceptions))
    monkeypatch.setitem(sys.modules, "rioxarray.exceptions", exceptions)


EVEN = 5e5 + 10.0 * np.arange(6)


@pytest.mark.parametrize(
    ("across", "is_even"),
    [
        (EVEN, True),
        (EVEN[::-1], True),
        (EVEN[:1], True),
        (EVEN.astype(int), True),
        (EVEN + 0.005 * np.array([0, 1, -1, 1, 0, 0]), True),
        # A float of four bytes holds longitudes to 1e-6 degrees or so: a hundredth of this pixel.
        ((10 + 1e-4 * np.arange(6)).astype(np.float32), True),
        (np.round(11.123456 + 9e-5 * np.arange(6), 6), True),
        (EVEN + 1.0 * np.array([0, 1, 0, 0, 0, 0]), False),
        (EVEN[[0, 1, 3, 4, 5, 5]], False),
        (EVEN[[0, 2, 1, 3, 4, 5]], False),
        (np.array([5e5, np.nan, 500_020]), False),
    ],
)
def test_coordinates_are_even_or_no_grid(
    monkeypatch: pytest.MonkeyPatch, across: Any, is_even: bool
) -> None:
    width, height = len(across), 3
    located = SimpleNamespace(x_dim="x", y_dim="y", crs=UTM, nodata=None)
    located.width, located.height = width, height
    located.transform = lambda recalc=False: GRID.transform
    values = np.zeros((height, width))
    array = SimpleNamespace(
        dims=("y", "x"),
        coords={"x": across, "y": 1.0 * np.arange(height)},
        rio=located,
        transpose=lambda *_: SimpleNamespace(values=values),
    )
    take_for_installed(monkeypatch)
    if is_even:
        assert Raster.from_xarray(array).transform == GRID.transform
        return
    with pytest.raises(GeoreferencingError, match=r"coordinates x .* uneven"):
        Raster.from_xarray(array)


@pytest.mark.parametrize(
    ("stored", "transform", "crs"),
    [
        (Affine.identity(), None, None),
        (GRID.transform, GRID.transform, UTM),
        (TURNED, TURNED, None),
    ],
)
def test_an_array_without_coordinates(
    monkeypatch: pytest.MonkeyPatch, stored: Affine, transform: Affine | None, crs: Any
) -> None:
    """Also where rioxarray is not installed: it has the identity where no transform is stored."""
    own = None if stored is TURNED else UTM
    located = SimpleNamespace(x_dim="x", y_dim="y", crs=own, nodata=7, transform=lambda: stored)
    values = np.zeros((2, 3))
    bare = SimpleNamespace(
        dims=("y", "x"), coords={}, rio=located, transpose=lambda *_: SimpleNamespace(values=values)
    )
    take_for_installed(monkeypatch)
    raster = Raster.from_xarray(bare)
    assert (raster.transform, raster.crs, raster.nodata) == (transform, crs, 7)
    with open_raster(bare) as source:
        assert source.grid.is_georeferenced == (transform is not None)


@pytest.mark.parametrize("turned", [TURNED, Affine(0, 2, 500_000, 2, 0, 5_000_000)])
def test_a_part_of_a_rotated_array_lies_at_its_coordinates(
    monkeypatch: pytest.MonkeyPatch, turned: Affine
) -> None:
    """Also where rioxarray is not installed: it stores the transform of the whole array."""
    cols, rows = np.meshgrid(np.arange(10, 30) + 0.5, np.arange(4, 20) + 0.5)
    xc, yc = (a * cols + b * rows + c for a, b, c in (turned[:3], turned[3:6]))
    located = SimpleNamespace(x_dim="x", y_dim="y", crs=UTM, nodata=None, transform=lambda: turned)
    located.width, located.height = 20, 16
    part = SimpleNamespace(
        dims=("y", "x"),
        coords={"xc": xc, "yc": yc},
        rio=located,
        transpose=lambda *_: SimpleNamespace(values=np.zeros((16, 20))),
    )
    take_for_installed(monkeypatch)
    expected = compose(turned, Affine.translation(10, 4))
    found = Raster.from_xarray(part).transform
    assert found is not None
    np.testing.assert_allclose(found[:6], expected[:6], atol=1e-6)


def test_an_array_without_rioxarray_is_explained() -> None:
    class Bare:
        dims, coords = ("y", "x"), {}

    with pytest.raises(ParameterError, match="needs rioxarray"):
        open_raster(Bare())


@pytest.mark.parametrize("crs", ["EPSG:4978", 'LOCAL_CS["site",UNIT["metre",1]]'])
def test_a_crs_without_a_map_is_refused_as_that_of_a_file_is(crs: str) -> None:
    values = np.zeros((20, 30), np.uint8)
    with pytest.raises(GeoreferencingError):
        open_raster(Raster(values, Affine.scale(10, -10), crs))


def test_without_rioxarray_the_error_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "rioxarray", None)
    with pytest.raises(ImportError, match=r"pip install 'groundtie\[xarray\]'"):
        Raster(np.zeros((4, 4))).to_xarray()
