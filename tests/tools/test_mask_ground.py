from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import rasterio
from masks.test_ground import town
from raster_files import utm_grid, write_raster

from groundtie import mask_ground
from groundtie.errors import RasterContentError
from groundtie.rasters.grid import Grid


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


@pytest.mark.parametrize(
    ("grey_value", "grid", "reason"),
    [
        (0, utm_grid(40, 40, 1.0), "no valid pixels"),
        (9, utm_grid(40, 40, 4.0), "pixels are larger than 3 m"),
        (9, replace(utm_grid(40, 40, 1.0), crs=None), "has no CRS"),
        (9, None, "has no CRS"),
    ],
)
def test_a_failure_leaves_nothing_behind(
    tmp_path: Path, grey_value: int, grid: Grid | None, reason: str
) -> None:
    image = np.full((40, 40), grey_value, np.uint8)
    path = write_raster(tmp_path / "in.tif", image, grid, nodata=0)
    with pytest.raises(RasterContentError, match=reason):
        mask_ground(path, tmp_path / "mask.tif")
    assert [found.name for found in tmp_path.iterdir()] == ["in.tif"]
