"""Constants are changed wherever they are imported, and only for a while."""

from __future__ import annotations

import numpy as np
import pytest
from benchmark_outcomes import outcome

from benchmarks.accuracy import CORRECT, REFUSED
from benchmarks.sensitivity import CONSTANTS, USUAL, Constant, group_of, table
from groundtie.matching import pyramid, surface_fit


@pytest.mark.parametrize("constant", CONSTANTS, ids=lambda one: f"{one.module}.{one.name}")
def test_a_constant_is_tried_on_both_sides(constant: Constant) -> None:
    low, usual, high = (np.abs(v) for v in (constant.low, constant.value, constant.high))
    assert np.all(low <= usual) and np.all(usual <= high)
    assert np.any(low < usual) and np.any(usual < high)
    with constant.replaced(constant.low):
        assert constant.value == constant.low
    assert constant.value != constant.low


def test_a_constant_is_replaced_where_it_is_imported() -> None:
    constant = Constant("matching.surface_fit", "FIT_RADIUS_PX", 6, 12)
    usual = surface_fit.FIT_RADIUS_PX
    with pytest.raises(RuntimeError), constant.replaced(12):
        assert pyramid.FIT_RADIUS_PX == surface_fit.FIT_RADIUS_PX == 12
        raise RuntimeError
    assert pyramid.FIT_RADIUS_PX == surface_fit.FIT_RADIUS_PX == usual


def test_medians_are_of_the_pairs_that_all_values_accept() -> None:
    constant = Constant("matching.surface_fit", "_NEAR_PX", 2, 6)
    groups = {
        USUAL: [outcome(CORRECT, 0.2), outcome(CORRECT, 0.4)],
        group_of(constant, 2): [outcome(CORRECT, 0.3), outcome(REFUSED)],
        group_of(constant, 6): [outcome(CORRECT, 0.1), outcome(CORRECT, 0.9)],
    }
    _, row = table([constant], groups).rows
    assert row[2:] == ["2: 1 of 2", "6: 2 of 2", "0.20", "0.30, 0.10"]
