"""The suite of cities with surface models: what it wants, and its rough model."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import rasterio
from benchmark_outcomes import outcome
from raster_files import utm_grid, write_raster

from benchmarks import towns
from benchmarks.accuracy import CORRECT, REFUSED, SILENTLY_WRONG, Truth
from benchmarks.attempt import Pair
from groundtie import simulate
from groundtie.geometry.views import View, split_views


def refused(setting: str) -> object:
    return outcome(group=setting, verdict=REFUSED, error_px=math.nan)


def test_goals() -> None:
    good = [outcome(group=towns.MODEL, error_px=0.5, verdict=CORRECT)] * 9
    assert [g.reached for g in towns.goals(towns.MODEL, [*good, refused(towns.MODEL)])] == [
        True,
        True,
    ]
    wrong = outcome(group=towns.MODEL, error_px=4.0, verdict=SILENTLY_WRONG)
    assert [g.reached for g in towns.goals(towns.MODEL, [*good, wrong, wrong])] == [False, False]
    assert [g.reached for g in towns.goals(towns.OTHER, good)] == [True, False]
    assert [g.reached for g in towns.goals(towns.TO_OPPOSITE, good)] == [True, False]
    assert [g.reached for g in towns.goals(towns.NONE, good)] == [True]


def test_the_table_counts_refused_cities_as_not_within() -> None:
    group = [outcome(group=towns.ROUGH, error_px=0.5, verdict=CORRECT), refused(towns.ROUGH)]
    (row,) = towns.ground_table({towns.ROUGH: group}).rows
    assert row == [towns.ROUGH, "1", "0.50", "50%", "0", "2"]


def test_a_rough_model_lies_off_and_is_noisy(tmp_path: Path) -> None:
    fine = write_raster(
        tmp_path / "dsm.tif", np.full((80, 120), 50, np.float32), utm_grid(120, 80, 1.0)
    )
    path = towns.rough(fine)
    with rasterio.open(fine) as right, rasterio.open(path) as raster:
        assert raster.res == (2.0, 2.0) and raster.shape == (40, 60)
        moved = np.subtract(raster.bounds, right.bounds)
        np.testing.assert_allclose(moved, [3.0, -2.0, 3.0, -2.0])
        heights = raster.read(1)
    assert abs(heights.mean() - 50) < 0.1 and abs(heights.std() - 0.5) < 0.05
    assert towns.rough(fine) == path


def test_a_rough_reference_lies_right_and_lacks_a_tenth_of_its_objects(tmp_path: Path) -> None:
    heights = np.zeros((800, 800), np.float32)
    for row in range(20, 800, 40):
        for col in range(20, 800, 40):
            heights[row : row + 12, col : col + 12] = 15
    fine = write_raster(tmp_path / "dsm.tif", heights, utm_grid(800, 800, 1.0))
    with rasterio.open(fine) as right, rasterio.open(towns.rough(fine, True)) as raster:
        assert raster.bounds == right.bounds
        left = np.sum(raster.read(1)[13::20, 13::20] > 10)
    # 400 objects: three standard deviations of a draw with one tenth.
    assert abs(left - 360) < 18


def test_the_truth_is_taken_to_the_models_pixels(tmp_path: Path) -> None:
    image = write_raster(tmp_path / "a.tif", np.zeros((100, 100), np.uint8), utm_grid(100, 100, 1))
    model = write_raster(tmp_path / "b.tif", np.zeros((60, 60), np.uint8), utm_grid(60, 60, 2.0))
    truth = Truth(np.array([[10.0, 20.0], [70.0, 31.0]]), np.ones((2, 2)), np.eye(2) * 0.5)
    found = towns.to_model(Pair(image, image, truth, truth), model)
    assert found.truth is not None and found.reference == model
    # Centres are whole numbers, and both grids begin at the same corner.
    np.testing.assert_allclose(found.truth.reference_px, [[4.75, 9.75], [34.75, 15.25]])
    # An error of one input pixel is one of 2 reference pixels of 1 m: one of the model's.
    assert found.truth.error_px(lambda px: np.array([[2.0, 1.0], [2.0, 1.0]])) == pytest.approx(1)


def test_views_are_rotated_and_keep_their_angles(tmp_path: Path) -> None:
    simulate(tmp_path, 64, density="urban", warp=1.0)
    reference, input = tmp_path / "reference.tif", tmp_path / "input.tif"
    given = towns.rotated_views(reference, input, 90.0, 180.0)
    words = split_views(given["views"])
    for word, file, turn in zip(words, (reference, input), (90.0, 180.0), strict=True):
        right, wrong = View.of(file, None), View.of(file, word)
        assert right is not None and wrong is not None
        assert wrong.sensor == right.sensor
        assert (wrong.azimuth_deg - right.azimuth_deg) % 360 == pytest.approx(turn, abs=0.2)
        assert wrong.incidence_deg == pytest.approx(right.incidence_deg, abs=0.1)
