from __future__ import annotations

from pathlib import Path

import numpy as np
import rasterio
from raster_files import write_raster

from groundtie.rasters.radar_tags import SPECKLE_FILTER, is_known_radar, with_speckle_filter
from groundtie.rasters.reading import open_raster
from groundtie.rasters.writing import create_like

GREY = np.arange(12, dtype=np.uint8).reshape(3, 4)


def test_an_image_that_says_nothing_may_be_anything(tmp_path: Path) -> None:
    with open_raster(write_raster(tmp_path / "a.tif", GREY)) as source:
        assert not is_known_radar(source)


def test_complex_pixels_are_a_radars(tmp_path: Path) -> None:
    with open_raster(write_raster(tmp_path / "a.tif", GREY.astype(np.complex64))) as source:
        assert is_known_radar(source)


def test_the_speckle_filter_is_told_besides_what_the_file_says(tmp_path: Path) -> None:
    write_raster(tmp_path / "a.tif", GREY)
    with rasterio.open(tmp_path / "a.tif", "r+") as dataset:
        dataset.update_tags(PLACE="here")
    with open_raster(tmp_path / "a.tif") as source:
        like = with_speckle_filter(source, "lee, 7 px")
        with create_like(like, source.grid, tmp_path / "b.tif", nodata=None) as dataset:
            dataset.write(GREY)
    with rasterio.open(tmp_path / "b.tif") as dataset:
        assert dataset.tags()[SPECKLE_FILTER] == "lee, 7 px"
        assert dataset.tags()["PLACE"] == "here"
    with open_raster(tmp_path / "b.tif") as source:
        assert is_known_radar(source)
