from __future__ import annotations

import cv2
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


@pytest.mark.parametrize("value", [0.1, 200, 1000.3, -7e8])
def test_an_interpolated_constant_is_flat_and_the_least_grey_value_of_16_bits_is_not(
    value: float,
) -> None:
    constant = np.full((40, 40), value, np.float32)
    moved = np.array([[1, 0, 0.37], [0, 1, 0.54]])
    interpolated = cv2.warpAffine(constant, moved, (30, 30), flags=cv2.INTER_CUBIC)[5:, 5:]
    assert patch(values=interpolated).is_flat
    assert not patch(values=np.array([[65534, 65535]], np.float32)).is_flat


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
