from __future__ import annotations

import numpy as np
import pytest

from groundtie.rasters.patch import Patch, reduced_patch

VALUES = np.arange(30, dtype=np.float32).reshape(5, 6)


def patch(valid: np.ndarray | bool = True, values: np.ndarray = VALUES) -> Patch:
    return Patch(values, np.broadcast_to(np.asarray(valid), values.shape).copy())


def test_shares_of_valid_pixels() -> None:
    assert patch().all_valid
    assert patch().valid_share == 1
    some = patch(VALUES % 3 == 0)
    assert not some.all_valid
    assert some.valid_share == pytest.approx(1 / 3)
    assert patch(False).valid_share == 0


def test_flat_is_what_holds_one_value_among_valid_pixels() -> None:
    assert not patch().is_flat
    assert patch(VALUES == 7).is_flat
    assert patch(False).is_flat
    assert patch(values=np.full((3, 3), 4, np.float32)).is_flat
    spoiled = np.full((3, 3), 4, np.float32)
    spoiled[0, 0] = 9
    assert patch(spoiled == 4, spoiled).is_flat


@pytest.mark.parametrize("border", [0, 1, 2])
def test_the_inner_part_loses_a_border_on_each_side(border: int) -> None:
    inner = patch(VALUES > 9).inner(border)
    assert inner.values.shape == (5 - 2 * border, 6 - 2 * border)
    np.testing.assert_array_equal(inner.valid, inner.values > 9)
    assert inner.values[0, 0] == VALUES[border, border]


def test_reduced_pixels_are_means_of_valid_ones() -> None:
    values = np.arange(80, dtype=np.float32).reshape(8, 10)
    valid = np.ones(values.shape, bool)
    valid[:4, :3] = False
    smaller = reduced_patch(Patch(values, valid), 4, 0.25)
    # A quarter of the first square is left: the column 3 of the rows 0 to 3.
    means = [[np.mean([3, 13, 23, 33]), values[:4, 4:8].mean()]]
    np.testing.assert_allclose(
        smaller.values, [*means, [values[4:, :4].mean(), values[4:, 4:8].mean()]]
    )
    assert smaller.valid.all()
    valid[:4, 3] = False
    assert reduced_patch(Patch(values, valid), 4, 0.25).valid.tolist() == [
        [False, True],
        [True] * 2,
    ]


@pytest.mark.parametrize("factor", [*range(2, 12), 49, 93])
def test_blocks_that_are_whole_are_valid(factor: int) -> None:
    patch = Patch(np.ones((3 * factor,) * 2, np.float32), np.ones((3 * factor,) * 2, bool))
    assert reduced_patch(patch, factor).all_valid
    patch.valid[-1, -1] = False
    assert np.argwhere(~reduced_patch(patch, factor).valid).tolist() == [[2, 2]]
