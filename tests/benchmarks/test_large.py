"""Large scenes: pairs whose truth is exact at every size, and what is measured on them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import rasterio
from affine import Affine
from raster_files import utm_grid, write_raster
from textured_pairs import texture

from benchmarks.accuracy import CORRECT, REFUSED
from benchmarks.attempt import Pair
from benchmarks.large import LARGEST_BYTES, LARGEST_SECONDS, Run, exponent, goals, register, table
from benchmarks.large_pairs import large_pair, repeat, wrong
from groundtie.rasters.grid import apply_affine
from groundtie.rasters.reading import open_raster

TILE_PX = 700


@pytest.fixture(scope="module")
def tile(tmp_path_factory: pytest.TempPathFactory) -> Pair:
    """Two images of one ground, of one band and of two, exactly on each other."""
    folder, grid = tmp_path_factory.mktemp("tile"), utm_grid(TILE_PX, TILE_PX)
    ground = 1000 + 200 * texture(TILE_PX, TILE_PX)
    noise = np.random.default_rng(0).normal(0, 40, (3, TILE_PX, TILE_PX))
    image = (ground + noise).astype(np.uint16)
    return Pair(
        write_raster(folder / "reference.tif", image[0], grid, tiled=True),
        write_raster(folder / "input.tif", image[1:], grid, tiled=True),
    )


def run_of(size: int, seconds: float, peak_bytes: float = 1e9, verdict: str = CORRECT) -> Run:
    return Run(size, seconds / 2, seconds, int(peak_bytes), verdict, None)


def test_the_square_is_mirrored_and_cut(tile: Pair, tmp_path: Path) -> None:
    repeat(tile.input, tmp_path / "a.tif", 1000, Affine.identity())
    with rasterio.open(tile.input) as source, rasterio.open(tmp_path / "a.tif") as target:
        more = (0, TILE_PX)
        expected = np.pad(source.read(), ((0, 0), more, more), "symmetric")[:, :1000, :1000]
        np.testing.assert_array_equal(target.read(), expected)
        assert target.transform == source.transform


@pytest.mark.parametrize("size", [2000, 30_000])
def test_the_input_is_wrong_by_its_shift_and_at_the_borders_by_more(size: int) -> None:
    centre = [size / 2, size / 2]
    moved = apply_affine(wrong(size), [centre, [0, 0]]) - [centre, [0, 0]]
    # At the corner by 3 px of scale and 3 px of rotation, whatever the size.
    np.testing.assert_allclose(moved, [[5, -6], [5 - 3 + 3, -6 - 3 + 3]], atol=1e-9)


@pytest.mark.slow
def test_a_pair_of_any_size_is_registered_to_its_truth(tile: Pair, tmp_path: Path) -> None:
    found = register(large_pair(tile, 900, tmp_path), 900)
    assert found.verdict == CORRECT
    assert found.error_px is not None and found.error_px < 0.2
    assert found.peak_bytes > 1e8 and found.processor_seconds > 0.5


def test_the_claimed_place_of_the_input_is_the_wrong_one(tile: Pair, tmp_path: Path) -> None:
    pair = large_pair(tile, 900, tmp_path)
    with open_raster(pair.reference) as reference, open_raster(pair.input) as input:
        claimed = reference.grid.map_to_pixel(input.grid.pixel_to_map([[449.5, 449.5]]))
    np.testing.assert_allclose(claimed, [[454.5, 443.5]])


@pytest.mark.parametrize("power", [0.5, 1.0, 1.2])
def test_the_power_of_time_is_that_of_pixels(power: float) -> None:
    runs = [run_of(size, 1e-6 * (size**2) ** power) for size in (2000, 10_000, 30_000)]
    assert exponent(runs) == pytest.approx(power)


@pytest.mark.parametrize(
    ("changed", "missed"),
    [
        ({}, []),
        ({"seconds": 2 * LARGEST_SECONDS + 2}, ["Time of 30000² px"]),
        ({"peak_bytes": LARGEST_BYTES + 1}, ["Peak memory of 30000² px"]),
        ({"verdict": REFUSED}, ["Correct"]),
    ],
)
def test_goals_are_of_the_largest(changed: dict[str, float], missed: list[str]) -> None:
    runs = [run_of(2000, 11.0, 5e8), run_of(30_000, **{"seconds": 600.0, **changed})]
    found = goals(runs, is_complete=True)
    assert [goal.what for goal in found if not goal.reached] == missed


def test_a_few_cases_reach_no_goal() -> None:
    runs = [run_of(1000, 5.0), run_of(2000, 11.0)]
    assert all(goal.reached is None for goal in goals(runs, is_complete=False))
    assert table(runs).rows[1] == ["2000²", "5.5", "11.0", "2.75", "1000", "correct"]
