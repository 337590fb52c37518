from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from raster_files import utm_grid, write_raster
from textured_pairs import shift_on_map, texture

from groundtie.context import Context
from groundtie.geometry.transform import Transform
from groundtie.matching.chip_windows import Resampled
from groundtie.matching.parts import ELSEWHERE_PX
from groundtie.matching.phase_survey import PHASES_REACH_PX, survey_unexplained
from groundtie.matching.survey import SURVEY_RADIUS_PX, Survey
from groundtie.rasters.pair import Image, make_pair
from groundtie.rasters.reading import open_raster
from groundtie.registration.rules.survey import REST_PEAK_DEVIATIONS, deviations_elsewhere

SIDE, MARGIN = 400, 30


def place(seed: int, right: int = 0, down: int = 0) -> np.ndarray:
    """Return a place with its ground displaced by whole pixels."""
    canvas = texture(SIDE + 2 * MARGIN, SIDE + 2 * MARGIN, seed)
    top, left = MARGIN - down, MARGIN - right
    return canvas[top : top + SIDE, left : left + SIDE]


def survey_of(
    folder: Path, reference: np.ndarray, input: np.ndarray, context: Context, noise: float = 0.1
) -> Survey:
    """Return the survey of two superimposed arrays with independent noise."""
    rng, paths = np.random.default_rng(1), []
    for name, values in (("reference", reference), ("input", input)):
        noisy = 2000 + 200 * (values + noise * rng.normal(size=values.shape))
        grid = utm_grid(*values.shape[::-1])
        paths.append(write_raster(folder / f"{name}.tif", noisy.astype(np.uint16), grid))
    with open_raster(paths[0]) as one, open_raster(paths[1]) as other:
        pair = make_pair(Image(one), Image(other), search_radius_m=500.0)
        transform = Transform(shift_on_map(0, 0), pair.grid.crs, other.grid)
        images = Resampled.of(pair, transform, pair.grid, PHASES_REACH_PX, context)
        return survey_unexplained(images, ELSEWHERE_PX, context)


@pytest.mark.parametrize("shift", [(14, -9), (-3, 20), (-22, 0), (7, 7)])
def test_ground_shows_that_a_layer_over_both_images_hides(
    shift: tuple[int, int], tmp_path: Path, context: Context
) -> None:
    layer = texture(SIDE, SIDE, 8)
    reference, input = (0.7 * layer + 0.3 * place(4, *moved) for moved in ((0, 0), shift))
    found = survey_of(tmp_path, reference, input, context)
    assert deviations_elsewhere(found) > REST_PEAK_DEVIATIONS
    row, col = np.unravel_index(np.argmax(found.mean), found.mean.shape)
    assert (col - SURVEY_RADIUS_PX, row - SURVEY_RADIUS_PX) == shift


@pytest.mark.parametrize("changed", [0.0, 0.5, 0.8])
def test_what_changed_is_at_no_place_elsewhere(
    changed: float, tmp_path: Path, context: Context
) -> None:
    ground = place(4)
    input = (1 - changed) * ground + changed * texture(SIDE, SIDE, 9)
    found = survey_of(tmp_path, ground, input, context)
    assert deviations_elsewhere(found) < REST_PEAK_DEVIATIONS


def test_of_a_copy_nothing_is_left_though_it_repeats(tmp_path: Path, context: Context) -> None:
    """Mirrored tiles of 20 px: the rest is rounding, not ground."""
    tile = texture(20, 20, 4)
    both = np.concatenate([tile, tile[:, ::-1]], axis=1)
    scene = np.tile(both, (SIDE // 20, SIDE // 40))
    found = survey_of(tmp_path, scene, scene, context, noise=0.0)
    assert found.comparable == 0


def test_an_orchard_that_repeats_is_at_no_place_elsewhere(tmp_path: Path, context: Context) -> None:
    """Trees every 14 px in both images, which have independent noise."""
    rows, cols = np.indices((SIDE, SIDE))
    trees = 2 * (np.cos(2 * np.pi * rows / 14) + np.cos(2 * np.pi * cols / 14))
    found = survey_of(tmp_path, *2 * [place(4) + trees], context, noise=0.5)
    assert deviations_elsewhere(found) < REST_PEAK_DEVIATIONS
