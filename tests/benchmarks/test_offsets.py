"""Pairs on one grid whose input is off by exactly what was asked for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import rasterio
from benchmark_cases import CHECK_POINT_ERROR_PX, MATRIX, pixels, to_input
from benchmark_scenes import SIZE, texture, textured_scene

from benchmarks.accuracy import Truth
from benchmarks.cases import RealCase
from benchmarks.offsets import Scene, affine_of, open_offset, valid_box, write_offset
from benchmarks.simulations import Simulation

OFFSET = np.array([12.5, -10.25])


def read(path: Path) -> np.ndarray:
    with rasterio.open(path) as source:
        return source.read(1)


def test_both_images_are_written_on_one_grid(tmp_path: Path) -> None:
    pair = write_offset(textured_scene(tmp_path).pair(tmp_path), OFFSET, tmp_path)
    with rasterio.open(pair.reference) as reference, rasterio.open(pair.input) as image:
        assert reference.transform == image.transform
        assert reference.shape == image.shape
        assert reference.count == image.count == 1


@pytest.mark.slow
def test_the_input_shows_everything_so_far_off(tmp_path: Path) -> None:
    pair = write_offset(textured_scene(tmp_path).pair(tmp_path), OFFSET, tmp_path)
    reference, image = read(pair.reference), read(pair.input)
    px = pixels(reference.shape[::-1])
    # Where the cut begins, from the reference, whose values are exact.
    with rasterio.open(pair.reference) as cut:
        corner = np.array([cut.transform.c - 500_000, 5_000_000 - cut.transform.f])
    np.testing.assert_allclose(reference.ravel(), texture(px + corner), atol=1e-3)
    inner = np.all((px > 4) & (px < np.array(reference.shape[::-1]) - 5), axis=1)
    expected = texture(px + corner - OFFSET)[inner]
    # Cubic interpolation of waves from 6 px on, the amplitude of all of them being about 9.
    assert np.std(image.ravel()[inner] - expected) < 0.05 * np.std(expected)


def test_the_truth_is_the_offset(tmp_path: Path) -> None:
    pair = write_offset(textured_scene(tmp_path).pair(tmp_path), OFFSET, tmp_path)
    assert pair.truth is not None and pair.sigma_px == 0.5
    assert pair.truth.error_px(lambda px: px + OFFSET) == pytest.approx(0, abs=1e-9)
    assert pair.truth.error_px(lambda px: px) == pytest.approx(np.hypot(*OFFSET))


def test_nothing_invalid_is_left_along_the_border(tmp_path: Path) -> None:
    pair = write_offset(textured_scene(tmp_path).pair(tmp_path), OFFSET, tmp_path)
    # The texture is far from 0, which stands for invalid pixels.
    assert read(pair.input).min() > 50
    assert min(read(pair.input).shape) > min(SIZE) - 2 * np.abs(OFFSET).max() - 60


def test_check_points_stay_the_truth(cases: dict[str, RealCase], tmp_path: Path) -> None:
    offset = np.array([1.0, -1.0])
    pair = write_offset(Scene(cases["hills"], tmp_path).pair(tmp_path), offset, tmp_path)
    assert pair.truth is not None and len(pair.truth.reference_px) == 4
    error = pair.truth.error_px(lambda px: px + offset)
    assert error == pytest.approx(CHECK_POINT_ERROR_PX)


def test_too_few_check_points_in_the_cut_leave_the_lattice(
    cases: dict[str, RealCase], tmp_path: Path
) -> None:
    offset = np.array([-30.0, 0.0])
    pair = write_offset(Scene(cases["hills"], tmp_path).pair(tmp_path), offset, tmp_path)
    assert pair.truth is pair.lattice


def test_the_way_to_the_input_and_back(tmp_path: Path) -> None:
    scene = textured_scene(tmp_path)
    with open_offset(scene.pair(tmp_path), OFFSET) as pair:
        px = np.array([[50.0, 60.0], [120.0, 90.0]])
        found = pair.to_input_px(pair.images.grid.pixel_to_map(px + OFFSET))
        np.testing.assert_allclose(found, to_input(px), atol=1e-6)
        np.testing.assert_allclose(pair.offset_of(to_input(px)), px + OFFSET)


def test_the_nearest_affine_matrix_of_an_affine_truth_is_its_own() -> None:
    truth = Truth.on_lattice(to_input, SIZE, MATRIX[:, :2])
    np.testing.assert_allclose(affine_of(truth), MATRIX, atol=1e-9)


def test_offsets_are_within_their_limits_and_drawn_once_a_pair(tmp_path: Path) -> None:
    scenes = [Scene(Simulation(1000, "rural", seed), tmp_path) for seed in range(40)]
    drawn = np.array([scene.offset_px((10.0, 20.0)) for scene in scenes])
    assert np.all((np.abs(drawn) >= 10) & (np.abs(drawn) <= 20))
    assert {tuple(signs) for signs in np.sign(drawn)} == {(a, b) for a in (-1, 1) for b in (-1, 1)}
    np.testing.assert_array_equal(drawn[0], scenes[0].offset_px((10.0, 20.0)))
    assert scenes[0].group == "rural"


def test_a_box_without_invalid_pixels_is_all() -> None:
    assert valid_box(np.ones((5, 7), bool)) == (0, 0, 7, 5)


def test_invalid_sides_are_cut_off_and_holes_inside_stay() -> None:
    valid = np.ones((40, 60), bool)
    valid[:3], valid[:, -5:], valid[20, 20] = False, False, False
    assert valid_box(valid) == (0, 3, 55, 37)


def test_a_turned_image_leaves_a_box_without_its_corners() -> None:
    col, row = np.meshgrid(np.arange(100), np.arange(100))
    valid = np.abs(col - 50) + np.abs(row - 50) < 48
    left, top, width, height = valid_box(valid)
    box = valid[top : top + height, left : left + width]
    assert box[0].all() and box[-1].all() and box[:, 0].all() and box[:, -1].all()
    # The largest square in the diamond has a side of 48; one is found that is nearly as large.
    assert min(width, height) > 40


def test_without_valid_pixels_there_is_no_box() -> None:
    _, _, width, height = valid_box(np.zeros((4, 4), bool))
    assert width * height == 0
