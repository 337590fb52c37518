from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from raster_files import utm_grid, write_raster

from groundtie import filter_speckle, warp
from groundtie.errors import ParameterError, RasterContentError
from groundtie.geometry.transform import Transform
from groundtie.rasters.radar_tags import SPECKLE_FILTER, is_known_radar
from groundtie.rasters.reading import open_raster
from groundtie.speckle.filters import FILTERS, SpeckleFilter
from groundtie.speckle.raster_filter import VALUES

LOOKS = 4.0
SIZE = (530, 610)


def amplitude(seed: int = 0) -> np.ndarray:
    """Return amplitudes of 1000 and 3000 with speckle."""
    power = np.full(SIZE, 1e6)
    power[:, 300:] = 9e6
    speckle = np.random.default_rng(seed).gamma(LOOKS, 1 / LOOKS, SIZE)
    return np.sqrt(power * speckle)


def read(path: Path) -> np.ndarray:
    with rasterio.open(path) as dataset:
        return dataset.read()


@pytest.mark.parametrize("name", FILTERS)
def test_tiles_make_what_the_filter_makes_of_the_whole(tmp_path: Path, name: str) -> None:
    image = amplitude().astype(np.float32)
    path = write_raster(tmp_path / "in.tif", image, utm_grid(*SIZE[::-1]))
    result = filter_speckle(path, tmp_path / "out.tif", name, 5, looks=LOOKS)
    whole = SpeckleFilter(name, 5, LOOKS)(image**2, np.ones(SIZE, bool))
    np.testing.assert_allclose(read(result.output)[0], np.sqrt(whole), rtol=2e-3)


def test_looks_are_estimated_and_rise(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "in.tif", np.rint(amplitude()).astype(np.uint16))
    result = filter_speckle(path, tmp_path / "out.tif")
    assert result.looks == pytest.approx(LOOKS, rel=0.05)
    assert result.looks_after > 20 * LOOKS
    assert read(result.output).dtype == np.uint16
    # The mean power stays; one grey level of rounding is nothing beside it.
    power = (read(result.output)[0, :, 350:].astype(float) ** 2).mean()
    assert power == pytest.approx(9e6, rel=0.01)


def test_intensities_are_not_squared(tmp_path: Path) -> None:
    image = (amplitude() ** 2).astype(np.float32)
    path = write_raster(tmp_path / "in.tif", image)
    result = filter_speckle(path, tmp_path / "out.tif", "lee", values="intensity", looks=LOOKS)
    expected = SpeckleFilter("lee", 7, LOOKS)(image, np.ones(SIZE, bool))
    np.testing.assert_allclose(read(result.output)[0], expected, rtol=1e-3)


@pytest.mark.parametrize("name", ["lee", "isef"])
@pytest.mark.parametrize("values", VALUES)
@pytest.mark.parametrize(
    ("dtype", "exponent"),
    [("float32", -70), ("float32", 110), ("float64", -900), ("float64", 1000), ("complex64", 50)],
)
def test_results_do_not_depend_on_the_unit_of_the_pixels(
    tmp_path: Path, dtype: str, exponent: int, values: str, name: str
) -> None:
    image = amplitude()[:200, 200:400].astype(dtype)
    results = []
    for scale in (1.0, 2.0**exponent):
        path = write_raster(tmp_path / "in.tif", (image * scale).astype(dtype))
        result = filter_speckle(path, tmp_path / "out.tif", name, values=values)
        unit = scale**2 if dtype == "complex64" and values == "intensity" else scale
        results.append((read(result.output) / unit, result.looks, result.looks_after))
    np.testing.assert_array_equal(results[1][0], results[0][0])
    assert results[1][1:] == results[0][1:]


def test_messages_name_the_final_file(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "in.tif", np.full((40, 40), np.nan, np.float32))
    with pytest.raises(RasterContentError, match=r"/out\.tif has no valid pixels in its middle"):
        filter_speckle(path, tmp_path / "out.tif", looks=LOOKS)


def test_nodata_stays_and_weighs_nothing(tmp_path: Path) -> None:
    image = np.rint(amplitude()).astype(np.uint16)
    image[100:200, 50:90] = 7
    bands = np.stack([image, image[::-1]])
    path = write_raster(tmp_path / "in.tif", bands, utm_grid(*SIZE[::-1]), nodata=7)
    result = filter_speckle(path, tmp_path / "out.tif", "enhanced-frost", 9)
    out = read(result.output)
    np.testing.assert_array_equal(out == 7, bands == 7)
    assert np.abs(out[0, 98:202, 49].astype(float) - 1000).max() < 400
    with rasterio.open(result.output) as dataset:
        assert dataset.nodata == 7


def masks(path: Path) -> np.ndarray:
    """Return which pixels GDAL takes for valid."""
    with rasterio.open(path) as dataset:
        return dataset.read_masks() > 0


@pytest.mark.parametrize("hole", [np.nan, np.inf])
@pytest.mark.parametrize("dtype", ["float32", "complex64"])
def test_holes_that_nothing_declares_stay_holes(tmp_path: Path, dtype: str, hole: float) -> None:
    bands = np.stack([amplitude(), amplitude(1)]).astype(dtype)
    bands[0, 100:120, 50:90] = hole
    bands[1, 300:330, 400:420] = hole
    path = write_raster(tmp_path / "in.tif", bands)
    found = masks(filter_speckle(path, tmp_path / "out.tif", "lee", looks=LOOKS).output)
    np.testing.assert_array_equal(found, np.isfinite(bands))


@pytest.mark.parametrize("nodata", [0.0, 5.0])
def test_holes_of_complex_images_stay_holes(tmp_path: Path, nodata: float) -> None:
    image = (amplitude() * 1j).astype(np.complex64)
    image[100:120, 50:90] = nodata
    path = write_raster(tmp_path / "in.tif", image, nodata=nodata)
    found = masks(filter_speckle(path, tmp_path / "out.tif", "lee", looks=LOOKS).output)
    np.testing.assert_array_equal(found[0], image != nodata)


@pytest.mark.parametrize("name", ["lee", "isef"])
@pytest.mark.parametrize(("dtype", "nodata"), [("uint16", 1000), ("int32", 1000), ("uint8", 100)])
def test_no_filtered_value_becomes_the_nodata_value(
    tmp_path: Path, dtype: str, nodata: int, name: str
) -> None:
    image = np.rint(amplitude() * nodata / 1000).clip(0, 255 if dtype == "uint8" else None)
    image[image == nodata] += 1
    image[:20] = nodata
    path = write_raster(tmp_path / "in.tif", image.astype(dtype), nodata=nodata)
    out = filter_speckle(path, tmp_path / "out.tif", name, looks=LOOKS).output
    np.testing.assert_array_equal(masks(out), masks(path))


def test_holes_of_one_band_cannot_be_stated_by_a_mask_of_all(tmp_path: Path) -> None:
    bands = np.stack([amplitude(), amplitude(1)]).astype(np.float32)
    bands[1, 300:330, 400:420] = np.nan
    mask = np.full(SIZE, 255, np.uint8)
    mask[:50] = 0
    path = write_raster(tmp_path / "in.tif", bands, mask=mask)
    with pytest.raises(ParameterError, match="at different pixels"):
        filter_speckle(path, tmp_path / "out.tif", "lee", looks=LOOKS)
    assert not (tmp_path / "out.tif").exists()


def test_complex_pixels_become_amplitudes(tmp_path: Path) -> None:
    phase = np.exp(2j * np.pi * np.random.default_rng(3).random(SIZE))
    image = amplitude().astype(np.float32)
    path = write_raster(tmp_path / "in.tif", (image * phase).astype(np.complex64))
    out = read(filter_speckle(path, tmp_path / "out.tif", "kuan", looks=LOOKS).output)
    assert out.dtype == np.float32
    expected = SpeckleFilter("kuan", 7, LOOKS)(image**2, np.ones(SIZE, bool))
    np.testing.assert_allclose(out[0], np.sqrt(expected), rtol=2e-3)


def test_the_result_is_known_as_a_radars_even_when_it_was_warped(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "in.tif", amplitude().astype(np.float32), utm_grid(*SIZE[::-1]))
    with open_raster(path) as source:
        assert not is_known_radar(source)
        as_claimed = Transform.nominal(source.grid.crs, source.grid)
    filter_speckle(path, tmp_path / "out.tif", "gamma-map", 5)
    (tmp_path / "transform.json").write_text(json.dumps(as_claimed.to_json()))
    warp(tmp_path / "out.tif", tmp_path / "warped.tif", tmp_path / "transform.json")
    for name in ("out.tif", "warped.tif"):
        with open_raster(tmp_path / name) as source:
            assert is_known_radar(source)
            assert source.tags[""][SPECKLE_FILTER] == "gamma-map, 5 px"


def test_what_cannot_be_is_refused(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "in.tif", amplitude().astype(np.float32))
    with pytest.raises(ParameterError, match="odd number, not 6"):
        filter_speckle(path, tmp_path / "out.tif", window=6)
    empty = write_raster(tmp_path / "empty.tif", np.zeros((40, 40), np.uint8), nodata=0)
    with pytest.raises(RasterContentError, match="no valid pixels"):
        filter_speckle(empty, tmp_path / "out.tif")
    assert not (tmp_path / "out.tif").exists()


@pytest.mark.parametrize("values", VALUES)
@pytest.mark.parametrize("dtype", ["float32", "int16"])
def test_decibels_are_refused(tmp_path: Path, dtype: str, values: str) -> None:
    decibels = (20 * np.log10(amplitude() / 1e4)).astype(dtype)
    path = write_raster(tmp_path / "in.tif", decibels)
    with pytest.raises(RasterContentError, match="below 0"):
        filter_speckle(path, tmp_path / "out.tif", values=values)
    assert not (tmp_path / "out.tif").exists()


def stating(path: Path, image: np.ndarray, **states: list[Any]) -> Path:
    """Write an image that states some of units, scales, offsets, descriptions of its bands."""
    with rasterio.open(write_raster(path, image), "r+") as dataset:
        for name, values in states.items():
            setattr(dataset, name, values)
    return path


@pytest.mark.parametrize("unit", ["dB", "db", "DB", "Decibel", "sigma0_db"])
@pytest.mark.parametrize("place", [0.0, -60.0])
def test_decibels_are_refused_that_are_stored_as_numbers_above_0(
    tmp_path: Path, place: float, unit: str
) -> None:
    decibels = 20 * np.log10(amplitude())
    stored = np.rint((decibels - place) * 100).astype(np.uint16)
    path = stating(tmp_path / "in.tif", stored, scales=[0.01], offsets=[place], units=[unit])
    with pytest.raises(RasterContentError, match=r"in\.tif is in decibels"):
        filter_speckle(path, tmp_path / "out.tif")
    assert not (tmp_path / "out.tif").exists()


@pytest.mark.parametrize("looks", [None, LOOKS])
def test_numbers_with_an_offset_are_refused(tmp_path: Path, looks: float | None) -> None:
    image = np.rint(amplitude()).astype(np.uint16)
    path = stating(tmp_path / "in.tif", image, scales=[0.5], offsets=[-100.0])
    with pytest.raises(RasterContentError, match=r"in\.tif states an offset \(-100\)"):
        filter_speckle(path, tmp_path / "out.tif", looks=looks)
    assert not (tmp_path / "out.tif").exists()


def test_numbers_with_a_scale_and_another_unit_are_filtered(tmp_path: Path) -> None:
    image = np.rint(amplitude()).astype(np.uint16)
    plain = filter_speckle(write_raster(tmp_path / "in.tif", image), tmp_path / "plain.tif")
    path = stating(tmp_path / "in.tif", image, scales=[0.01], units=["dBase"])
    scaled = filter_speckle(path, tmp_path / "out.tif")
    np.testing.assert_array_equal(read(scaled.output), read(plain.output))


def test_a_palette_is_refused(tmp_path: Path) -> None:
    image = (amplitude() / 40).clip(0, 255).astype(np.uint8)
    path = write_raster(tmp_path / "in.tif", image)
    with rasterio.open(path, "r+") as dataset:
        dataset.write_colormap(1, {value: (value, value, value, 255) for value in range(256)})
    with pytest.raises(RasterContentError, match=r"in\.tif has a palette"):
        filter_speckle(path, tmp_path / "out.tif")
    assert not (tmp_path / "out.tif").exists()


def test_a_negative_number_is_refused_wherever_it_is_unless_it_is_nodata(tmp_path: Path) -> None:
    image = amplitude().astype(np.float32)
    image[3, 5] = -9999
    path = write_raster(tmp_path / "in.tif", image)
    with pytest.raises(RasterContentError, match="below 0"):
        filter_speckle(path, tmp_path / "out.tif")
    filter_speckle(write_raster(path, image, nodata=-9999), tmp_path / "out.tif")
    assert masks(tmp_path / "out.tif").sum() == image.size - 1
