"""Which files a virtual raster is made of."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest
import rasterio
import rasterio.shutil
from raster_files import utm_grid, write_raster
from rasterio.vrt import WarpedVRT

from groundtie.vrt_sources import sources_of

VALUES = np.arange(200, dtype=np.uint8).reshape(10, 20)


@pytest.fixture
def image(tmp_path: Path) -> Path:
    return write_raster(tmp_path / "a.tif", VALUES, utm_grid(20, 10))


def test_the_sources_of_virtual_rasters_are_found_at_any_depth(image: Path) -> None:
    inner, outer, warped, own = (
        image.with_name(f"{name}.vrt") for name in ("inner", "outer", "warped", "own")
    )
    rasterio.shutil.copy(image, inner, driver="VRT")
    outer.write_text(inner.read_text().replace("a.tif", "inner.vrt"))
    with rasterio.open(image) as dataset, WarpedVRT(dataset, crs="EPSG:4326") as other:
        rasterio.shutil.copy(other, warped, driver="VRT")
    warped.write_text(warped.read_text().replace("a.tif", "inner.vrt"))
    for virtual in (outer, warped):
        with rasterio.open(virtual) as dataset:
            assert dataset.read().any()
    assert sources_of(outer) == sources_of(warped) == [inner, image]
    assert sources_of(image) == sources_of(image.with_name("none.vrt")) == []
    own.write_text(inner.read_text().replace("a.tif", "own.vrt"))
    assert sources_of(own) == []
    inner.write_text("<VRTDataset>")
    assert sources_of(outer) == [inner]


def test_raw_bands_and_other_endings_count(tmp_path: Path) -> None:
    """GDAL minds neither the case of its words, nor what a file is called."""
    (tmp_path / "raw.bin").write_bytes(VALUES.tobytes())
    virtual = tmp_path / "virtual.xml"
    virtual.write_text(
        '<VRTDataset rasterXSize="20" rasterYSize="10">'
        '<VRTRasterBand dataType="Byte" band="1" subClass="VRTRawRasterBand">'
        '<SourceFilename relativetoVRT="1">raw.bin</SourceFilename>'
        "<PixelOffset>1</PixelOffset><LineOffset>20</LineOffset>"
        "</VRTRasterBand></VRTDataset>"
    )
    with rasterio.open(virtual) as dataset:
        np.testing.assert_array_equal(dataset.read(1), VALUES)
    assert sources_of(virtual) == [tmp_path / "raw.bin"]


@pytest.mark.parametrize("is_relative", [False, True])
def test_a_source_in_an_archive_is_the_archive(image: Path, is_relative: bool) -> None:
    archive = image.with_name("a.zip")
    with zipfile.ZipFile(archive, "w") as file:
        file.write(image, "a.tif")
    virtual = image.with_name("v.vrt")
    rasterio.shutil.copy(f"/vsizip/{archive}/a.tif", virtual, driver="VRT")
    text = virtual.read_text()
    assert "/vsizip/" in text
    if is_relative:
        text = text.replace(f"/vsizip/{archive}", "/vsizip/a.zip")
        text = text.replace('relativeToVRT="0"', 'relativeToVRT="1"')
        virtual.write_text(text)
    assert sources_of(virtual) == [archive]


def test_names_are_relative_to_where_a_link_leads(tmp_path: Path, image: Path) -> None:
    (tmp_path / "far").mkdir()
    (tmp_path / "deep" / "er").mkdir(parents=True)
    virtual = tmp_path / "far" / "v.vrt"
    rasterio.shutil.copy(image, virtual, driver="VRT")
    (tmp_path / "v.vrt").symlink_to(virtual)
    (tmp_path / "deep" / "er" / "link").symlink_to(tmp_path / "far")
    for name in ("v.vrt", "deep/er/link/v.vrt"):
        with rasterio.open(tmp_path / name) as dataset:
            np.testing.assert_array_equal(dataset.read(1), VALUES)
        assert sources_of(tmp_path / name) == [image]


def test_what_cannot_be_read_is_made_of_nothing(tmp_path: Path) -> None:
    """GDAL, which opens the raster, decides what becomes of it."""
    odd, loop = tmp_path / "odd.vrt", tmp_path / "loop.tif"
    odd.write_text('<?xml version="1.0" encoding="foo"?><VRTDataset/>')
    loop.symlink_to("loop.tif")
    to_loop = tmp_path / "to_loop.vrt"
    source = '<SourceFilename relativeToVRT="1">loop.tif</SourceFilename>'
    to_loop.write_text(f"<VRTDataset>{source}</VRTDataset>")
    assert sources_of(odd) == sources_of(loop) == sources_of(to_loop) == []
