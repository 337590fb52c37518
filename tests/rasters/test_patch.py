from __future__ import annotations

import numpy as np
import pytest

from groundtie.rasters.patch import Patch

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
