from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import rasterio
from raster_files import write_raster

from groundtie.errors import BandError
from groundtie.rasters.radar_tags import SPECKLE_FILTER, is_known_radar, with_speckle_filter
from groundtie.rasters.reading import open_raster
from groundtie.rasters.writing import create_like

GREY = np.arange(12, dtype=np.uint8).reshape(3, 4)


def tagged(path: Path, *polarisations: str | None, tag: str = "POLARIMETRIC_INTERP") -> Path:
    """Write bands, as products that GDAL's reader of a radar's was copied from."""
    write_raster(path, np.stack([GREY] * len(polarisations)))
    with rasterio.open(path, "r+") as dataset:
        for number, polarisation in enumerate(polarisations, start=1):
            if polarisation is not None:
                dataset.update_tags(number, **{tag: polarisation})
    return path


def test_an_image_that_says_nothing_may_be_anything(tmp_path: Path) -> None:
    with open_raster(write_raster(tmp_path / "a.tif", GREY)) as source:
        assert not is_known_radar(source)


def test_complex_pixels_are_a_radars(tmp_path: Path) -> None:
    with open_raster(write_raster(tmp_path / "a.tif", GREY.astype(np.complex64))) as source:
        assert is_known_radar(source)


@pytest.mark.parametrize("tag", ["POLARIMETRIC_INTERP", "POLARIZATION"])
def test_polarisation_is_of_the_bands_that_are_matched(tmp_path: Path, tag: str) -> None:
    with open_raster(tagged(tmp_path / "a.tif", "VV", "VH", None, tag=tag)) as source:
        assert is_known_radar(source, 1) and is_known_radar(source, 2)
        assert not is_known_radar(source, 3)
        assert not is_known_radar(source)
        with pytest.raises(BandError, match="no band 4"):
            is_known_radar(source, 4)
    with open_raster(tagged(tmp_path / "b.tif", "HH", "HV", tag=tag)) as source:
        assert is_known_radar(source)


def test_a_radiometers_polarisation_is_no_radars(tmp_path: Path) -> None:
    """One letter: what is received. Nothing was sent."""
    with open_raster(tagged(tmp_path / "a.tif", "V")) as source:
        assert not is_known_radar(source)


def test_the_speckle_filter_is_told_besides_what_the_file_says(tmp_path: Path) -> None:
    write_raster(tmp_path / "a.tif", GREY)
    with rasterio.open(tmp_path / "a.tif", "r+") as dataset:
        dataset.update_tags(PLACE="here")
    with open_raster(tmp_path / "a.tif") as source:
        like = with_speckle_filter(source, "lee, 7 px")
        with create_like(like, source.grid, tmp_path / "b.tif", nodata=None) as dataset:
            dataset.write(GREY, 1)
    with rasterio.open(tmp_path / "b.tif") as dataset:
        assert dataset.tags()[SPECKLE_FILTER] == "lee, 7 px"
        assert dataset.tags()["PLACE"] == "here"
    with open_raster(tmp_path / "b.tif") as source:
        assert is_known_radar(source)
