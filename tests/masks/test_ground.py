from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from raster_files import utm_grid, write_raster

from groundtie.errors import RasterContentError
from groundtie.masks.ground import (
    distance_back_px,
    find_ground,
    ground_between_buildings,
    shows_ground,
)
from groundtie.masks.scene import Scene
from groundtie.rasters.reading import Mask, open_raster

GROUND_DB, ROOF_DB, LAYOVER_DB, SHADOW_DB = 50.0, 50.0, 60.0, 35.0

# Along the range: layover, roof, shadow, ground as wide as the roof.
LAYOVER_M, WIDE_M, SHADOW_M = 7.0, 11.0, 9.0
PITCH_M, ROWS = LAYOVER_M + 2 * WIDE_M + SHADOW_M, 6


def town(pixel_m: float, quarters: int = 0) -> tuple[NDArray[np.float32], Mask, Mask]:
    """Return the level in decibels, the ground and the roofs of rows of buildings.

    Roofs and ground are as bright and as wide as each other; the radar looks to the right, and the
    scene is rotated by some quarters, counterclockwise.
    """
    size_px = round(ROWS * PITCH_M / pixel_m)
    along_m = (np.arange(size_px) + 0.5) * pixel_m % PITCH_M
    ends = np.cumsum([LAYOVER_M, WIDE_M, SHADOW_M])
    kind = np.tile(np.searchsorted(ends, along_m), (size_px, 1))
    level = np.array([LAYOVER_DB, ROOF_DB, SHADOW_DB, GROUND_DB], np.float32)[kind]
    level += np.random.default_rng(1).normal(0, 0.5, level.shape).astype(np.float32)
    level, kind = (np.ascontiguousarray(np.rot90(of, quarters)) for of in (level, kind))
    return level, kind == 3, kind == 1


@pytest.mark.parametrize("quarters", range(4))
@pytest.mark.parametrize("pixel_m", [0.5, 1.0])
def test_ground_lies_between_shadow_and_layover_and_roofs_do_not(
    quarters: int, pixel_m: float
) -> None:
    level, ground, roofs = town(pixel_m, quarters)
    found = ground_between_buildings(level, np.ones(level.shape, bool), pixel_m)
    assert found[ground].mean() > 0.7
    assert found[roofs].mean() < 0.05
    assert found[~ground & ~roofs].mean() < 0.01


def test_large_pixels_beside_a_building_are_no_ground() -> None:
    level, ground, _ = town(1.0)
    found = ground_between_buildings(level, np.ones(level.shape, bool), 10.0)
    inner = ground[:, 1:-1] & ground[:, :-2] & ground[:, 2:]
    outer = ground[:, 1:-1] & ~inner
    assert found[:, 1:-1][inner].any() and not found[:, 1:-1][outer].any()


def test_ground_is_sought_in_valid_pixels_alone() -> None:
    level, ground, _ = town(0.5)
    valid = np.ones(level.shape, bool)
    valid[: len(level) // 2] = False
    found = ground_between_buildings(level, valid, 0.5)
    assert not found[~valid].any()
    assert found[ground & valid].mean() > 0.5


@pytest.mark.parametrize(
    ("azimuth_deg", "way"),
    [(0, (-1, 0)), (90, (0, 1)), (180, (1, 0)), (270, (0, -1)), (135, (1, 1)), (315, (-1, -1))],
)
def test_distances_are_those_behind_a_place(azimuth_deg: float, way: tuple[int, int]) -> None:
    mask = np.zeros((41, 51), bool)
    mask[20, 25] = True
    found = distance_back_px(mask, azimuth_deg)
    steps = np.arange(15)
    rows, cols = 20 + steps * way[0], 25 + steps * way[1]
    np.testing.assert_allclose(found[rows, cols], steps * np.hypot(*way), rtol=1e-6)
    assert np.isinf(found[20 - way[0], 25 - way[1]])
    # Nobody beside the line has it before him.
    on_line = np.zeros(mask.shape, bool)
    steps = np.arange(26) if way[0] == 0 else np.arange(21)
    on_line[20 + steps * way[0], 25 + steps * way[1]] = True
    assert np.isinf(found[~on_line]).all()


def test_distances_on_a_slanting_line_are_those_on_the_ground() -> None:
    mask = np.zeros((60, 90), bool)
    mask[50, 10] = True
    found = distance_back_px(mask, 60.0)
    rows, cols = np.nonzero(np.isfinite(found))
    east, north = cols - 10, 50 - rows
    np.testing.assert_allclose(np.hypot(east, north), found[rows, cols], atol=1)
    aside = east * np.cos(np.deg2rad(60)) - north * np.sin(np.deg2rad(60))
    # Both ends of a line are rounded to pixels.
    assert np.abs(aside).max() <= 1 and len(rows) == 80


def test_bright_ground_between_shadow_and_layover_takes_part(
    tmp_path: Path,
) -> None:
    # The radar looks to the right: rows of buildings, of which it shows layover, then shadow.
    level_db = np.full((480, 480), 50.0)
    for col in range(0, 480, 60):
        level_db[:, col : col + 13] = 60
        level_db[:, col + 13 : col + 28] = 35
    level_db[::60] = 50
    level_db[185:295, 240:255], level_db[185:295, 285:300] = 35, 60
    level_db[185:295, 255:285] = 54.5
    speckle = np.random.default_rng(1).gamma(4, 1 / 4, level_db.shape)
    amplitude = np.sqrt(10 ** (level_db / 10) * speckle).astype(np.float32)
    scene = Scene.of(
        open_raster(write_raster(tmp_path / "a.tif", amplitude, utm_grid(480, 480, 1.0)))
    )
    square, street = np.s_[190:290, 264:276], np.s_[70:170, 43:48]
    found = find_ground(scene).select(scene.whole).part
    assert found[square].mean() > 0.9 and found[street].mean() > 0.9
    assert found[level_db == 35].mean() < 0.01 and found[level_db == 60].mean() < 0.05


@pytest.mark.parametrize(
    ("size_px", "pixel_m", "expected"),
    [
        (400, 3.0, True),
        (400, 3.5, False),
        # 25 million pixels are reduced to a quarter, of twice the size.
        (5000, 1.5, True),
        (5000, 2.0, False),
    ],
)
def test_large_pixels_do_not_resolve_ground(
    tmp_path: Path, size_px: int, pixel_m: float, expected: bool
) -> None:
    like = open_raster(write_raster(tmp_path / "a.tif", np.ones((40, 40), np.float32)))
    scene = Scene(utm_grid(size_px, size_px, pixel_m), Scene.of(like).read, like)
    assert shows_ground(scene) == expected
    if not expected:
        with pytest.raises(RasterContentError, match="does not resolve the ground"):
            find_ground(scene)
