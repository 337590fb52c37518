"""Memory does not grow with the scene, but for what the budget allows, which changes no result."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from affine import Affine
from raster_files import utm_grid, write_raster
from textured_pairs import pixels, texture

from benchmarks.attempt import Pair
from benchmarks.large_pairs import large_pair, repeat
from benchmarks.processes import measure
from groundtie.geometry.models import shift_model
from groundtie.geometry.transform import Transform
from groundtie.rasters.reading import open_raster

TILE_PX = 1000
BUDGET_MB, CACHE_BYTES = 100, 20_000_000

# What the allocator keeps differs from run to run.
SCATTER_BYTES = 48_000_000

# As much as the machine has would be taken, unless a tool asks for less.
CALL = f"""
import os
os.environ["GDAL_CACHEMAX"] = "4000"
import groundtie, sys
from groundtie.memory import set_heaps
set_heaps()
os.environ["GROUNDTIE_MEMORY"] = "{BUDGET_MB}"
tool, *files = sys.argv[1:]
"""
WARP = CALL + "groundtie.warp(*files[:2], transform=files[2], resampling='nearest', workers=2)"
COREGISTER = CALL + "groundtie.coregister(*files, workers=2)"


@pytest.fixture(scope="module")
def tile(tmp_path_factory: pytest.TempPathFactory) -> Pair:
    """Two images of one ground, of one band and of four."""
    folder, grid = tmp_path_factory.mktemp("tile"), utm_grid(TILE_PX, TILE_PX)
    ground = 1000 + 200 * texture(TILE_PX, TILE_PX)
    image = (ground + np.random.default_rng(0).normal(0, 40, (5, TILE_PX, TILE_PX))).astype("u2")
    return Pair(
        write_raster(folder / "reference.tif", image[0], grid, tiled=True),
        write_raster(folder / "input.tif", image[1:], grid, tiled=True),
    )


def peak_bytes(code: str, *files: Path) -> int:
    found = measure([sys.executable, "-c", code, "", *map(str, files)])
    assert found.exit_code == 0
    return found.peak_bytes


@pytest.fixture(scope="module")
def moved_image(
    tile: Pair, tmp_path_factory: pytest.TempPathFactory
) -> Callable[[int], tuple[Path, Path]]:
    """Return the function that makes an image of a size and a transform that moves it, once."""
    folder = tmp_path_factory.mktemp("moved")

    @cache
    def make(size: int) -> tuple[Path, Path]:
        image, transform = folder / f"{size}.tif", folder / f"{size}.json"
        repeat(tile.input, image, size, Affine.identity())
        with open_raster(image) as source:
            moved = Transform(shift_model(20.0, 30.0), source.grid.crs, source.grid)
        transform.write_text(json.dumps(moved.to_json()))
        return image, transform

    return make


@pytest.mark.slow
def test_of_warp(moved_image: Callable[[int], tuple[Path, Path]], tmp_path: Path) -> None:
    """A scene of 128 MB takes no more than one of 8 MB and the cache."""
    peaks = []
    for size in (1000, 4000):
        image, transform = moved_image(size)
        peaks.append(peak_bytes(WARP, image, tmp_path / f"{size}_out.tif", transform))
    assert peaks[1] - peaks[0] < CACHE_BYTES + SCATTER_BYTES


@pytest.mark.slow
def test_of_a_registration(tile: Pair, tmp_path: Path) -> None:
    """A whole image of 25 million pixels in memory would take 100 MB."""
    peaks = []
    for size in (2000, 5000):
        pair = large_pair(Pair(tile.reference, tile.reference), size, tmp_path)
        peaks.append(peak_bytes(COREGISTER, pair.reference, pair.input, tmp_path / "out.tif"))
    assert peaks[1] - peaks[0] < CACHE_BYTES + SCATTER_BYTES


COMMAND = ("-m", "groundtie")
# No image is held in memory as a whole, as small ones are.
OF_A_LARGE_SCENE = """
import sys
from groundtie.cli import main
from groundtie.matching import chip_windows
chip_windows._HELD_PIXELS = 0
sys.exit(main())
"""


def budget_of(
    folder: Path,
    megabytes: int | None,
    *words: str | Path,
    command: tuple[str, str] = COMMAND,
) -> tuple[int, bytes]:
    """Return the peak memory of a command with a budget, and the raster that it wrote."""
    option = [] if megabytes is None else ["--memory", str(megabytes)]
    output = folder / "out.tif"
    found = measure([sys.executable, *command, *option, *map(str, words), "--workers", "2"])
    assert found.exit_code == 0
    return found.peak_bytes, output.read_bytes()


@pytest.mark.slow
def test_a_small_budget_is_kept_and_changes_no_byte(
    moved_image: Callable[[int], tuple[Path, Path]], tmp_path: Path
) -> None:
    """A scene of 128 MB fits into GDAL's cache by default, and a fifth of 100 MB is 20 MB.

    Libraries and the tiles at work are the same for a scene of a few tiles, and no part of it.
    """

    def warp(megabytes: int | None, image: Path, transform: Path) -> tuple[int, bytes]:
        words = ["warp", image, tmp_path / "out.tif", "--transform", transform]
        return budget_of(tmp_path, megabytes, *words)

    moved = moved_image(4000)
    (usual, raster), (small, same) = (warp(one, *moved) for one in (None, BUDGET_MB))
    few_tiles, _ = warp(BUDGET_MB, *moved_image(1000))
    assert same == raster
    assert small < usual - (128_000_000 - CACHE_BYTES) + SCATTER_BYTES
    assert small - few_tiles < BUDGET_MB * 1_000_000


@pytest.mark.slow
def test_a_registration_is_the_same_with_any_budget(tile: Pair, tmp_path: Path) -> None:
    # Its input of 24 MB is more than a fifth of 100 MB: by its bands, which cost no matching.
    size = TILE_PX // 2
    bands = np.tile(pixels(tile.input)[:, :size, :size], (12, 1, 1))
    deep = write_raster(tmp_path / "deep.tif", bands, utm_grid(size, size), tiled=True)
    pair = large_pair(replace(tile, input=deep), size, tmp_path)
    words = ["coregister", pair.reference, pair.input, tmp_path / "out.tif"]
    (_, raster), (_, same) = (
        budget_of(tmp_path, one, *words, command=("-c", OF_A_LARGE_SCENE))
        for one in (None, BUDGET_MB)
    )
    assert same == raster
