"""Windows: what they have in common, what lies around them, and where they lie in one another."""

from __future__ import annotations

import numpy as np
import pytest

from groundtie.rasters.windows import Window

WHOLE = Window(-10, -20, 100, 90)


def pixels(window: Window) -> np.ndarray:
    """Return the columns and rows of a window's pixels, shape (2, h, w)."""
    cols = np.arange(window.col, window.col + window.width)
    rows = np.arange(window.row, window.row + window.height)
    return np.stack(np.meshgrid(cols, rows))


def test_a_margin_lies_on_every_side() -> None:
    assert Window(3, -2, 5, 7).widened(4) == Window(-1, -6, 13, 15)
    assert Window(3, -2, 5, 7).widened(0) == Window(3, -2, 5, 7)


@pytest.mark.parametrize("window", [Window(3, -9, 5, 11), Window(-8, 8, 8, 16), Window(7, 7, 1, 1)])
def test_whole_blocks_are_the_fewest_that_hold_a_window(window: Window) -> None:
    blocks = window.aligned(8)
    for axis in (0, 1):
        own, all_of_it = (np.unique(pixels(one)[axis] // 8) for one in (window, blocks))
        np.testing.assert_array_equal(own, all_of_it)
        assert blocks[axis] % 8 == blocks[axis + 2] % 8 == 0


def test_a_window_is_cut_from_one_that_holds_it() -> None:
    window = Window(3, -9, 5, 11)
    rows, cols = window.slices_in(WHOLE)
    np.testing.assert_array_equal(pixels(WHOLE)[:, rows, cols], pixels(window))


def test_what_two_have_in_common_is_in_both() -> None:
    assert WHOLE.common(Window(80, -30, 40, 30)) == Window(80, -20, 10, 20)
    assert WHOLE.common(Window(95, 0, 5, 5)).width <= 0
