from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from raster_files import utm_grid, write_raster

from groundtie.errors import NoOverlapError
from groundtie.matching.layout import _HELD_OUT, Axis, ChipLayout, default_chip_px, lay_out_chips
from groundtie.rasters.pair import Image, ImagePair
from groundtie.rasters.reading import RasterSource, open_raster


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> RasterSource:
    path = tmp_path_factory.mktemp("layout") / "any.tif"
    return open_raster(write_raster(path, np.ones((4, 4), np.uint8), utm_grid(4, 4)))


def laid_out(
    source: RasterSource, size: tuple[int, int], overlap: tuple[int, int] | None = None
) -> ChipLayout:
    pair = ImagePair(
        Image(source), Image(source), utm_grid(*size), overlap or size, utm_grid(*size)
    )
    return lay_out_chips(pair)


def pixels_of(centres: np.ndarray, chip: int, size: tuple[int, int]) -> np.ndarray:
    """Return the mask of the pixels that any of the chips covers."""
    mask = np.zeros(size[::-1], bool)
    for col, row in centres - chip // 2:
        mask[row : row + chip, col : col + chip] = True
    return mask


def held_out_of(layout: ChipLayout, size: tuple[int, int]) -> np.ndarray:
    cols, rows = (np.arange(float(n)) for n in size)
    return layout.held_out(cols, rows[:, None])


SIZES = st.tuples(st.integers(200, 900), st.integers(200, 900))


@pytest.mark.slow
@settings(max_examples=100)
@given(size=SIZES)
def test_check_chips_share_no_pixel_with_the_fit_nor_leave_the_grid(
    source: RasterSource, size: tuple[int, int]
) -> None:
    layout = laid_out(source, size)
    assert layout.chip_px == default_chip_px(*size)
    groups = (layout.fit_centres, layout.chip_px), (layout.check_centres, layout.check_chip_px)
    for centres, side in groups:
        corners = centres - side // 2
        assert corners.min() >= 0
        assert (corners <= np.array(size) - side).all()
        assert len(np.unique(centres, axis=0)) == len(centres)
    fit, check = (pixels_of(*group, size) for group in groups)
    held_out = held_out_of(layout, size)
    assert not (fit & held_out).any()
    assert (held_out | ~check).all()


@settings(max_examples=50)
@given(size=SIZES)
def test_the_same_share_of_every_cell_is_held_out_and_chips_of_the_fit_reach_all_corners(
    source: RasterSource, size: tuple[int, int]
) -> None:
    layout = laid_out(source, size)
    cells = np.array([layout.columns.cells, layout.rows.cells])
    inner = np.array(size) - layout.chip_px
    expected = (_HELD_OUT * inner).prod()
    # Each side of a block is accurate to a pixel.
    slack = (_HELD_OUT * inner + cells).prod() - expected
    assert abs(held_out_of(layout, size).sum() - expected) <= slack
    corners = layout.fit_centres - layout.chip_px // 2
    assert corners.min(axis=0).tolist() == [0, 0]
    assert corners.max(axis=0).tolist() == list(inner)


def test_the_middle_of_each_cell_is_held_out() -> None:
    """A side of 110 px with chips of 10 and 2 cells: lines at 4.5, 54.5 and 104.5."""
    axis = Axis(size=110, chip=10, cells=2)
    block = _HELD_OUT * 50
    assert axis.block == pytest.approx(block)
    px = np.arange(110.0)
    middle = np.minimum(np.abs(px - 29.5), np.abs(px - 79.5))
    np.testing.assert_array_equal(axis.held_out(px), middle < block / 2)
    np.testing.assert_array_equal(axis.held_out(px, 3.2), middle < block / 2 + 3.2)
    np.testing.assert_allclose(axis.divided(2), [4.5, 29.5, 54.5, 79.5, 104.5])
    # Two chips that fit into a block lie a pixel from its borders; a larger one in its middle.
    half = (block - 10) / 2 - 1
    expected = [29.5 - half, 29.5 + half, 79.5 - half, 79.5 + half]
    np.testing.assert_allclose(axis.check_centres(10), expected)
    np.testing.assert_allclose(axis.check_centres(15), [29.5, 79.5])


def test_chips_grow_with_the_scene_within_limits() -> None:
    sides = [200, 400, 800, 1600, 3200, 10_000]
    chips = [default_chip_px(side, 2 * side) for side in sides]
    assert chips == sorted(chips)
    assert chips[0] >= 24
    assert chips[-1] <= 128
    assert chips == [default_chip_px(2 * side, side) for side in sides]


@pytest.mark.parametrize("side", [200, 260, 400, 600, 1000])
def test_small_scenes_have_cells_enough(source: RasterSource, side: int) -> None:
    layout = laid_out(source, (side, side))
    assert layout.columns.cells >= 2
    assert len(layout.check_centres) >= 4
    assert len(layout.fit_centres) >= 20


def test_large_scenes_do_not_get_more_cells(source: RasterSource) -> None:
    layout = laid_out(source, (20_000, 10_000))
    assert (layout.columns.cells, layout.rows.cells) == (6, 6)
    assert 50 <= len(layout.check_centres) <= 144
    assert len(layout.fit_centres) <= 200


def test_cells_are_counted_over_the_overlap_not_over_the_search_margin(
    source: RasterSource,
) -> None:
    """If the overlap is half of the grid, the grid has twice as many cells."""
    layout = laid_out(source, (20_000, 20_000), overlap=(10_000, 20_000))
    assert (layout.columns.cells, layout.rows.cells) == (12, 6)


@pytest.mark.parametrize("size", [(60, 60), (500, 143)])
def test_too_small_an_overlap_is_refused_with_what_is_needed(
    source: RasterSource, size: tuple[int, int]
) -> None:
    found = rf"any\.tif.*{size[0]} × {size[1]} matching pixels; at least 144 × 144"
    with pytest.raises(NoOverlapError, match=found):
        laid_out(source, size)
    assert laid_out(source, (size[0], 144) if size[0] > 144 else (144, 144))


@pytest.mark.parametrize("side", range(60, 260, 5))
def test_what_is_not_refused_has_chips_of_both_kinds(source: RasterSource, side: int) -> None:
    try:
        layout = laid_out(source, (side, side + 7))
    except NoOverlapError:
        assert side < 144
        return
    assert len(layout.check_centres) >= 4
    assert len(layout.fit_centres) >= 16
    assert layout.check_chip_px >= 24
