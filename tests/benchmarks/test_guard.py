"""What costs more than the committed state is reported."""

from __future__ import annotations

import pytest

from benchmarks.guard import Cost, goals, read_state


@pytest.mark.parametrize(
    ("now", "kept"),
    [
        (Cost(1.0, 100.0), True),
        (Cost(1.14, 114.0), True),
        (Cost(1.16, 100.0), False),
        (Cost(1.0, 116.0), False),
        (Cost(0.2, 20.0), True),
    ],
)
def test_a_job_may_not_cost_more_than_committed(now: Cost, kept: bool) -> None:
    (goal,) = goals({"job": now, "new": now}, {"job": Cost(1.0, 100.0)})
    assert goal.reached is kept


def test_there_is_a_state_of_six_jobs() -> None:
    state = read_state()
    assert len(state) == 6
    assert all(cost.yardsticks > 0 and cost.peak_mb > 0 for cost in state.values())
