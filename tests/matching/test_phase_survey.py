from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from raster_files import utm_grid, write_raster
from textured_pairs import shift_on_map, texture

from groundtie.context import Context
from groundtie.geometry.transform import Transform
from groundtie.matching.phase_survey import survey_phases
from groundtie.matching.surveys import Surveys
from groundtie.rasters.pair import Image, make_pair
from groundtie.rasters.reading import open_raster
from groundtie.registration.rules.survey import PHASE_DEVIATIONS, peak_of_unexplained

SIDE, MARGIN = 400, 30


def place(seed: int, right: int = 0, down: int = 0) -> np.ndarray:
    """Return a place whose ground is moved by whole pixels."""
    canvas = texture(SIDE + 2 * MARGIN, SIDE + 2 * MARGIN, seed)
    top, left = MARGIN - down, MARGIN - right
    return canvas[top : top + SIDE, left : left + SIDE]


def peak_of(
    folder: Path, reference: np.ndarray, input: np.ndarray, context: Context
) -> tuple[float, float]:
    """Return the highest peak of two arrays that are laid on one another, and how far off."""
    rng, paths = np.random.default_rng(1), []
    for name, values in (("reference", reference), ("input", input)):
        noisy = 2000 + 200 * (values + 0.1 * rng.normal(size=values.shape))
        grid = utm_grid(*values.shape[::-1])
        paths.append(write_raster(folder / f"{name}.tif", noisy.astype(np.uint16), grid))
    with open_raster(paths[0]) as one, open_raster(paths[1]) as other:
        pair = make_pair(Image(one), Image(other), search_radius_m=500.0)
        transform = Transform(shift_on_map(0, 0), pair.grid.crs, other.grid)
        phases = survey_phases(pair, transform, context)
        return peak_of_unexplained(Surveys(phases=phases))


@pytest.mark.parametrize("shift", [(14, -9), (-3, 20), (-22, 0)])
def test_ground_shows_that_a_layer_over_both_images_hides(
    shift: tuple[int, int], tmp_path: Path, context: Context
) -> None:
    layer = texture(SIDE, SIDE, 8)
    reference, input = (0.7 * layer + 0.3 * place(4, *moved) for moved in ((0, 0), shift))
    height, length = peak_of(tmp_path, reference, input, context)
    assert height > PHASE_DEVIATIONS
    assert length == pytest.approx(np.hypot(*shift), abs=0.01)


@pytest.mark.parametrize("changed", [0.0, 0.5, 0.8])
def test_what_changed_is_at_no_place_elsewhere(
    changed: float, tmp_path: Path, context: Context
) -> None:
    ground = place(4)
    input = (1 - changed) * ground + changed * texture(SIDE, SIDE, 9)
    assert peak_of(tmp_path, ground, input, context)[0] < PHASE_DEVIATIONS
