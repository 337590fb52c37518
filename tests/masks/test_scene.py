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
    assert scene.sample(FACTOR).tolist() == list(range(1, 900))


@pytest.mark.parametrize("strip_pixels", [1, SIDE_PX * 7, 1 << 18])
def test_of_a_large_scene_every_so_many_are_taken(
    scene: Scene, monkeypatch: pytest.MonkeyPatch, strip_pixels: int
) -> None:
    monkeypatch.setattr(scene_module, "_SAMPLE", 200)
    monkeypatch.setattr(scene_module, "_STRIP_PIXELS", strip_pixels)
    assert scene.sample(FACTOR).tolist() == list(range(1, 900, 4))
