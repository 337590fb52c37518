from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import rasterio
from raster_files import utm_grid, write_raster

from groundtie import mask_threshold


def test_the_brightest_part_and_its_surroundings_are_masked(tmp_path: Path) -> None:
    image = np.random.default_rng(0).gamma(4, 20, (400, 600)).astype(np.uint16)
    image[100:140, 200:260] += 5000
    path = write_raster(tmp_path / "in.tif", image, utm_grid(600, 400, 2.0))
    percent = 100 * 40 * 60 / image.size
    result = mask_threshold(path, tmp_path / "mask.tif", percent, mask_growth=6.0)
    with rasterio.open(result.files["mask"]) as dataset:
        mask = dataset.read(1)
    # 6 m are 3 px; the corners of the growth are round.
    assert not mask[97:143, 200:260].any() and not mask[100:140, 197:263].any()
    assert mask[:96].all() and mask[144:].all() and mask[97, 197] == 1
    assert result.share == pytest.approx(mask.mean())
    assert result.summary()["low"] is None
    assert result.numbers["high"] < 5000


def test_without_a_percentage_all_valid_pixels_take_part(tmp_path: Path) -> None:
    image = np.ones((40, 40), np.uint8)
    image[:20] = 0
    path = write_raster(tmp_path / "in.tif", image, nodata=0)
    result = mask_threshold(path, tmp_path / "mask.tif", 0, 0)
    assert result.share == 1.0
    with rasterio.open(result.files["mask"]) as dataset:
        np.testing.assert_array_equal(dataset.read(1), image)


@pytest.mark.parametrize(
    ("high", "low", "words"),
    [
        (20, 0, "block means of at most 12.2"),
        (0, 20, "block means of at least 3.8"),
        (20, 20, "block means of 3.8 to 12.2"),
        (0, 0, "all block means"),
    ],
)
def test_which_means_take_part_in_words(
    tmp_path: Path, high: float, low: float, words: str
) -> None:
    # Means of 1 to 15: their percentiles of 20 and 80 are 3.8 and 12.2.
    image = np.arange(1, 16, dtype=np.float32).repeat(4)[None].repeat(4, axis=0)
    path = write_raster(tmp_path / "in.tif", image)
    assert mask_threshold(path, tmp_path / "mask.tif", high, low).lines()[0].endswith(f"; {words}")
