"""The suite of radar images: its cases and its goals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from benchmark_outcomes import outcome

from benchmarks import real
from benchmarks.accuracy import CORRECT, REFUSED, SILENTLY_WRONG
from benchmarks.cases import RealCase
from benchmarks.real import FreeCase, ShiftedCase
from benchmarks.sar_sar import (
    FREE,
    MASKS,
    TOOL,
    SimulatedAttempt,
    other_goals,
    real_goals,
    simulations,
)


def test_simulations_go_through_densities_and_looks_for_both_orbits() -> None:
    made = simulations(range(1, 21))
    assert len(made) == 40 == len({one.name for one in made})
    assert {one.looks for one in made} == {1, 2, 3, 4}
    assert {one.density for one in made} == {"rural", "suburban"}
    assert sum(one.opposite for one in made) == 20


def test_real_pairs_are_registered_by_the_tool(
    cases: dict[str, RealCase], monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = []

    def attempt(name: str, group: str, pair: object, workers: object, **more: object) -> object:
        calls.append((name, group, more))
        return outcome()

    monkeypatch.setattr(real, "attempt", attempt)
    hills = replace(cases["hills"], kind="sar-sar")
    ShiftedCase(hills, 0, tool=TOOL).run(1)
    FreeCase(hills, TOOL, FREE).run(1)
    assert [call[1] for call in calls] == ["sar-sar", "without georeferencing"]
    assert all(call[2]["tool"] == "match_sar_sar" for call in calls)
    # Without georeferencing nothing is told of where the images lie.
    assert "search_radius" in calls[0][2] and "search_radius" not in calls[1][2]


def test_goals_on_real_pairs() -> None:
    good = [outcome(CORRECT), outcome(REFUSED), outcome(CORRECT, group="without georeferencing")]
    assert [goal.reached for goal in real_goals(good)] == [True, True, True]
    bad = [outcome(SILENTLY_WRONG, 9.0), outcome(REFUSED, group="without georeferencing")]
    assert [goal.reached for goal in real_goals(bad)] == [False, False, False]


def test_goals_on_simulated_pairs_count_errors_by_orbit() -> None:
    def groups(same_px: float, opposite_px: float) -> dict[str, list[object]]:
        simulated = {
            SimulatedAttempt(one, mask, Path()).group: [
                outcome(CORRECT, opposite_px if one.opposite else same_px)
            ]
            for one in simulations(range(1, 2))
            for mask in MASKS
        }
        assert len(simulated) == 2 * len(MASKS)
        return simulated

    crossed, large = [outcome(REFUSED)], outcome(CORRECT, seconds=14.0)
    reached = [g.reached for g in other_goals(crossed, groups(0.9, 1.9), large)]  # type: ignore[arg-type]
    for_each_mask = [True, True, True]
    assert reached == [True, *for_each_mask * len(MASKS), True]
    slow = outcome(CORRECT, seconds=16.0)
    reached = [g.reached for g in other_goals([outcome()], groups(1.1, 2.1), slow)]  # type: ignore[arg-type]
    # Too far off for the goal, and not silently wrong.
    for_each_mask = [False, False, True]
    assert reached == [False, *for_each_mask * len(MASKS), False]
