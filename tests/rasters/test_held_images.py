"""What is held in memory reads as what it was read from."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from raster_files import utm_grid, write_raster

from groundtie.context import threads
from groundtie.rasters.held_images import HeldImage, held_grey, held_on_level
from groundtie.rasters.pair import Image, make_pair
from groundtie.rasters.reading import open_raster

GRID = utm_grid(700, 640)
SHIFT_M = np.array([3.4, -1.7]) * GRID.pixel_size_m


def image(folder: Path, nodata: float | None) -> Image:
    """An image with an area of zeros and a mask of its own."""
    values = np.random.default_rng(0).uniform(1, 200, (GRID.height, GRID.width))
    values[100:140, 200:260] = 0
    mask = np.ones_like(values, np.uint8)
    mask[300:350] = 0
    source, shown = (folder / name for name in ("image.tif", "mask.tif"))
    write_raster(source, values.astype(np.float32), GRID, nodata=nodata)
    write_raster(shown, mask, GRID)
    return Image(open_raster(str(source)), mask=open_raster(str(shown)))


def to_px(xy: np.ndarray) -> np.ndarray:
    return GRID.map_to_pixel(xy + SHIFT_M)


@pytest.mark.parametrize("nodata", [0.0, None])
def test_pieces_are_those_of_the_image(tmp_path: Path, nodata: float | None) -> None:
    original = image(tmp_path, nodata)
    with threads(2) as context:
        held = HeldImage.onto(original, GRID.window(-20, -20, 600, 600), to_px, context)
    hidden = np.zeros((150, 180), bool)
    hidden[40:80, 60:100] = True
    for col, row in ((-20, -20), (150, 60), (333, 280)):
        piece = GRID.window(col, row, 180, 150)
        expected = original.read_onto(piece, to_px, hidden)
        found = held.read(piece, hidden)
        np.testing.assert_array_equal(found.valid, expected.valid)
        np.testing.assert_allclose(found.values, expected.values, atol=0.02)
    assert not expected.valid.all()
    beyond = held.read(GRID.window(500, 400, 180, 150))
    np.testing.assert_array_equal(beyond.valid.any(axis=0), np.arange(180) < 80)
    assert not held.read(GRID.window(-300, -300, 100, 150)).valid.any()
    for other in (GRID.scaled(1.28), GRID.shifted(3.0, 0.0)):
        with pytest.raises(ValueError, match="px off the pixels that are held"):
            held.read(other)


@pytest.mark.parametrize(("nodata", "states"), [(0.0, True), (None, False)])
def test_whoever_states_nothing_of_what_is_valid_does_not_seem_to(
    tmp_path: Path, nodata: float | None, states: bool
) -> None:
    assert held_grey(image(tmp_path, nodata).source).says_what_is_valid is states


def test_a_raster_reads_the_same_from_memory(tmp_path: Path) -> None:
    source = image(tmp_path, 0.0).source
    held = held_grey(source)
    for one, other in zip(held.read(held.window), source.read(source.window), strict=True):
        np.testing.assert_array_equal(one, other)
    assert held.grid == source.grid


@pytest.mark.parametrize("nodata", [0.0, None])
@pytest.mark.parametrize("factor", [4.0, 5.3])
def test_pieces_of_a_level_are_those_of_the_pair(
    tmp_path: Path, nodata: float | None, factor: float
) -> None:
    """Also beyond the border, of whose means a part is missing, and by another model."""
    (tmp_path / "other").mkdir()
    first, second = image(tmp_path, nodata), image(tmp_path / "other", nodata)
    pair = make_pair(first, second)
    level = pair.grid.scaled(factor)
    with threads(2) as context:
        held = held_on_level(pair, level, context)
    for one in (held.reference, held.input):
        assert one.source.grid.width == -(-GRID.width // round(factor))
    for col, row in ((-10, -10), (30, 40), (90, 80)):
        piece = level.window(col, row, 60, 50)
        for found, expected in (
            (held.reference_patch(piece), pair.reference_patch(piece)),
            (held.input_patch(piece, held.nominal_px), pair.input_patch(piece, pair.nominal_px)),
            (
                held.input_patch(piece, lambda xy: held.nominal_px(xy + SHIFT_M)),
                pair.input_patch(piece, lambda xy: pair.nominal_px(xy + SHIFT_M)),
            ),
        ):
            np.testing.assert_array_equal(found.valid, expected.valid)
            assert found.valid.any() and not found.valid.all()
            np.testing.assert_allclose(found.values, expected.values, rtol=1e-5, atol=1e-3)


def test_of_an_image_that_a_level_shows_little_of_no_means_are_held(tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    pair = make_pair(image(tmp_path, 0.0), image(tmp_path / "other", 0.0))
    level = pair.grid.window(0, 0, 200, 200).scaled(4)
    with threads(1) as context:
        held = held_on_level(pair, level, context)
    assert held.reference is pair.reference and held.input is pair.input
