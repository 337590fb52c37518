"""Areas of zeros that a raster does not declare to be without data take no part."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from raster_files import utm_grid, write_raster

from groundtie.rasters.pair import Image
from groundtie.rasters.patch import Patch
from groundtie.rasters.reading import open_raster

SIZE_PX = 60


def read(path: Path) -> Patch:
    with open_raster(path) as source:
        return Image(source).read_onto(source.grid, source.grid.map_to_pixel)


@pytest.fixture
def values() -> np.ndarray:
    """Values from 1 on, with a collar of zeros, single zeros and a small area of them."""
    values = np.random.default_rng(0).integers(1, 1000, (SIZE_PX, SIZE_PX)).astype(np.uint16)
    values[:, :20] = 0
    values[40, 50] = 0
    values[10:14, 50:54] = 0
    return values


def test_a_collar_and_its_edge_are_left_out(tmp_path: Path, values: np.ndarray) -> None:
    patch = read(write_raster(tmp_path / "r.tif", values, utm_grid(SIZE_PX, SIZE_PX)))
    assert not patch.valid[:, :20].any()
    # The margin is what interpolation takes from the collar.
    assert not patch.valid[:, 20:22].any()
    assert patch.valid[:, 22:].all()
    np.testing.assert_array_equal(patch.values[:, 22:], values[:, 22:])


def test_a_raster_that_says_what_is_valid_is_believed(tmp_path: Path, values: np.ndarray) -> None:
    grid = utm_grid(SIZE_PX, SIZE_PX)
    patch = read(write_raster(tmp_path / "r.tif", values, grid, nodata=65535))
    assert patch.valid.all()
