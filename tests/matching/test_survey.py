from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from raster_files import utm_grid, write_raster
from textured_pairs import shift_on_map, texture

from groundtie.context import Context
from groundtie.matching.chips import ChipMatcher
from groundtie.matching.parts import ELSEWHERE_PX
from groundtie.matching.survey import SURVEY_RADIUS_PX, Survey, survey_model, survey_places
from groundtie.rasters.pair import Image, make_pair
from groundtie.rasters.reading import open_raster
from groundtie.registration.rules.survey import (
    PEAK_DEVIATIONS,
    REST_PEAK_DEVIATIONS,
    deviations_elsewhere,
)
from groundtie.similarity.surface import SimilaritySettings

SIDE = 340
MARGIN = 30


def surveyed(
    folder: Path,
    reference: np.ndarray,
    input: np.ndarray,
    context: Context,
    **masks: np.ndarray,
) -> Survey:
    """Survey two arrays of one place around the identity."""
    paths = [
        write_raster(folder / f"{name}.tif", (1000 + 200 * values).astype(np.uint16))
        for name, values in (("reference", reference), ("input", input))
    ]
    hidden = masks.get("hidden")
    with open_raster(paths[0]) as one, open_raster(paths[1]) as other:
        pair = make_pair(Image(one), Image(other), search_radius_m=50.0)
        matcher = ChipMatcher(pair, SimilaritySettings("orientation"))
        without = (
            None if hidden is None else lambda piece: np.ones((piece.height, piece.width), bool)
        )
        images = matcher.resampled(shift_on_map(0.0, 0.0), pair.grid, SURVEY_RADIUS_PX, context)
        return survey_model(
            matcher, images, survey_places(pair.grid), ELSEWHERE_PX, context, without
        )


def place(shift: tuple[int, int] = (0, 0), seed: int = 0) -> np.ndarray:
    """Return a place displaced by a shift (x, y)."""
    canvas = texture(SIDE + 2 * MARGIN, SIDE + 2 * MARGIN, seed)
    top, left = MARGIN - shift[1], MARGIN - shift[0]
    return canvas[top : top + SIDE, left : left + SIDE]


def noisy(values: np.ndarray, seed: int, sigma: float = 0.3) -> np.ndarray:
    return values + sigma * np.random.default_rng(seed).normal(size=values.shape)


def test_chips_lie_side_by_side_and_farther_apart_in_large_grids() -> None:
    small = survey_places(utm_grid(340, 480))
    assert small.chip_px == 340 // 7
    assert len(small.centres) == 7 * 9
    large = survey_places(utm_grid(5000, 3000))
    assert large.chip_px == 64
    assert len(large.centres) == 9 * 9
    for grid, places in ((utm_grid(340, 480), small), (utm_grid(5000, 3000), large)):
        half = places.chip_px / 2
        assert places.centres.min() >= half - 1
        assert (places.centres.max(axis=0) <= np.array([grid.width, grid.height]) - half + 1).all()


@pytest.mark.slow
def test_chips_of_a_right_model_confirm_it(tmp_path: Path, context: Context) -> None:
    survey = surveyed(tmp_path, noisy(place(), 1), noisy(place(), 2), context)
    assert survey.confirming == len(survey.centres) == 49
    assert survey.height > 2 * survey.rival_height
    assert survey.parts == []


@pytest.mark.slow
def test_chips_of_another_place_confirm_nothing(tmp_path: Path, context: Context) -> None:
    survey = surveyed(tmp_path, noisy(place(), 1), noisy(place(seed=9), 2), context)
    assert survey.confirming < 5
    assert survey.height < 3.0
    assert survey.parts == []


@pytest.mark.slow
@pytest.mark.parametrize(("shift", "where"), [((9, -6), "left side"), ((-14, 11), "upper right")])
def test_a_part_that_lies_elsewhere_is_found_with_its_place(
    tmp_path: Path, context: Context, shift: tuple[int, int], where: str
) -> None:
    input, moved = noisy(place(), 2), noisy(place(shift), 2)
    part = np.s_[:, : SIDE // 3] if where == "left side" else np.s_[: SIDE // 2, SIDE // 2 :]
    input[part] = moved[part]
    survey = surveyed(tmp_path, noisy(place(), 1), input, context)
    found = survey.parts[0]
    np.testing.assert_allclose(found.shift_px, shift, atol=0.7)
    np.testing.assert_allclose(found.distance_px, np.hypot(*shift), atol=0.7)
    assert found.where == where
    assert survey.parts[1:] == []


@pytest.mark.slow
def test_a_part_beyond_the_radius_is_no_part(tmp_path: Path, context: Context) -> None:
    input = noisy(place(), 2)
    input[:, : SIDE // 3] = noisy(place((SURVEY_RADIUS_PX + 5, 0)), 2)[:, : SIDE // 3]
    survey = surveyed(tmp_path, noisy(place(), 1), input, context)
    assert survey.parts == []


@pytest.mark.slow
def test_scattered_disagreement_is_no_part(tmp_path: Path, context: Context) -> None:
    """Every other chip shows a place of its own."""
    input = noisy(place(), 2)
    for number, (row, col) in enumerate(np.argwhere(np.indices((7, 7)).sum(axis=0) % 2)):
        where = np.s_[row * 48 : row * 48 + 48, col * 48 : col * 48 + 48]
        input[where] = place(seed=50 + number)[where]
    survey = surveyed(tmp_path, noisy(place(), 1), input, context)
    assert 20 <= survey.confirming <= 27
    assert survey.parts == []


def test_what_repeats_matches_elsewhere_about_as_well(tmp_path: Path, context: Context) -> None:
    tile = texture(14, 14, 3)
    rows = np.tile(tile, (SIDE // 14 + 1, SIDE // 14 + 1))[:SIDE, :SIDE]
    survey = surveyed(tmp_path, noisy(rows, 1, 0.1), noisy(rows, 2, 0.1), context)
    assert survey.rival_height > 0.9 * survey.height


@pytest.mark.parametrize("by_px", [(9, -5), (0, 0)])
def test_ground_beneath_what_is_drawn_is_a_second_peak(
    by_px: tuple[int, int], tmp_path: Path, context: Context
) -> None:
    """The drawn content matches at the model's place, in strong contrast; the ground elsewhere."""
    drawn = 1.2 * place(seed=5)
    views = drawn + place(), drawn + place(by_px)
    survey = surveyed(tmp_path, noisy(views[0], 1), noisy(views[1], 2), context)
    assert survey.confirming > 0.9 * len(survey.centres)
    assert survey.rival_height < 0.8 * survey.height
    if by_px == (0, 0):
        assert deviations_elsewhere(survey) < REST_PEAK_DEVIATIONS
    else:
        assert deviations_elsewhere(survey) > PEAK_DEVIATIONS


def test_what_is_similar_because_it_lies_near_is_no_second_peak() -> None:
    """A wide peak is high at a rival's place, too, but no higher than its surroundings."""
    span = np.arange(-SURVEY_RADIUS_PX, SURVEY_RADIUS_PX + 1)
    distance = np.hypot(*np.meshgrid(span, span))
    wide = np.repeat(10 * np.exp(-(distance[None] ** 2) / 200), 9, axis=0).astype(np.float32)
    grid, centres = utm_grid(SIDE, SIDE), np.full((9, 2), 50)
    survey = Survey(grid, centres, np.zeros((9, 2)), wide)
    assert survey.rival_height > 0.8 * survey.height
    assert survey.second_peak == 0


@pytest.mark.parametrize(("height", "counted"), [(5.0, 5.0), (7.0, 7.0), (35.0, 7.0)])
def test_one_chip_counts_for_so_much_at_most_of_a_second_peak(
    height: float, counted: float
) -> None:
    """A few canopies are higher than a whole scene whose ground is displaced."""
    surfaces = np.zeros((9, 2 * SURVEY_RADIUS_PX + 1, 2 * SURVEY_RADIUS_PX + 1), np.float32)
    surfaces[:, SURVEY_RADIUS_PX, SURVEY_RADIUS_PX] = 50.0
    surfaces[:2, SURVEY_RADIUS_PX - 6, SURVEY_RADIUS_PX + 8] = height
    grid, centres = utm_grid(SIDE, SIDE), np.full((9, 2), 50)
    survey = Survey(grid, centres, np.zeros((9, 2)), surfaces)
    assert survey.second_peak == pytest.approx(2 * counted / 9)


def test_what_is_left_out_is_not_matched(tmp_path: Path, context: Context) -> None:
    survey = surveyed(tmp_path, place(), place(), context, hidden=np.ones((1, 1)))
    assert len(survey.centres) == 0
    assert survey.confirming == 0 and survey.parts == []
    assert survey.height == survey.rival_height == 0.0


def test_chips_without_overlap_where_the_model_has_them_are_not_compared() -> None:
    surfaces = np.ones((3, 2 * SURVEY_RADIUS_PX + 1, 2 * SURVEY_RADIUS_PX + 1), np.float32)
    surfaces[0, :, SURVEY_RADIUS_PX - 5 :] = 0
    grid = utm_grid(SIDE, SIDE)
    centres = np.array([[50, 50], [150, 50], [250, 50]])
    assert Survey(grid, centres, np.zeros((3, 2)), surfaces).comparable == 2
