"""The suite on memory: which budgets it compares, and what it makes of the peaks."""

from __future__ import annotations

import pytest

from benchmarks.memory import BUDGETS_MB, Run, goals, table

USUAL, SMALL = BUDGETS_MB


def runs(largest: float) -> list[Run]:
    return [
        Run("warp", USUAL, 400_000_000, 20.0),
        Run("warp", SMALL, 300_000_000, 21.0),
        Run("coregister", USUAL, round(largest), 60.0),
        Run("coregister", SMALL, 500_000_000, 66.0),
    ]


@pytest.mark.parametrize(("largest", "reached"), [(9.9e8, True), (1.01e9, False)])
def test_the_goal_is_of_the_largest_peak(largest: float, reached: bool) -> None:
    (goal,) = goals(runs(largest), is_complete=True)
    assert goal.reached == reached and "coregister" in goal.found
    assert goals(runs(largest), is_complete=False)[0].reached is None


def test_a_row_has_all_budgets_of_a_tool() -> None:
    found = table(runs(9e8))
    assert list(found.rows) == [
        ["warp", "400", "20.0", "300", "21.0"],
        ["coregister", "900", "60.0", "500", "66.0"],
    ]
