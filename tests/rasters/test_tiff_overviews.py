from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from numpy.typing import NDArray
from raster_files import utm_grid, write_raster
from rasterio.enums import ColorInterp

from groundtie.rasters.atomic import Outputs
from groundtie.rasters.reading import open_raster
from groundtie.rasters.tiling import tiles
from groundtie.rasters.writing import create_like

RNG = np.random.default_rng(0)
ODD, EVEN = (1101, 1337), (1536, 1040)


# Every type where pixels of the overview share pixels of the image; a whole one and a float else.
@pytest.mark.parametrize(
    ("dtype", "shape"),
    [
        *((dtype, ODD) for dtype in ("uint8", "int16", "uint16", "int32", "float32", "float64")),
        ("uint16", EVEN),
        ("float32", EVEN),
    ],
)
@pytest.mark.slow
def test_pixels_of_an_overview_are_means_over_their_area(
    tmp_path: Path, dtype: str, shape: tuple[int, int]
) -> None:
    image = RNG.integers(0, 200, (2, *shape)).astype(dtype)
    found, _ = _overview(tmp_path, image, np.ones(shape, bool), nodata=None)
    expected, _ = _means(image, np.ones(image.shape, bool))
    _assert_near(found, expected, dtype)


@pytest.mark.parametrize("shape", [ODD, EVEN])
@pytest.mark.parametrize("nodata", [None, 7])
@pytest.mark.slow
def test_what_is_invalid_has_no_weight(
    tmp_path: Path, shape: tuple[int, int], nodata: int | None
) -> None:
    """By a mask, or a value of nodata, which differs from band to band; nothing has that mean."""
    image = RNG.integers(100, 60_000, (2, *shape)).astype(np.uint16)
    valid = np.repeat((RNG.random(shape) < 0.3)[None], 2, axis=0)
    if nodata is not None:
        valid[1] = RNG.random(shape) < 0.6
        image[~valid] = nodata
    found, shown = _overview(tmp_path, image, valid[0], nodata)
    expected, known = _means(image, valid)
    np.testing.assert_array_equal(shown, known)
    _assert_near(np.where(known, found, 0), np.where(known, expected, 0), "uint16")


@pytest.mark.parametrize("dtype", ["int64", "uint64"])
@pytest.mark.parametrize("shape", [(3, 1100), (513, 1025)])
def test_overviews_of_64_bits_are_means_of_what_is_valid(
    tmp_path: Path, dtype: str, shape: tuple[int, int]
) -> None:
    """Also of odd sizes, where GDAL's averages of windows of 64 bits are none."""
    image = RNG.integers(100, 60_000, (1, *shape)).astype(dtype)
    for valid in (np.ones(shape, bool), RNG.random(shape) < 0.3):
        found, shown = _overview(tmp_path, image, valid, nodata=None)
        expected, known = _means(image, valid[None])
        np.testing.assert_array_equal(shown, known)
        _assert_near(np.where(known, found, 0), np.where(known, expected, 0), dtype)


@pytest.mark.parametrize("dtype", ["int64", "uint64"])
def test_the_largest_numbers_of_64_bits_stay_the_largest(tmp_path: Path, dtype: str) -> None:
    """Double precision rounds them beyond the range; borders of pixels are rounded, too."""
    highest = np.iinfo(dtype).max
    image = np.full((1, *ODD), highest, dtype)
    found, _ = _overview(tmp_path, image, np.ones(ODD, bool), nodata=None)
    limit = sum(ODD) * np.finfo(float).eps
    np.testing.assert_allclose(found.astype(float), float(highest), rtol=limit)


@pytest.mark.parametrize(("dtype", "nodata"), [("uint8", 7), ("float32", np.nan)])
def test_a_nodata_value_counts_beside_an_alpha_band(
    tmp_path: Path, dtype: str, nodata: float
) -> None:
    """As GDAL has it, without rasterio's warning that it does."""
    image = RNG.integers(100, 200, (4, *ODD)).astype(dtype)
    image[3] = 255
    valid = np.ones(image.shape, bool)
    valid[:3, 300:700, 200:900] = False
    image[~valid] = nodata
    colours = (ColorInterp.red, ColorInterp.green, ColorInterp.blue, ColorInterp.alpha)
    found, _ = _overview(tmp_path, image, valid[0], nodata, colours)
    expected, known = _means(np.where(valid, image, 0), valid)
    is_nodata = np.isnan(found) if np.isnan(nodata) else found == nodata
    np.testing.assert_array_equal(is_nodata, ~known)
    _assert_near(np.where(known, found, 0), np.where(known, expected, 0), dtype)


@pytest.mark.parametrize("dtype", ["uint8", "int16", "float32"])
def test_no_mean_is_read_as_nodata(tmp_path: Path, dtype: str) -> None:
    image, valid = RNG.choice([6, 8], (1, *EVEN)).astype(dtype), RNG.random(EVEN) < 0.7
    image[0, ~valid] = 7
    found, shown = _overview(tmp_path, image, valid, nodata=7)
    expected, known = _means(image, valid[None])
    np.testing.assert_array_equal(shown, known)
    assert np.abs(found - expected)[known].max() <= 1.5  # moved by one, and rounded


def test_one_pixel_that_is_not_a_number_spoils_no_other(tmp_path: Path) -> None:
    image = RNG.normal(size=(1, *ODD)).astype(np.float32)
    image[0, 600, 700] = np.nan
    valid = np.isfinite(image)
    found, shown = _overview(tmp_path, image, valid[0], nodata=np.nan)
    expected, known = _means(np.where(valid, image, 0), valid)
    assert known.all()
    np.testing.assert_array_equal(shown, known)
    _assert_near(found, expected, "float32")


@pytest.mark.slow
@pytest.mark.parametrize("dtype", ["complex64", "complex_int16"])
def test_complex_pixels_are_0_where_nothing_is_valid(tmp_path: Path, dtype: str) -> None:
    image = (RNG.normal(size=(1, *ODD)) + 1j * RNG.normal(size=(1, *ODD))).astype(np.complex64)
    mask = np.ones(ODD, bool)
    mask[200:900, 300:1000] = False
    for _ in range(5):  # memory that is taken anew holds what was there before
        found, shown = _overview(tmp_path, 99 * image, mask, nodata=None, dtype=dtype)
        assert 0 < np.count_nonzero(~shown) < shown.size
        np.testing.assert_array_equal(found[0][~shown[0]], 0)


def _overview(
    folder: Path,
    image: NDArray[Any],
    mask: NDArray[np.bool_],
    nodata: float | None,
    colours: tuple[ColorInterp, ...] | None = None,
    **more: Any,
) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Return the first overview of a file with an image, and what is valid in it."""
    grid = utm_grid(*image.shape[:0:-1])
    more |= {"nodata": nodata, "colorinterp": colours}
    source_file = write_raster(folder / "a.tif", image, grid, **more)
    masked = nodata is None and not mask.all()
    with open_raster(source_file) as source, Outputs() as outputs:
        staged = outputs.stage(folder / "b.tif")
        with create_like(source, grid, staged, nodata=nodata, masked=masked) as file:
            for tile in tiles(grid):
                rows, cols = tile.slices
                file.write(image[:, rows, cols], window=tile, valid=mask[rows, cols])
    with rasterio.open(folder / "b.tif", overview_level=0) as overview:
        values = overview.read()
        # rasterio warns of masks beside an alpha band.
        return values, np.ones(values.shape, bool) if colours else overview.read_masks() > 0


def _means(image: NDArray[Any], valid: NDArray[np.bool_]) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Return means over the areas of the pixels of half the size, and which have any."""
    total, weight = _shared(np.where(valid, image, 0).astype(float)), _shared(valid.astype(float))
    known = weight > 1e-6  # none has less of a valid pixel
    return total / np.where(known, weight, 1), known


def _shared(image: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return sums over areas, by what lies before their borders."""
    for axis in (1, 2):
        size = image.shape[axis]
        before = np.cumsum(np.insert(image, 0, 0, axis=axis), axis=axis)
        borders = np.arange(-(-size // 2) + 1) * size / -(-size // 2)
        low = np.minimum(borders.astype(int), size - 1)
        share = np.expand_dims(borders - low, [k for k in range(3) if k != axis])
        at = before.take(low, axis) * (1 - share) + before.take(low + 1, axis) * share
        image = np.diff(at, axis=axis)
    return image


def _assert_near(found: NDArray[Any], expected: NDArray[Any], dtype: str) -> None:
    """Sums are in single precision, and whole numbers within a half."""
    rounded = 0.0 if dtype.startswith("float") else 0.5
    limit = rounded + 8 * float(np.finfo(np.float32).eps) * float(np.abs(expected).max())
    assert np.abs(found - expected).max() <= limit
