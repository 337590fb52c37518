from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from raster_files import utm_grid, write_raster
from scipy import ndimage
from textured_pairs import of_a_sensor, shift_on_map, texture

from groundtie.context import Context
from groundtie.geometry.transform import Transform
from groundtie.matching.chips import ChipMatcher
from groundtie.matching.locked import EXACT_PX
from groundtie.matching.parts import ELSEWHERE_PX, Part
from groundtie.matching.shared_content import ImageKinds, Sensors
from groundtie.matching.survey import SURVEY_RADIUS_PX, survey_places
from groundtie.matching.surveys import LEAST_BY_ONE_WAY, LEAST_OF_REST, Rest, Surveys, survey_all
from groundtie.rasters.grid import Grid
from groundtie.rasters.pair import Image, make_pair
from groundtie.rasters.reading import open_raster
from groundtie.registration.rules.survey import (
    PEAK_DEVIATIONS,
    REST_PEAK_DEVIATIONS,
    deviations_elsewhere,
    deviations_of_unexplained,
    height_of_else,
)
from groundtie.similarity.surface import SimilaritySettings

SIDE, MARGIN = 340, 30


def place(shift: tuple[int, int] = (0, 0)) -> np.ndarray:
    """Return a place displaced by a shift (x, y)."""
    canvas = texture(SIDE + 2 * MARGIN, SIDE + 2 * MARGIN, 4)
    top, left = MARGIN - shift[1], MARGIN - shift[0]
    return canvas[top : top + SIDE, left : left + SIDE]


def noisy(values: np.ndarray, seed: int, deviation: float | np.ndarray = 0.2) -> np.ndarray:
    return values + deviation * np.random.default_rng(seed).normal(size=values.shape)


def zoomed(values: np.ndarray, factor: int) -> np.ndarray:
    """Return an image in pixels that are smaller by a factor."""
    return np.kron(values, np.ones((factor, factor)))


def zoomed_out(values: np.ndarray, factor: int) -> np.ndarray:
    """Return an image in pixels that are larger by a factor: block means."""
    rows, cols = (side // factor for side in values.shape)
    return values.reshape(rows, factor, cols, factor).mean(axis=(1, 3))


def rest_of(*pair: Any, **more: Any) -> Rest | None:
    """Return the rest of two arrays; parameters as in `surveys_of`."""
    return surveys_of(*pair, **more).rest


def surveys_of(
    folder: Path,
    reference: np.ndarray,
    input: np.ndarray,
    context: Context,
    offset: tuple[float, float] = (0.0, 0.0),
    sensors: Sensors = Sensors.CAMERAS,
    is_of_a_sensor: bool = False,
    kinds: ImageKinds | None = None,
) -> Surveys:
    """Return the surveys of two arrays whose rows and columns are displaced by an offset.

    The input may be in the geometry of its sensor.
    """
    paths = [
        write_raster(
            folder / f"{name}.tif", (2000 + 200 * values).astype(np.uint16), utm_grid(SIDE, SIDE)
        )
        for name, values in (("reference", reference), ("input", input))
    ]
    with open_raster(paths[0]) as one, open_raster(paths[1]) as other:
        pair = make_pair(Image(one), Image(other), search_radius_m=500.0)
        # The grid has rows from north to south and pixels of 10 m.
        found = shift_on_map(10.0 * offset[0], -10.0 * offset[1])
        transform = Transform(found, pair.grid.crs, other.grid)
        if is_of_a_sensor:
            pair = replace(pair, input=of_a_sensor(pair.input))
        matcher = ChipMatcher(pair, SimilaritySettings())
        places = survey_places(pair.grid)
        accuracy_px = ELSEWHERE_PX, EXACT_PX
        return survey_all(
            matcher, transform, places, accuracy_px, kinds or ImageKinds(sensors), False, context
        )


@pytest.mark.parametrize("off", [(40, -25), (-22, 0), (0, -70)])
@pytest.mark.slow
def test_a_part_beyond_the_radius_is_found(
    off: tuple[int, int], tmp_path: Path, context: Context
) -> None:
    """Up to a quarter of the longer side; a strip of another pass, for instance."""
    reference, displaced = far_apart(off)
    input = reference.copy()
    input[2 * SIDE // 3 :] = displaced[2 * SIDE // 3 :]
    found = surveys_of(tmp_path, noisy(reference, 1, 0.5), noisy(input, 2, 0.5), context)
    assert found.whole is not None
    part = found.whole.parts[0]
    assert part.shift_px == pytest.approx(off, abs=1.5)
    assert part.where == "bottom"
    # Chips on the seam line may match either side.
    assert part.chips == pytest.approx(len(found.whole.centres) / 3, rel=0.35)


@pytest.mark.slow
def test_a_forest_may_be_displaced_as_far_in_a_radar_image(
    tmp_path: Path, context: Context
) -> None:
    reference, displaced = far_apart((35, 0))
    input = reference.copy()
    input[: SIDE // 3] = displaced[: SIDE // 3]
    pair = noisy(reference, 1, 0.5), noisy(input, 2, 0.5)

    def far(first_row: int, end_row: int) -> Part | None:
        """Return the part far off if some rows are forest."""

        def is_forest(piece: Grid) -> np.ndarray:
            top = utm_grid(SIDE, SIDE).map_to_pixel(piece.pixel_to_map([[0.0, 0.0]]))[0, 1]
            rows = top + np.arange(piece.height)
            forest = (rows >= first_row) & (rows < end_row)
            return np.broadcast_to(forest[:, None], (piece.height, piece.width))

        kinds = ImageKinds(Sensors.DIFFERENT, open_ground=is_forest)
        found = surveys_of(tmp_path, *pair, context, kinds=kinds)
        assert found.whole is not None
        return found.whole.far

    assert far(0, SIDE // 3) is None
    other = far(SIDE // 3, SIDE)
    assert other is not None
    assert other.shift_px == pytest.approx((35, 0), abs=1.5)


@pytest.mark.slow
def test_a_forest_within_the_radius_is_a_part_as_the_ground_is(
    tmp_path: Path, context: Context
) -> None:
    """What moved by 22 px may be a third of a suburb, none of which is open ground."""
    reference, displaced = far_apart((22, 0))
    input = reference.copy()
    input[: SIDE // 3] = displaced[: SIDE // 3]
    pair = noisy(reference, 1, 0.5), noisy(input, 2, 0.5)
    kinds = ImageKinds(Sensors.DIFFERENT, open_ground=lambda piece: np.ones(piece.size[::-1], bool))
    (part,) = surveys_of(tmp_path, *pair, context, kinds=kinds).parts
    assert part.shift_px == pytest.approx((22, 0), abs=1)


@pytest.mark.parametrize("shows", ["another place", "nothing", "what lies there"])
@pytest.mark.slow
def test_what_does_not_match_is_no_part_far_off(
    shows: str, tmp_path: Path, context: Context
) -> None:
    reference, _ = far_apart((0, 0))
    input = reference.copy()
    lower = slice(2 * SIDE // 3, None)
    if shows == "another place":
        input[lower] = texture(SIDE, SIDE, 5)[lower]
    elif shows == "nothing":
        input[lower] = 0.0
    found = surveys_of(tmp_path, noisy(reference, 1, 0.5), noisy(input, 2, 0.5), context)
    assert found.parts == []
    assert found.whole is not None
    # The place is not even looked for if most chips confirm the model.
    assert (found.whole.far is None) == (shows == "what lies there")


def far_apart(off: tuple[int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Return a place, and the same displaced by a shift (x, y) of up to 90 px."""
    margin = 90
    canvas = texture(SIDE + 2 * margin, SIDE + 2 * margin, 4)
    both = [canvas[margin - y :, margin - x :][:SIDE, :SIDE] for x, y in ((0, 0), off)]
    return both[0], both[1]


@pytest.mark.parametrize("contrast", [-6.0, 6.0])
@pytest.mark.parametrize("moved", [(0, 0), (7, -5)])
@pytest.mark.slow
def test_shadows_and_roofs_do_not_hide_that_the_ground_lies_elsewhere(
    moved: tuple[int, int], contrast: float, tmp_path: Path, context: Context
) -> None:
    """Dark and bright spots match where they coincide; the rest, where the ground lies."""
    at = np.random.default_rng(0).uniform(size=(SIDE, SIDE)) < 1 / 50
    spots = np.where(ndimage.binary_dilation(at, iterations=2), contrast, 0.0)
    images = (0.3 * noisy(place(to), seed) + spots for to, seed in (((0, 0), 1), (moved, 2)))
    surveys = surveys_of(tmp_path, *images, context)
    without_dark, without_bright = surveys.ground
    without_spots = without_dark if contrast < 0 else without_bright
    assert surveys.whole is not None
    for survey, expected in ((surveys.whole, (0, 0)), (without_spots, moved)):
        top = np.unravel_index(np.argmax(survey.mean), survey.mean.shape)
        assert np.subtract(top, SURVEY_RADIUS_PX)[::-1] == pytest.approx(expected, abs=1)


# The most of a copy, over ground that is hardly moved, and the least, over ground far off.
@pytest.mark.parametrize(("share", "moved"), [(0.6, (4, -3)), (0.35, (11, -7))])
@pytest.mark.parametrize("offset", [(0, 0), (6, -4), (6.4, -3.7)])
@pytest.mark.slow
def test_ground_shows_that_a_copy_was_blended_into(
    share: float,
    moved: tuple[int, int],
    offset: tuple[float, float],
    tmp_path: Path,
    context: Context,
) -> None:
    reference = noisy(place(), 1)
    copied = ndimage.shift(reference, offset[::-1], mode="mirror")
    ground = place((moved[0] + round(offset[0]), moved[1] + round(offset[1])))
    blended = share * copied + (1 - share) * noisy(ground, 2)
    surveys = surveys_of(tmp_path, reference, blended, context, offset)
    assert surveys.rest is not None and surveys.rest.shared.is_explained
    assert surveys.unexplained is not None
    mean = surveys.unexplained.mean
    top = np.unravel_index(np.argmax(mean), mean.shape)
    assert np.subtract(top, SURVEY_RADIUS_PX)[::-1] == pytest.approx(moved, abs=1)
    assert deviations_of_unexplained(surveys, ELSEWHERE_PX) > PEAK_DEVIATIONS


@pytest.mark.parametrize("offset", [(6.0, -4.0), (6.4, -3.7)])
@pytest.mark.slow
def test_over_the_image_of_a_sensor_lies_no_map_layer(
    offset: tuple[float, float], tmp_path: Path, context: Context
) -> None:
    """Only content of the array, which moves by whole pixels, may lie over its ground."""
    copied = ndimage.shift(noisy(place(), 1), offset[::-1], mode="mirror")
    images = noisy(place(), 1), 0.5 * copied + 0.5 * noisy(place((17, -11)), 2)
    surveys = surveys_of(tmp_path, *images, context, offset, is_of_a_sensor=True)
    assert (surveys.unexplained is not None) == (offset == (6.0, -4.0))


@pytest.mark.slow
def test_a_view_of_one_sensor_and_a_copy_show_nothing_elsewhere(
    tmp_path: Path, context: Context
) -> None:
    reference = noisy(place(), 1)
    for input in (noisy(place(), 2), 0.7 * reference):
        surveys = surveys_of(tmp_path, reference, input, context)
        assert surveys.rest is not None and surveys.rest.shared.is_explained
        assert deviations_of_unexplained(surveys, ELSEWHERE_PX) < REST_PEAK_DEVIATIONS


@pytest.mark.slow
def test_what_a_radar_and_a_camera_show_alike_is_no_view_of_one_sensor(
    tmp_path: Path, context: Context
) -> None:
    views = noisy(place(), 1), noisy(place(), 2)
    rest = rest_of(tmp_path, *views, context, sensors=Sensors.DIFFERENT)
    assert rest is not None and not rest.shared.is_explained
    assert rest.survey is not None


@pytest.mark.slow
def test_beneath_one_deck_of_clouds_the_ground_is_asked(tmp_path: Path, context: Context) -> None:
    """Most of both images is the same clouds, with sharp rims, over two places."""
    clouds = texture(SIDE, SIDE, 30) > -1.2
    images = [
        np.where(clouds, 4 + 0.5 * place(), ground)
        for ground in (noisy(place(), 1), noisy(place()[::-1], 2))
    ]
    rest = rest_of(tmp_path, *images, context)
    assert rest is not None and rest.shared.is_explained and rest.survey is not None


@pytest.mark.parametrize("is_another_place", [True, False])
@pytest.mark.slow
def test_beneath_soft_clouds_of_one_shape_the_ground_is_asked(
    is_another_place: bool, tmp_path: Path, context: Context
) -> None:
    """Their edges are too wide to coincide: without these, the clouds still match.

    What is bright in one image is dark in the other.
    """
    deck = ndimage.gaussian_filter(texture(SIDE, SIDE, 30), 5)
    share = np.clip((deck - np.quantile(deck, 0.75)) / deck.std(), 0, 1)
    grounds = noisy(place(), 1, 0.6), noisy(-place()[:: -1 if is_another_place else 1], 2, 0.6)
    reference, input = ((1 - share) * ground + 4 * share for ground in grounds)
    offset = (0.4, -0.3)
    moved = ndimage.shift(input, offset[::-1], mode="mirror")
    rest = rest_of(tmp_path, reference, moved, context, offset, Sensors.DIFFERENT)
    assert rest is not None and rest.survey is not None
    assert rest.shared.sameness.may_be_clouds
    assert (height_of_else(rest) < LEAST_OF_REST) == is_another_place
    if is_another_place:
        assert rest.without_edges is not None and rest.without_edges.height > LEAST_OF_REST


@pytest.mark.slow
def test_of_a_view_whose_edges_are_no_sharper_than_ground_nothing_more_is_asked(
    tmp_path: Path, context: Context
) -> None:
    """Edges half a pixel apart do not coincide sharply."""
    other = (place() + place((1, 0))) / 2
    rest = rest_of(tmp_path, noisy(place(), 1), noisy(other, 2), context)
    assert rest is not None and rest.shared.is_explained and rest.survey is None


@pytest.mark.parametrize(("offset", "is_drawn"), [((6, -4), True), ((6.4, -3.7), False)])
@pytest.mark.slow
def test_views_with_edges_as_sharp_as_drawn_ones_are_taken_for_such_at_whole_pixels(
    offset: tuple[float, float], is_drawn: bool, tmp_path: Path, context: Context
) -> None:
    """Fields; half are under haze and alike only in coarser pixels, so that none is a copy."""
    fine, noise = zoomed(np.round(place()), 5), np.where(np.arange(SIDE) < SIDE // 2, 0.1, 1.2)
    reference, input = (
        zoomed_out(ndimage.shift(fine, np.multiply(5, by), mode="mirror", order=1), 5)
        for by in ((0.0, 0.0), offset[::-1])
    )
    views = noisy(reference, 1, noise), noisy(input, 2, noise)
    surveys = surveys_of(tmp_path, *views, context, offset)
    rest = surveys.rest
    assert rest is not None and rest.shared.sameness.has_sharp_edges and rest.survey is None
    assert rest.shared.is_drawn == is_drawn
    assert deviations_of_unexplained(surveys, ELSEWHERE_PX) < REST_PEAK_DEVIATIONS


@pytest.mark.slow
def test_what_is_drawn_is_not_looked_behind(tmp_path: Path, context: Context) -> None:
    """The same lines over two places."""
    images = [noisy(place(), 1), noisy(place()[::-1], 2)]
    for values in images:
        values[20::55] = values[:, 30::70] = 5.0
    rest = rest_of(tmp_path, *images, context)
    assert rest is not None and rest.shared.is_drawn and rest.survey is None


@pytest.mark.parametrize(("moved_rows", "is_elsewhere"), [(0, False), (SIDE // 3, True)])
@pytest.mark.slow
def test_what_two_radar_images_have_not_in_common_shows_where_a_part_lies(
    moved_rows: int, is_elsewhere: bool, tmp_path: Path, context: Context
) -> None:
    """Their common content is too little to be drawn, but is removed all the same."""
    reference, offset = place(), (0.4, -0.3)
    input = place()
    input[:moved_rows] = place((11, -7))[:moved_rows]
    input = ndimage.shift(input, offset[::-1], mode="mirror")
    views = [noisy(view, seed, 1.0) for seed, view in enumerate((reference, input))]
    rest = rest_of(tmp_path, *views, context, offset, sensors=Sensors.RADARS)
    assert rest is not None and not rest.shared.is_evident and rest.survey is not None
    assert (deviations_elsewhere(rest.survey) >= REST_PEAK_DEVIATIONS) == is_elsewhere
    shifts = [part.shift_px for part in rest.survey.parts]
    assert shifts == ([pytest.approx((11, -7), abs=0.5)] if is_elsewhere else [])


@pytest.mark.parametrize("is_one_place", [True, False])
@pytest.mark.slow
def test_what_two_sensors_have_in_common_is_looked_behind(
    is_one_place: bool, tmp_path: Path, context: Context
) -> None:
    """Soft blots over a fifth; beneath them one place in inverted contrast, or another place."""
    offset = 0.4, -0.3
    blots = 4 * ndimage.gaussian_filter((texture(SIDE, SIDE, 30) > 0.9).astype(float), 3)
    ground = -place() if is_one_place else place()[::-1]
    input = ndimage.shift(0.6 * ground + blots, offset[::-1], mode="mirror")
    views = noisy(0.6 * place() + blots, 1, 0.3), noisy(input, 2, 0.3)
    rest = rest_of(tmp_path, *views, context, offset, sensors=Sensors.DIFFERENT)
    assert rest is not None and rest.survey is not None
    assert (rest.survey.height >= LEAST_OF_REST) == is_one_place
    # A survey above the limit without windows needs no second match.
    assert (rest.without_edges is None) == is_one_place
    assert is_one_place or rest.without_edges.height > rest.survey.height


@pytest.mark.parametrize("is_one_place", [True, False])
@pytest.mark.slow
def test_two_cameras_have_more_in_common_than_a_thin_watermark(
    is_one_place: bool, tmp_path: Path, context: Context
) -> None:
    """Few windows vary alike; beneath is one place in inverted contrast, or another place."""
    offset = 0.4, -0.3
    letters = np.zeros((SIDE, SIDE))
    for top in range(20, SIDE - 20, 30):
        for left in range(20 + top % 17, SIDE - 20, 30):
            letters[top : top + 8, left] = letters[top, left : left + 6] = 3.0
    letters = ndimage.gaussian_filter(letters, 1.2)
    ground = -place() if is_one_place else place()[::-1]
    input = ndimage.shift(ground + letters, offset[::-1], mode="mirror")
    views = noisy(place() + letters, 1, 0.4), noisy(input, 2, 0.4)
    rest = rest_of(tmp_path, *views, context, offset)
    assert rest is not None and rest.survey is None and rest.without_edges is not None
    assert (rest.without_edges.height >= LEAST_BY_ONE_WAY) == is_one_place
