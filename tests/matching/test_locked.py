from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from affine import Affine
from raster_files import utm_grid, write_raster
from textured_pairs import shift_on_map, texture

from groundtie.context import Context
from groundtie.geometry.models import Frame, Model, PolynomialModel
from groundtie.geometry.transform import Transform
from groundtie.matching.chips import ChipMatcher
from groundtie.matching.locked import LockedContent, Sameness, find_offset
from groundtie.matching.rest import Rest, survey_rest
from groundtie.matching.survey import Survey, survey_model, survey_places
from groundtie.rasters.pair import Image, make_pair
from groundtie.rasters.reading import open_raster
from groundtie.similarity.surface import SimilaritySettings

SIDE = 280


def looked_at(
    folder: Path,
    reference: np.ndarray,
    input: np.ndarray,
    context: Context,
    model: Model | None = None,
) -> tuple[LockedContent, Sameness, Survey, Rest | None]:
    """Look for content that two arrays of one grid have in common under a model."""
    grid = utm_grid(SIDE, SIDE)
    paths = [
        write_raster(folder / f"{name}.tif", np.rint(2000 + 300 * values).astype(np.uint16), grid)
        for name, values in (("reference", reference), ("input", input))
    ]
    with open_raster(paths[0]) as one, open_raster(paths[1]) as other:
        pair = make_pair(Image(one), Image(other), search_radius_m=500.0)
        transform = Transform(model or shift_on_map(0.0, 0.0), pair.grid.crs, other.grid)
        offset = find_offset(pair, transform)
        assert offset is not None
        places = survey_places(pair.grid)
        locked = LockedContent(pair, offset.px)
        matcher = ChipMatcher(pair, SimilaritySettings("orientation"))
        survey = survey_model(matcher, transform.model, context)
        rest = survey_rest(matcher, transform, survey, places, context)
        return locked, locked.sameness(places, context), survey, rest


def drawn_into(values: np.ndarray, offset: tuple[int, int] = (0, 0)) -> np.ndarray:
    """Return an array with lines drawn at columns and rows, moved by an offset."""
    made = values.copy()
    for at in (40, 110, 190, 250):
        made[at + offset[1] : at + offset[1] + 4] = 8.0
        made[:, at + offset[0] : at + offset[0] + 4] = 8.0
    return made


def spots(place: int = 4, length_px: float = 1.0) -> np.ndarray:
    """Return where spots are drawn, all over an array."""
    noise = cv2.GaussianBlur(
        np.random.default_rng(place).normal(size=(SIDE, SIDE)), (0, 0), length_px
    )
    return np.asarray(noise > 1.2 * noise.std())


def sensed(seed: int, noise: float = 0.4, place: int = 1) -> np.ndarray:
    """Return one view of a place, with noise of its own."""
    ground = texture(SIDE, SIDE, place)
    return ground + noise * np.random.default_rng(seed).normal(size=ground.shape)


@pytest.mark.parametrize("offset", [(0, 0), (7, -3)])
def test_lines_that_are_drawn_over_different_ground_are_found(
    tmp_path: Path, context: Context, offset: tuple[int, int]
) -> None:
    """All chips match at whole pixels; without the lines, none does."""
    reference, input = drawn_into(sensed(1)), drawn_into(sensed(2, place=9), offset)
    # The grid has rows from north to south and pixels of 10 m.
    model = shift_on_map(10.0 * offset[0], -10.0 * offset[1])
    locked, sameness, survey, rest = looked_at(tmp_path, reference, input, context, model)
    assert locked.offset_px == offset
    assert survey.is_confirming and not sameness.is_explained
    assert rest is not None and not rest.is_confirming
    assert rest.survey.confirming <= 0.1 * survey.confirming


def test_its_mask_covers_the_lines_and_little_else(tmp_path: Path, context: Context) -> None:
    reference, input = drawn_into(sensed(1)), drawn_into(sensed(2, place=9))
    locked, *_ = looked_at(tmp_path, reference, input, context)
    with open_raster(tmp_path / "reference.tif") as one, open_raster(tmp_path / "input.tif") as two:
        pair = make_pair(Image(one), Image(two), search_radius_m=500.0)
        grid = one.grid.window(20, 0, 200, 200)
        mask = LockedContent(pair, locked.offset_px)(grid)
    drawn = drawn_into(np.zeros((SIDE, SIDE)))[:200, 20:220] > 0
    assert mask[drawn].all()
    assert mask[60:90, 40:70].mean() < 0.3


def test_spots_in_other_colours_are_no_ground(tmp_path: Path, context: Context) -> None:
    """Masks miss them, as values differ; but they still match at whole pixels."""
    reference, input = sensed(1) + 6.0 * spots(), sensed(2, place=9) - 6.0 * spots()
    *_, rest = looked_at(tmp_path, reference, input, context)
    assert rest is not None and rest.survey.is_confirming
    assert rest.whole_share > 0.9
    assert not rest.is_confirming


@pytest.mark.parametrize("place", [1, 9])
def test_views_without_anything_drawn_have_none(
    tmp_path: Path, context: Context, place: int
) -> None:
    """Ground that lies between pixels of the arrays, in other colours, or other ground."""
    rng = np.random.default_rng(2)
    moved = cv2.warpAffine(
        texture(SIDE, SIDE, place), np.array([[1, 0, 0.4], [0, 1, -0.3]]), (SIDE, SIDE)
    )
    input = -moved + 0.4 * rng.normal(size=moved.shape)
    *_, rest = looked_at(tmp_path, sensed(1), input, context, shift_on_map(4.0, 3.0))
    assert rest is None


def test_one_sensors_views_of_one_ground_are_explained(tmp_path: Path, context: Context) -> None:
    """Most windows vary alike; so do reduced images where single pixels do not."""
    _, sameness, survey, rest = looked_at(tmp_path, sensed(1, 0.15), sensed(2, 0.15), context)
    assert survey.is_confirming and sameness.is_explained
    assert rest is not None and rest.is_explained and rest.is_confirming


def test_a_copy_is_explained(tmp_path: Path, context: Context) -> None:
    _, sameness, _, rest = looked_at(tmp_path, sensed(1), sensed(1), context)
    assert sameness.area > 0.99 and sameness.is_explained
    assert rest is not None and rest.is_confirming


def test_one_pattern_of_noise_over_different_ground_is_found(
    tmp_path: Path, context: Context
) -> None:
    pattern = 2 * np.random.default_rng(5).normal(size=(SIDE, SIDE))
    reference, input = sensed(1, 0.1) + pattern, sensed(2, 0.1, place=9) + pattern
    _, sameness, survey, rest = looked_at(tmp_path, reference, input, context)
    assert survey.is_confirming and not sameness.is_explained
    assert rest is not None and not rest.is_confirming


@pytest.mark.parametrize(
    ("area", "reduced", "ground", "expected"),
    [
        (1.0, 1.0, 0.0, True),
        (0.95, 1.0, 0.1, True),
        (0.95, 0.94, 0.1, False),
        (0.8, 1.0, 0.1, False),
        (0.1, 0.5, 0.4, True),
    ],
)
def test_reduced_images_of_one_ground_are_more_alike(
    area: float, reduced: float, ground: float, expected: bool
) -> None:
    """Under a strong pattern of noise that both have, they are less alike."""
    assert Sameness(area, reduced, ground).is_explained is expected


def test_fill_that_is_not_declared_leaves_no_border(tmp_path: Path, context: Context) -> None:
    """Holes of one value in both, of images with another contrast: their borders match, too."""
    holes = spots(length_px=8.0)
    reference, input = sensed(1), 0.4 * sensed(2, place=9)
    reference[holes] = input[holes] = -6.0
    _, _, survey, rest = looked_at(tmp_path, reference, input, context)
    assert survey.is_confirming
    assert rest is not None and rest.survey.confirming <= 0.1 * survey.confirming


@pytest.mark.parametrize("side_m", [10.0, 12.0])
def test_arrays_that_are_resampled_have_no_offset(tmp_path: Path, side_m: float) -> None:
    paths = [
        write_raster(tmp_path / name, (2000 + 300 * sensed(1)).astype(np.uint16), grid)
        for name, grid in (
            ("reference.tif", utm_grid(SIDE, SIDE)),
            ("input.tif", utm_grid(SIDE, SIDE).scaled(side_m / 10.0)),
        )
    ]
    with open_raster(paths[0]) as one, open_raster(paths[1]) as other:
        pair = make_pair(Image(one), Image(other), search_radius_m=500.0)
        turned = PolynomialModel(
            "affine",
            Frame(Affine.identity()),
            np.array([[50.0, -30.0], [1e-3, 2e-2], [-2e-2, 1e-3]]),
        )
        model = turned if side_m == 10.0 else shift_on_map(0.0, 0.0)
        transform = Transform(model, pair.grid.crs, other.grid)
        assert find_offset(pair, transform) is None
