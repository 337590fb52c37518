"""Suites compare what was found with their goals, honestly."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from benchmark_outcomes import outcome, outcomes

from benchmarks import large_shift, real, simulated
from benchmarks.accuracy import CORRECT, CRASHED, INACCURATE, REFUSED, SILENTLY_WRONG
from benchmarks.cases import RealCase, read_cases, search_radius_m
from benchmarks.suites import Goal


def reached(goals: tuple[Goal, ...]) -> list[bool | None]:
    return [goal.reached for goal in goals]


@pytest.mark.parametrize(
    ("counts", "expected"),
    [
        ({CORRECT: 45}, [True, True, None]),
        ({CORRECT: 40, REFUSED: 5}, [True, True, None]),
        ({CORRECT: 39, REFUSED: 6}, [False, True, None]),
        ({CORRECT: 44, SILENTLY_WRONG: 1}, [True, False, None]),
        ({CORRECT: 39, INACCURATE: 6}, [False, True, None]),
        ({CORRECT: 39, CRASHED: 6}, [False, True, None]),
        ({CORRECT: 8, REFUSED: 1}, [True, True, None]),  # --quick
        ({CORRECT: 7, REFUSED: 2}, [False, True, None]),
    ],
)
def test_real_goals(counts: dict[str, int], expected: list[bool | None]) -> None:
    assert reached(real.goals(outcomes(counts))) == expected


def test_other_kinds_do_not_count_towards_the_goal_but_are_told() -> None:
    others = outcomes({SILENTLY_WRONG: 3}, group="day-night")
    goals = real.goals([*outcomes({CORRECT: 45}), *others])
    assert reached(goals) == [True, True, None]
    assert [goal.found for goal in goals] == ["45 of 45", "0 of 45", "3 of 48"]


def test_outcomes_are_grouped_by_kind_in_a_fixed_order() -> None:
    some = [outcome(group=group) for group in ("day-night", "sar-optical", "day-night")]
    grouped = real.by_kind(some)
    assert list(grouped) == ["sar-optical", "day-night"]
    assert [len(group) for group in grouped.values()] == [1, 2]


def test_shifted_cases_are_drawn_and_registered_with_their_radius(
    cases: dict[str, RealCase], monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = []

    def listen(name: str, group: str, pair: object, workers: int, **parameters: float) -> None:
        calls.append((name, group, workers, parameters))

    monkeypatch.setattr(real, "attempt", listen)
    real.ShiftedCase(cases["hills"], 3, 75.0).run(2)
    ((name, group, workers, parameters),) = calls
    assert name.startswith("hills (") and (group, workers) == ("sar-optical", 2)
    assert parameters == {"tool": "coregister", "search_radius": search_radius_m(75.0)}


@pytest.mark.parametrize(
    ("counts", "error_px", "density", "expected"),
    [
        ({CORRECT: 19, REFUSED: 1}, 0.3, "rural", [True, True, True]),
        ({CORRECT: 18, REFUSED: 2}, 0.3, "rural", [False, True, True]),
        ({CORRECT: 20}, 0.31, "rural", [True, False, True]),
        ({CORRECT: 20}, 0.7, "suburban", [True, True, True]),
        ({CORRECT: 19, SILENTLY_WRONG: 1}, 0.7, "suburban", [True, True, False]),
        ({CORRECT: 3, REFUSED: 17}, 0.9, "urban", [None, None, True]),
        ({CORRECT: 3, SILENTLY_WRONG: 1}, 0.9, "urban", [None, None, False]),
        ({REFUSED: 20}, 0.0, "rural", [False, False, True]),
    ],
)
def test_simulated_goals(
    counts: dict[str, int], error_px: float, density: str, expected: list[bool | None]
) -> None:
    assert reached(simulated.goals(density, outcomes(counts, error_px=error_px))) == expected


def test_the_median_is_of_what_was_accepted_wrong_ones_included() -> None:
    errors = [0.1, 0.2, 9.0]
    some = [outcome(error_px=error) for error in errors] + outcomes({REFUSED: 5})
    assert simulated.goals("rural", some)[1].found == "0.20 px"


@pytest.mark.parametrize(
    ("counts", "expected"),
    [
        ({CORRECT: 4}, True),
        ({CORRECT: 1, REFUSED: 3}, True),
        ({CORRECT: 3, INACCURATE: 1}, False),
        ({CORRECT: 3, SILENTLY_WRONG: 1}, False),
        ({CORRECT: 3, CRASHED: 1}, False),
    ],
)
def test_far_off_pairs_are_found_or_refused(counts: dict[str, int], expected: bool) -> None:
    (goal,) = large_shift.goals("real", outcomes(counts))
    assert goal.reached is expected


def test_the_common_ground_is_that_of_both_images(cases: dict[str, RealCase]) -> None:
    # The reference, 90 × 80, begins where the input's first pixels lie: (6, 9) input pixels.
    hills = cases["hills"]
    corners = np.array([[-0.5, -0.5], [95.5, -0.5], [-0.5, 83.5], [95.5, 83.5]])
    seen = np.linalg.solve(hills.matrix[:, :2], (corners - hills.matrix[:, 2]).T).T
    width = min(seen[:, 0].max(), 89.5) - max(seen[:, 0].min(), -0.5)
    height = min(seen[:, 1].max(), 79.5) - max(seen[:, 1].min(), -0.5)
    assert large_shift.common_px(hills) == pytest.approx(min(width, height))


def test_real_pairs_that_overlap_too_little_are_left_out(real_data: Path) -> None:
    by_name = {case.name: case for case in read_cases(real_data)}
    limit = large_shift.REAL_SHIFT_PX + 300
    assert large_shift.common_px(by_name["so-rosenheim"]) > limit
    assert large_shift.common_px(by_name["so-cloudy-sentinel"]) == pytest.approx(256)
    assert not math.isnan(large_shift.common_px(by_name["so-delta"]))
