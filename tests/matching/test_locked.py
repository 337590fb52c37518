from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from affine import Affine
from evidences import VIEWS
from raster_files import utm_grid, write_raster
from textured_pairs import of_a_sensor, shift_on_map, texture

from groundtie.context import Context
from groundtie.geometry.models import Frame, Model, PolynomialModel
from groundtie.geometry.transform import Transform
from groundtie.matching.chip_windows import Resampled
from groundtie.matching.locked import EXACT_PX, LockedContent, find_locked_content
from groundtie.matching.shared_content import Sensors
from groundtie.matching.survey import survey_places
from groundtie.rasters.grid import compose
from groundtie.rasters.pair import Image, ImagePair, make_pair
from groundtie.rasters.reading import open_raster

SIDE = 320


def looked_at(
    folder: Path,
    reference: np.ndarray,
    input: np.ndarray,
    context: Context,
    model: Model | None = None,
    exact_px: float = EXACT_PX,
    sensors: Sensors = Sensors.CAMERAS,
) -> LockedContent | None:
    """Search two arrays on one grid for common content under a model."""
    grid = utm_grid(SIDE, SIDE)
    paths = [
        write_raster(folder / f"{name}.tif", np.rint(2000 + 300 * values).astype(np.uint16), grid)
        for name, values in (("reference", reference), ("input", input))
    ]
    with open_raster(paths[0]) as one, open_raster(paths[1]) as other:
        pair = make_pair(Image(one), Image(other), search_radius_m=500.0)
        transform = Transform(model or shift_on_map(0.0, 0.0), pair.grid.crs, other.grid)
        places = survey_places(pair.grid)
        images = Resampled(pair, transform)
        return find_locked_content(images, transform, places, sensors, exact_px, context)


def drawn_into(values: np.ndarray, offset: tuple[int, int] = (0, 0), width: int = 4) -> np.ndarray:
    """Return an array with lines drawn at columns and rows, displaced by an offset."""
    made = values.copy()
    first = 2 - width // 2
    end = first + width
    for at in (40, 110, 190, 260):
        made[at + offset[1] + first : at + offset[1] + end] = 8.0
        made[:, at + offset[0] + first : at + offset[0] + end] = 8.0
    return made


def sensed(seed: int, noise: float = 0.4, place: int = 1) -> np.ndarray:
    """Return one view of a place with independent noise."""
    ground = texture(SIDE, SIDE, place)
    return ground + noise * np.random.default_rng(seed).normal(size=ground.shape)


def lies_at(locked: LockedContent, offset: tuple[float, float]) -> bool:
    """Return whether the drawn content is displaced by so many columns and rows in the input."""
    reference = locked.pair.reference.source.grid
    place = [[10.0, 20.0]]
    return bool(np.allclose(locked.to_input(reference.pixel_to_map(place)) - place, offset))


@pytest.mark.parametrize("offset", [(0, 0), (7, -3)])
@pytest.mark.slow
def test_lines_that_are_drawn_over_different_ground_are_found(
    tmp_path: Path, context: Context, offset: tuple[int, int]
) -> None:
    reference, input = drawn_into(sensed(1)), drawn_into(sensed(2, place=9), offset)
    # The grid has rows from north to south and pixels of 10 m.
    model = shift_on_map(10.0 * offset[0], -10.0 * offset[1])
    locked = looked_at(tmp_path, reference, input, context, model)
    assert locked is not None and locked.shared.sameness.is_evident
    assert lies_at(locked, offset)
    assert locked.shared.sameness.has_sharp_edges


@pytest.mark.parametrize("widths", [(4, 6), (4, 8), (1, 3)])
@pytest.mark.slow
def test_lines_that_are_drawn_in_other_widths_are_found(
    tmp_path: Path, context: Context, widths: tuple[int, int]
) -> None:
    """Their edges lie a pixel or two beside one another; for the thinnest, a fraction of one."""
    reference, input = (
        drawn_into(sensed(seed, place=place), width=width)
        for seed, place, width in zip((1, 2), (1, 9), widths, strict=True)
    )
    locked = looked_at(tmp_path, reference, input, context)
    assert locked is not None and locked.shared.sameness.is_evident
    assert locked.shared.sameness.has_edges_beside and not locked.shared.sameness.has_sharp_edges
    assert locked.shared.is_drawn
    alike = replace(VIEWS, beside=locked.shared.sameness.beside)
    assert replace(locked.shared, sameness=alike).is_drawn


@pytest.mark.parametrize("off_m", [0.0, 5.0, 10.0, 15.0])
@pytest.mark.slow
def test_edges_of_one_ground_lie_to_either_side(
    tmp_path: Path, context: Context, off_m: float
) -> None:
    """Even if the transform is wrong by one and a half pixels of 10 m."""
    model = shift_on_map(off_m, 0.0)
    locked = looked_at(tmp_path, sensed(1), sensed(2), context, model)
    assert locked is not None and locked.shared.sameness.beside < 0.3


def masked(folder: Path, locked: LockedContent | None) -> np.ndarray:
    """Return the mask over 200 × 200 pixels, from column 20 and row 0."""
    assert locked is not None
    with open_raster(folder / "reference.tif") as one, open_raster(folder / "input.tif") as two:
        pair = make_pair(Image(one), Image(two), search_radius_m=500.0)
        return replace(locked, pair=pair)(one.grid.window(20, 0, 200, 200))


@pytest.mark.slow
def test_its_mask_covers_the_lines_and_their_surroundings_alone(
    tmp_path: Path, context: Context
) -> None:
    plain = sensed(1), sensed(2, place=9)
    mask = masked(tmp_path, looked_at(tmp_path, *map(drawn_into, plain), context))
    drawn = drawn_into(np.zeros((SIDE, SIDE)))[:200, 20:220] > 0
    assert mask[drawn].mean() > 0.99
    # No window of 9 pixels in this area reaches the rows 40 to 43 or 110 to 113, or such columns.
    assert mask[52:102, 32:82].mean() < 0.5


@pytest.mark.parametrize("colours", [(8.0, 8.0), (-5.0, 8.0)])
@pytest.mark.parametrize("width", [1, 3])
@pytest.mark.slow
def test_lines_are_masked_in_any_colour_over_any_ground(
    tmp_path: Path, context: Context, colours: tuple[float, float], width: int
) -> None:
    """The lines are a tenth as strong where the reference shows nothing else."""
    images = [sensed(1), sensed(2, place=9)]
    images[0][:, :160] *= 0.05
    for image, colour, faint in zip(images, colours, (0.1, 1.0), strict=True):
        for row in range(60, 60 + width):
            image[row::20, :160] = colour * faint
            image[row::20, 160:] = colour
    locked = looked_at(tmp_path, *images, context)
    assert (
        locked is not None and locked.shared.sameness.is_evident and not locked.shared.is_explained
    )
    assert masked(tmp_path, locked)[60::20].mean() > 0.95


@pytest.mark.slow
def test_tiles_of_a_mosaic_are_found_in_speckle_and_their_seams_masked(
    tmp_path: Path, context: Context
) -> None:
    """Speckle hides how sharp their edges are."""
    tile = np.searchsorted((45, 130, 240), np.arange(SIDE), side="right") % 2
    gains = np.where(tile, 0.6, 1.2) * np.where(tile, 0.6, 1.2)[:, None]
    reference, input = (
        gains
        * (10 + sensed(seed, 0.0, place))
        * np.random.default_rng(seed).gamma(3.0, 1 / 3, (SIDE, SIDE))
        for seed, place in ((1, 1), (2, 9))
    )
    locked = looked_at(tmp_path, reference, input, context, sensors=Sensors.DIFFERENT)
    assert locked is not None and locked.shared.is_evident
    assert not locked.shared.sameness.has_sharp_edges and locked.shared.sameness.has_seams
    mask = masked(tmp_path, locked)
    # Columns count from 20.
    assert mask[:, 104:116].mean() > 0.9 and mask[124:136].mean() > 0.9


@pytest.mark.slow
def test_edges_of_what_is_drawn_are_masked(tmp_path: Path, context: Context) -> None:
    """Windows beside a line no longer vary alike if the ground varies as much as the line."""
    reference, input = (drawn_into(3 * sensed(n, place=place)) for n, place in ((1, 1), (2, 9)))
    mask = masked(tmp_path, looked_at(tmp_path, reference, input, context))
    assert mask[39:45].mean() > 0.9


@pytest.mark.parametrize("place", [1, 9])
@pytest.mark.slow
def test_views_without_anything_drawn_have_none(
    tmp_path: Path, context: Context, place: int
) -> None:
    """Noise blurs the edges in views of different sensors."""
    locked = looked_at(tmp_path, sensed(1, 0.8), -sensed(2, 0.8, place), context)
    assert locked is not None and not locked.shared.sameness.is_evident


@pytest.mark.parametrize(
    ("off_m", "exact_px", "is_evident"),
    [(0.6, EXACT_PX, True), (0.7, EXACT_PX, False), (1.9, 0.2, True), (2.1, 0.2, False)],
)
@pytest.mark.slow
def test_a_transform_to_whole_pixels_is_evidence_itself(
    tmp_path: Path, context: Context, off_m: float, exact_px: float, is_evident: bool
) -> None:
    """Two sensors' views of one ground rarely match so exactly; pixels of 10 m, poses to 0.2."""
    images = sensed(1, 0.8), -sensed(2, 0.8, 9)
    locked = looked_at(tmp_path, *images, context, shift_on_map(70.0 + off_m, -30.0), exact_px)
    assert locked is not None
    assert lies_at(locked, (7 if is_evident else 7 + off_m / 10, 3))
    assert not locked.shared.sameness.is_evident
    assert locked.shared.is_evident == is_evident
    # The mask then surrounds edges, whatever they look like.
    assert (masked(tmp_path, locked).mean() > 0.1) == is_evident


@pytest.mark.slow
def test_clouds_in_other_colours_are_masked_where_the_transform_is_evidence(
    tmp_path: Path, context: Context
) -> None:
    """No part of them is the same, and soft clouds have few edges."""
    clouds = 3 * texture(SIDE, SIDE, 30)
    images = sensed(1) + clouds, sensed(2, place=9) - clouds
    locked = looked_at(tmp_path, *images, context)
    assert locked is not None and locked.shared.is_exact and locked.shared.sameness.area < 0.1
    assert masked(tmp_path, locked).mean() > 0.8
    at_any_place = replace(locked, shared=replace(locked.shared, is_whole=False))
    assert masked(tmp_path, at_any_place).mean() < 0.2


@pytest.mark.parametrize(
    ("sensors", "place", "off_m", "is_exact"),
    [
        (Sensors.RADARS, 9, 4.0, True),
        (Sensors.RADARS, 1, 0.0, False),
        (Sensors.DIFFERENT, 9, 0.3, True),
        (Sensors.DIFFERENT, 9, 0.7, False),
        (Sensors.CAMERAS, 9, 0.7, False),
    ],
)
@pytest.mark.slow
def test_radar_images_are_as_if_on_whole_pixels_unless_they_vary_as_one_ground(
    tmp_path: Path, context: Context, sensors: Sensors, place: int, off_m: float, is_exact: bool
) -> None:
    """Radar images of one ground vary alike where speckle averages out; pixels of 10 m."""
    images, model = (sensed(1, 0.8), sensed(2, 0.8, place)), shift_on_map(off_m, 0.0)
    locked = looked_at(tmp_path, *images, context, model, sensors=sensors)
    assert locked is not None and locked.shared.is_exact == is_exact
    assert locked.shared.sameness.varies_as_ground == (place == 1)


@pytest.mark.slow
def test_one_sensors_views_of_one_ground_are_explained(tmp_path: Path, context: Context) -> None:
    """Most windows vary alike; where single pixels do not, windows of reduced images do."""
    locked = looked_at(tmp_path, sensed(1, 0.15), sensed(2, 0.15), context)
    assert locked is not None and locked.shared.sameness.area > 0.5
    assert locked.shared.is_explained


@pytest.mark.parametrize(
    ("offset", "is_moved"),
    [
        ((0.0, 1.4), False),
        ((0.0, 1.6), True),
        ((6.2, 3.0), False),
        ((6.2, 3.3), True),
        ((6.3, 3.0), True),
    ],
)
@pytest.mark.slow
def test_what_is_drawn_moves_by_whole_pixels_or_hardly_at_all(
    tmp_path: Path, context: Context, offset: tuple[float, float], is_moved: bool
) -> None:
    """Pixels of 10 m."""
    model = shift_on_map(10.0 * offset[0], -10.0 * offset[1])
    locked = looked_at(tmp_path, sensed(1), sensed(2, place=9), context, model)
    assert locked is not None and locked.shared.moves_as_ground == is_moved


def test_a_copy_is_explained_of_one_kind_of_sensor(tmp_path: Path, context: Context) -> None:
    locked = looked_at(tmp_path, sensed(1), sensed(1), context)
    assert locked is not None and locked.shared.sameness.area > 0.99
    assert locked.shared.is_explained
    assert replace(locked.shared, sensors=Sensors.RADARS).is_explained
    assert not replace(locked.shared, sensors=Sensors.DIFFERENT).is_explained
    assert not locked.shared.sameness.is_finer_than_ground


@pytest.mark.slow
def test_a_copy_in_other_colours_is_not_drawn(tmp_path: Path, context: Context) -> None:
    """Its edges are as sharp as those of a drawing, but lie everywhere."""
    copy = looked_at(tmp_path, sensed(1, 0.1), -1.5 * sensed(2, 0.1), context)
    assert copy is not None and copy.shared.sameness.sharpness > 5
    assert not copy.shared.is_drawn
    # All of it corresponds in other colours and must not be hidden; only edges are.
    assert copy.shared.is_exact and masked(tmp_path, copy).mean() < 0.95
    drawn = drawn_into(sensed(1)), -drawn_into(sensed(2, place=9))
    locked = looked_at(tmp_path, *drawn, context)
    assert locked is not None and locked.shared.sameness.sharpness > 5
    assert locked.shared.is_drawn


@pytest.mark.parametrize(("blur_px", "strength"), [(0.1, 2.0), (2.0, 1.0), (2.0, 2.0)])
def test_one_pattern_of_noise_over_different_ground_is_found(
    tmp_path: Path, context: Context, blur_px: float, strength: float
) -> None:
    """Correlated noise agrees as much in images reduced by 4."""
    noise = np.random.default_rng(5).normal(size=(SIDE, SIDE))
    pattern = cv2.GaussianBlur(noise, (0, 0), blur_px)
    pattern *= strength / pattern.std()
    reference, input = sensed(1, 0.1) + pattern, sensed(2, 0.1, place=9) + pattern
    locked = looked_at(tmp_path, reference, input, context)
    assert locked is not None and locked.shared.sameness.is_evident
    assert locked.shared.sameness.is_finer_than_ground and not locked.shared.is_explained


def test_a_pattern_of_rows_and_columns_is_no_ground(tmp_path: Path, context: Context) -> None:
    """It persists in reduced images, but less than at full resolution."""
    rng = np.random.default_rng(6)
    pattern = 0.6 * rng.normal(size=(SIDE, SIDE))
    pattern += rng.normal(size=(SIDE, 1)) + rng.normal(size=(1, SIDE))
    reference, input = sensed(1, 0.1) + pattern, sensed(2, 0.1, place=9) + pattern
    locked = looked_at(tmp_path, reference, input, context)
    assert locked is not None and locked.shared.sameness.is_evident
    assert locked.shared.sameness.reduced_area < locked.shared.sameness.area
    assert not locked.shared.is_explained


def test_the_same_holes_are_found_in_speckle(tmp_path: Path, context: Context) -> None:
    """Holes have gradients only at their edges, where the ground differs."""
    holes = cv2.GaussianBlur(texture(SIDE, SIDE, 5), (0, 0), 12.0) > 0
    speckled = (np.random.default_rng(n).exponential(3.0, holes.shape) for n in (1, 2))
    reference, input = (np.where(holes, -3.0, values) for values in speckled)
    locked = looked_at(tmp_path, reference, input, context)
    assert locked is not None and 0.4 < locked.shared.sameness.area < 0.6
    assert locked.shared.sameness.is_evident
    assert not locked.shared.is_explained


@contextmanager
def on_grids(
    folder: Path, reference: np.ndarray, input: np.ndarray, place: Affine
) -> Iterator[ImagePair]:
    """Yield two arrays as a pair, the second with its own geotransform."""
    grid = utm_grid(SIDE, SIDE)
    own = grid.on_same_map(place, input.shape[1], input.shape[0])
    paths = [
        write_raster(folder / name, np.rint(2000 + 300 * values).astype(np.uint16), on)
        for name, values, on in (("reference.tif", reference, grid), ("input.tif", input, own))
    ]
    with open_raster(paths[0]) as one, open_raster(paths[1]) as other:
        yield make_pair(Image(one), Image(other), search_radius_m=500.0)


def found_in(pair: ImagePair, model: Model, context: Context) -> LockedContent | None:
    """Search two camera images for common content under a model."""
    transform = Transform(model, pair.grid.crs, pair.input.source.grid)
    places = survey_places(pair.grid)
    images = Resampled(pair, transform)
    return find_locked_content(images, transform, places, Sensors.CAMERAS, EXACT_PX, context)


@pytest.mark.parametrize("side_m", [8.0, 10.0])
@pytest.mark.parametrize("offset", [(0, 0), (5, -3)])
@pytest.mark.slow
def test_lines_that_are_drawn_on_the_map_are_found_on_another_grid(
    tmp_path: Path, context: Context, side_m: float, offset: tuple[int, int]
) -> None:
    """The other grid has pixels of 8 m, or of 10 m as the reference, and is offset by 4 m.

    The lines may be displaced on the map. A nominal transform or a shift is no evidence here: the
    ground may lie there, too.
    """
    grid, factor = utm_grid(SIDE, SIDE), side_m / 10.0
    reference, input = drawn_into(sensed(1)), drawn_into(sensed(2, place=9), offset)
    side = round((SIDE - 1) / factor)
    there = ((np.arange(side) + 0.5) * factor + 0.4 - 0.5).astype(np.float32)
    seen = cv2.remap(input.astype(np.float32), *np.meshgrid(there, there), cv2.INTER_CUBIC)
    place = compose(grid.transform, Affine.translation(0.4, 0.4), Affine.scale(factor))
    model = shift_on_map(10.0 * offset[0], -10.0 * offset[1])
    with on_grids(tmp_path, reference, seen, place) as pair:
        locked = found_in(pair, model, context)
        assert locked is not None and locked.shared.sameness.is_evident
        assert locked.shared.sameness.has_sharp_edges and not locked.shared.is_exact


@pytest.mark.slow
def test_lines_at_the_same_columns_and_rows_are_found_whatever_pixels_are_nominal(
    tmp_path: Path, context: Context
) -> None:
    """A transform that undoes another pixel size to a sixteenth of a pixel is evidence."""
    grid, factor = utm_grid(SIDE, SIDE), 1.02
    reference, input = drawn_into(sensed(1)), drawn_into(sensed(2, place=9))
    place = compose(grid.transform, Affine.scale(factor))
    # From the reference's map to the input's, x and y from the common corner.
    corner = np.array([grid.transform.c, grid.transform.f])
    stretched = PolynomialModel(
        "affine",
        Frame(Affine.identity()),
        np.array([(1 - factor) * corner, [factor - 1, 0.0], [0.0, factor - 1]]),
    )
    with on_grids(tmp_path, reference, input, place) as pair:
        locked = found_in(pair, stretched, context)
        assert (
            locked is not None and locked.shared.is_exact and locked.shared.sameness.has_sharp_edges
        )
        assert lies_at(locked, (0, 0))


@pytest.mark.parametrize("side_m", [10.0, 12.0])
def test_arrays_are_not_the_same_where_a_transform_has_them_elsewhere(
    tmp_path: Path, context: Context, side_m: float
) -> None:
    turned = PolynomialModel(
        "affine",
        Frame(Affine.identity()),
        np.array([[50.0, -30.0], [1e-3, 2e-2], [-2e-2, 1e-3]]),
    )
    model = turned if side_m == 10.0 else shift_on_map(40.0, 0.0)
    place = utm_grid(SIDE, SIDE).scaled(side_m / 10.0).transform
    with on_grids(tmp_path, sensed(1), sensed(1), place) as pair:
        locked = found_in(pair, model, context)
        assert locked is not None and not locked.shared.is_evident


def test_nothing_is_drawn_on_the_map_of_an_image_of_a_sensor(
    tmp_path: Path, context: Context
) -> None:
    with on_grids(tmp_path, sensed(1), sensed(1), utm_grid(SIDE, SIDE).transform) as pair:
        pair = replace(pair, input=of_a_sensor(pair.input))
        assert found_in(pair, shift_on_map(3.0, 0.0), context) is None
