from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import rasterio
from masks.test_ground import town
from raster_files import utm_grid, write_raster

from groundtie import mask_ground
from groundtie.errors import RasterContentError


def test_the_ground_between_buildings_is_written(tmp_path: Path) -> None:
    level_db, ground, roofs = town(1.0)
    speckle = np.random.default_rng(2).gamma(4, 1 / 4, level_db.shape)
    amplitude = np.sqrt(10 ** (level_db / 10) * speckle).astype(np.float32)
    grid = utm_grid(*amplitude.shape[::-1], 1.0)
    path = write_raster(tmp_path / "in.tif", amplitude, grid)
    result = mask_ground(path, tmp_path / "mask.tif")
    with rasterio.open(tmp_path / "mask.tif") as dataset:
        mask = dataset.read(1) > 0
    assert mask[ground].mean() > 0.4 and mask[roofs].mean() < 0.05
    assert mask[~ground & ~roofs].mean() < 0.01
    assert result.share == pytest.approx(mask.mean())
    assert list(result.summary()["files"]) == ["mask"]


def test_a_failure_leaves_nothing_behind(tmp_path: Path) -> None:
    path = write_raster(tmp_path / "in.tif", np.zeros((40, 40), np.uint8), nodata=0)
    with pytest.raises(RasterContentError):
        mask_ground(path, tmp_path / "mask.tif")
    assert [found.name for found in tmp_path.iterdir()] == ["in.tif"]
