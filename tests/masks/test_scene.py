"""Windows of one image, and means over its blocks."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from raster_files import utm_grid, write_raster

from groundtie.masks import scene as scene_module
from groundtie.masks.scene import Scene
from groundtie.rasters.reading import open_raster

SIDE_PX, FACTOR = 120, 4


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    """A scene whose blocks have the means 1, 2, … in their order; the first block is not valid."""
    blocks = np.arange((SIDE_PX // FACTOR) ** 2, dtype=np.float32).reshape(-1, SIDE_PX // FACTOR)
    image = np.kron(blocks, np.ones((FACTOR, FACTOR), np.float32))
    grid = utm_grid(SIDE_PX, SIDE_PX)
    return Scene.of(open_raster(write_raster(tmp_path / "a.tif", image, grid, nodata=0)))


def test_all_means_of_a_small_scene_are_taken(scene: Scene) -> None:
    assert scene.sample(FACTOR, 1000).tolist() == list(range(1, 900))


def test_of_a_large_scene_tiles_along_diagonals_are_taken(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(scene_module, "BLOCK", 2 * FACTOR + 1)
    taken = np.isin(np.arange(900), scene.sample(FACTOR, 200)).reshape(30, 30)
    tiles = taken.reshape(15, 2, 15, 2).mean(axis=(1, 3))
    tiles[0, 0] = 1  # of which a block is not valid
    rows, cols = np.indices(tiles.shape)
    np.testing.assert_array_equal(tiles, (rows + cols) % 4 == 0)
