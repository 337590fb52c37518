from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import rasterio
from raster_files import write_raster

from groundtie.masks.radar import (
    LEAST_VARIATION2,
    LEAST_VARIATION2_RATIO,
    is_in_decibels,
    power,
    variation2_of,
)
from groundtie.rasters.pair import Image
from groundtie.rasters.patch import Patch
from groundtie.rasters.reading import Window, open_raster


def variation2(path: Path, values: np.ndarray) -> float:
    with open_raster(write_raster(path, values.astype(np.float32))) as source:
        return variation2_of(Image(source))


@pytest.mark.parametrize("looks", [1, 4, 20])
def test_speckle_varies_more_than_the_grain_of_a_camera(tmp_path: Path, looks: int) -> None:
    random = np.random.default_rng(0)
    scene = np.kron(random.uniform(20, 200, (25, 25)), np.ones((8, 8)))
    radar = variation2(
        tmp_path / "a.tif", scene * np.sqrt(random.gamma(looks, 1 / looks, scene.shape))
    )
    camera = variation2(tmp_path / "b.tif", scene + random.normal(0, 3, scene.shape))
    assert radar > LEAST_VARIATION2_RATIO * camera
    # Twenty looks are as homogeneous as a camera's grain.
    assert (radar >= LEAST_VARIATION2) == (looks < 20)
    # Most homogeneous windows are so by chance, too.
    assert 0.3 < radar * looks < 1.2


@pytest.mark.parametrize("place", [(0, 0), (1800, 1800), (900, 100)])
def test_a_radar_image_in_a_corner_of_its_file_is_one(
    tmp_path: Path, place: tuple[int, int]
) -> None:
    """The middle of the file holds no data."""
    speckle = 50 * np.sqrt(np.random.default_rng(2).gamma(4, 1 / 4, (700, 700)))
    alone = variation2(tmp_path / "alone.tif", speckle)
    canvas = np.zeros((2500, 2500), np.float32)
    canvas[place[1] : place[1] + 700, place[0] : place[0] + 700] = speckle
    with open_raster(write_raster(tmp_path / "a.tif", canvas, nodata=0)) as source:
        found = variation2_of(Image(source))
    assert alone > LEAST_VARIATION2
    assert found == pytest.approx(alone, rel=0.1)


def test_what_counts_is_the_part_that_is_asked_for(tmp_path: Path) -> None:
    """A mosaic of a radar and a camera image."""
    random = np.random.default_rng(3)
    values = 50 + random.normal(0, 1, (2200, 2200))
    values[:1100, :1100] = 50 * np.sqrt(random.gamma(1, 1, (1100, 1100)))
    with open_raster(write_raster(tmp_path / "a.tif", values.astype(np.float32))) as source:
        image = Image(source)
        assert variation2_of(image, Window(0, 0, 1100, 1100)) > LEAST_VARIATION2
        assert variation2_of(image, Window(1100, 1100, 1100, 1100)) < LEAST_VARIATION2


@pytest.mark.parametrize(("unit", "name"), [("dB", None), (None, "Sigma0_VV_db"), (None, None)])
def test_positive_decibels_are_known_by_their_unit_or_name(
    tmp_path: Path, unit: str | None, name: str | None
) -> None:
    random = np.random.default_rng(1)
    amplitude = 50 * np.sqrt(random.gamma(1, 1, (200, 200)))
    path = write_raster(tmp_path / "a.tif", (20 * np.log10(amplitude) + 40).astype(np.float32))
    with rasterio.open(path, "r+") as dataset:
        if unit is not None:
            dataset.units = [unit]
        if name is not None:
            dataset.set_band_description(1, name)
    with open_raster(path) as source:
        image = Image(source)
        is_stated = unit is not None or name is not None
        assert is_in_decibels(image) == is_stated
        # Of one look; the most homogeneous windows are so by chance, too.
        assert (variation2_of(image) > 0.3) == is_stated


@pytest.mark.parametrize("unit", ["dB", ""])
def test_what_is_too_large_for_decibels_is_none(tmp_path: Path, unit: str) -> None:
    random = np.random.default_rng(2)
    amplitude = (300 * np.sqrt(random.gamma(1, 1, (200, 200)))).astype(np.uint16)
    path = write_raster(tmp_path / "a.tif", amplitude)
    with rasterio.open(path, "r+") as dataset:
        dataset.units = [unit]
    with open_raster(path) as source:
        assert not is_in_decibels(Image(source))
        assert variation2_of(Image(source)) > 0.3


def test_power_is_zero_where_invalid() -> None:
    patch = Patch(np.array([[3, 4]], np.float32), np.array([[True, False]]))
    np.testing.assert_array_equal(power(patch), [[9, 0]])
