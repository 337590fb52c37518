from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import rasterio
from masks.town import draw_town
from raster_files import utm_grid, write_raster

from groundtie import mask_regions
from groundtie.errors import RasterContentError


def read(path: Path) -> np.ndarray:
    with rasterio.open(path) as dataset:
        return dataset.read(1) > 0


def test_mask_regions_and_skeleton_are_written(tmp_path: Path) -> None:
    town = draw_town()
    path = write_raster(tmp_path / "in.tif", town.amplitude, utm_grid(400, 400, 1.0))
    files = [tmp_path / f"{name}.tif" for name in ("mask", "regions", "skeleton")]
    result = mask_regions(path, *files, mask_width=9.0)
    mask, regions, skeleton = map(read, files)
    assert regions[town.ground].mean() > 0.7 and regions[~town.ground].mean() < 0.05
    assert 0 < skeleton.sum() < 0.2 * regions.sum()
    assert result.share == pytest.approx(mask.mean())
    assert result.numbers["skeleton_m"] > 600
    assert list(result.summary()["files"]) == ["mask", "regions", "skeleton"]


def test_a_failure_leaves_nothing_behind(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "in.tif", np.zeros((40, 40), np.uint8), nodata=0)
    with pytest.raises(RasterContentError):
        mask_regions(path, tmp_path / "mask.tif", tmp_path / "regions.tif")
    assert [found.name for found in tmp_path.iterdir()] == ["in.tif"]
