"""GDAL's own messages go to the log of rasterio, not to the terminal, from every thread."""

from __future__ import annotations

import logging
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rasterio
from rasterio.enums import ColorInterp

from groundtie.context import threads
from groundtie.errors import RasterOpenError
from groundtie.rasters.grid import PIXEL_COORDINATES, Grid
from groundtie.rasters.reading import Window, open_raster
from groundtie.rasters.writing import create_like

SIDE = 1024


def write_bands(path: Path, template: Path, interleave: str) -> None:
    """Write three bands that are no colours through two threads."""
    with open_raster(template) as source:
        band = replace(source.bands[0], interpretation=ColorInterp.gray)
        like = replace(source, bands=(band,) * 3)
        grid = Grid(PIXEL_COORDINATES, None, SIDE, SIDE)
        with create_like(like, grid, path, nodata=None, interleave=interleave, workers=2) as out:
            out.write(np.ones((3, SIDE, SIDE), np.uint8))


@pytest.fixture
def template(tmp_path: Path) -> Path:
    path = tmp_path / "template.tif"
    profile = {"driver": "GTiff", "width": SIDE, "height": SIDE, "count": 1, "dtype": "uint8"}
    with (
        pytest.warns(rasterio.errors.NotGeoreferencedWarning),
        rasterio.open(path, "w", compress="deflate", tiled=True, **profile) as out,
    ):
        out.write(np.random.default_rng(0).integers(0, 255, (1, SIDE, SIDE), np.uint8))
    return path


@pytest.mark.parametrize("interleave", ["band", "pixel"])
def test_nothing_is_shown_of_a_file_that_threads_write(
    template: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], interleave: str
) -> None:
    write_bands(tmp_path / "out.tif", template, interleave)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("workers", [1, 2])
def test_nothing_is_shown_of_a_file_that_is_damaged(
    template: Path,
    capfd: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
    workers: int,
) -> None:
    content = bytearray(template.read_bytes())
    content[len(content) // 2 : len(content) // 2 + 2000] = bytes(2000)
    template.write_bytes(content)
    window = Window(0, 0, SIDE, SIDE)
    with (
        open_raster(template) as source,
        caplog.at_level(logging.DEBUG, "rasterio"),
        threads(workers) as context,
        pytest.raises(RasterOpenError),
    ):
        if workers == 1:
            source.read(window)
        list(context.map(source.read, [window] * 2))
    assert capfd.readouterr() == ("", "")
    assert any("ZIPDecode" in record.getMessage() for record in caplog.records)
