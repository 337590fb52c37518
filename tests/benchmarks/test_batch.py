"""The suite of batches: goals by the rates, and processor seconds of the tool alone."""

from __future__ import annotations

import pytest

from benchmarks.batch import DASK, ONE, TWO, Record, goals, load_timed, measurements


def test_goals_are_reached_by_rates() -> None:
    records = [Record(ONE, 8, 10.0, 1.2), Record(TWO, 8, 5.0, 1.2), Record(DASK, 8, 6.0, 1.3)]
    assert [goal.reached for goal in goals(records)] == [True, True, False]
    assert [goal.found for goal in goals(records)] == ["1.60", "2.00", "0.83"]
    assert len(goals(records[:2])) == 2
    assert measurements(records).rows[0] == (ONE, "8", "10.0", "0.80", "1.20")


def test_a_timed_tool_is_the_tool() -> None:
    tool = load_timed("filter_speckle")
    assert tool.name == "filter_speckle"
    with pytest.raises(OSError, match="none"):
        tool.run(input="none.tif", output="out.tif")
