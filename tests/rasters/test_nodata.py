"""The nodata value is what GDAL takes for it, which has a tolerance for numbers from text."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
import rasterio.shutil
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from raster_files import utm_grid, write_raster
from rasterio.io import MemoryFile

from groundtie.rasters.nodata import is_nodata
from groundtie.rasters.reading import open_raster

FLOAT_MAX = float(np.finfo(np.float32).max)


@pytest.mark.parametrize("dtype", ["float32", "float64", "complex64"])
@pytest.mark.parametrize(
    ("declared", "written"),
    [
        (-3.40282306074e38, -FLOAT_MAX),
        (-32767.999, -32768.0),
        (9.96921e36, 9.969209968386869e36),
        (-9999.0, -9999.0),
        (0.0, 0.0),
    ],
)
def test_a_value_that_was_rounded_hides_the_pixels_that_it_hides_in_gdal(
    tmp_path: Path, declared: float, written: float, dtype: str
) -> None:
    image = np.array([[1.0, 2, written, 4], [-1.0, written, 3, 0.5]]).astype(dtype)
    path = write_raster(tmp_path / "a.tif", image, utm_grid(4, 2), nodata=declared)
    with rasterio.open(path) as dataset, open_raster(path) as source:
        assert (dataset.dataset_mask() == 0).sum() == 2
        valid = source.read(source.window)[1]
        np.testing.assert_array_equal(valid, dataset.dataset_mask() > 0)


def hidden_by_gdal(values: NDArray[Any], nodata: float) -> NDArray[np.bool_]:
    with MemoryFile() as memory:
        size = {"height": 1, "width": len(values), "count": 1}
        with memory.open(driver="GTiff", dtype=values.dtype, nodata=nodata, **size) as dataset:
            dataset.write(values[None, None])
        with memory.open() as dataset:
            return np.asarray(dataset.dataset_mask()[0] == 0)


@pytest.mark.parametrize(
    ("nodata", "hidden", "shown"),
    [
        # A few digits of Surfer's. Of numbers that are a little larger, sums are infinite.
        (1.701410009187828e38, [1.701410009187828e38], [1.7014118346046923e38]),
        (-FLOAT_MAX, [-1e38, -1e32], [-1e31, 1e38, FLOAT_MAX]),
        (-3.40282306074e38, [-FLOAT_MAX, -1e38], [-1e31, FLOAT_MAX]),
    ],
)
def test_where_sums_are_infinite(nodata: float, hidden: list[float], shown: list[float]) -> None:
    values = np.array([*hidden, *shown], np.float32)
    found = is_nodata(values, float(np.float32(nodata)), values.dtype)
    np.testing.assert_array_equal(found, hidden_by_gdal(values, nodata))
    assert found.tolist() == [True] * len(hidden) + [False] * len(shown)


def test_complex_numbers_with_an_imaginary_part_are_data() -> None:
    values = np.array([-9999, -9998.999, -9999 + 3j, 5], np.complex64)
    assert is_nodata(values, -9999.0, values.dtype).tolist() == [True, True, False, False]


def test_each_band_is_compared_by_its_own_type(tmp_path: Path) -> None:
    """Also where one type holds the pixels of all."""
    integers = np.array([[70_000_000, 70_000_001, 5]], np.int32)
    numbers = np.array([[0.1, 0.1 + 1e-9, 0.2]], np.float32)
    grid = utm_grid(3, 1)
    for name, image, nodata in (("i", integers, 70_000_000), ("f", numbers, 0.1)):
        path = write_raster(tmp_path / f"{name}.tif", image, grid, nodata=nodata)
        rasterio.shutil.copy(path, tmp_path / f"{name}.vrt", driver="VRT")
    both = tmp_path / "both.vrt"
    band = (tmp_path / "f.vrt").read_text().partition("<VRTRasterBand")[2].rpartition("</VRTD")[0]
    more = "<VRTRasterBand" + band.replace('band="1"', 'band="2"')
    both.write_text(
        (tmp_path / "i.vrt").read_text().replace("</VRTDataset>", f"{more}</VRTDataset>")
    )
    with rasterio.open(both) as dataset, open_raster(both) as source:
        assert dataset.dtypes == ("int32", "float32")
        valid = source.read_bands(source.window)[1]
        np.testing.assert_array_equal(valid, dataset.read_masks() > 0)
    assert valid[:, 0].tolist() == [[False, True, True], [False, False, True]]


@given(
    st.sampled_from([np.float32, np.float64]),
    st.floats(-(2.0**126), 2.0**126, width=32),
    st.lists(st.integers(-12, 12), min_size=1),
)
def test_the_tolerance_is_that_of_gdal(
    dtype: type[np.float32 | np.float64], nodata: float, steps: list[int]
) -> None:
    own = dtype(nodata)
    near = own + np.array(steps, dtype) * dtype(np.spacing(np.float32(abs(nodata))))
    values = np.array([*near, own, own / 2, own / 3, 1, -own], dtype)
    np.testing.assert_array_equal(
        is_nodata(values, nodata, values.dtype), hidden_by_gdal(values, nodata)
    )
