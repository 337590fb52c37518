"""Progress: parts of the whole, and cancelling."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from groundtie.errors import CancelledError
from groundtie.progress import SILENT, Progress

FRACTION = st.floats(0, 1)


def test_the_whole_reports_what_it_is_given() -> None:
    seen: list[tuple[float, str]] = []
    Progress(lambda fraction, message: seen.append((fraction, message))).update(0.25, "reading")
    assert seen == [(0.25, "reading")]


def test_parts_of_parts_are_nested() -> None:
    seen: list[float] = []
    whole = Progress(lambda fraction, message: seen.append(fraction))
    half = whole.part(0.5, 1.0)
    quarter = half.part(0.0, 0.5)
    for progress in (half, quarter):
        progress.update(0.0)
        progress.update(1.0)
    assert seen == [0.5, 1.0, 0.5, 0.75]


def test_items_are_reported_when_the_next_is_asked_for() -> None:
    seen: list[float] = []
    progress = Progress(lambda fraction, message: seen.append(fraction))
    items = progress.over(iter("abcd"), 4)
    assert (next(items), next(items), seen) == ("a", "b", [0.25])
    assert (list(items), seen) == (["c", "d"], [0.25, 0.5, 0.75, 1.0])


@given(st.tuples(FRACTION, FRACTION).map(sorted), FRACTION)
def test_a_part_stays_within_its_bounds(bounds: list[float], fraction: float) -> None:
    seen: list[float] = []
    Progress(lambda done, message: seen.append(done)).part(*bounds).update(fraction)
    assert bounds[0] - 1e-12 <= seen[0] <= bounds[1] + 1e-12


def test_cancelling_stops_at_the_next_step_and_reports_nothing_more() -> None:
    seen: list[float] = []
    cancelled = False
    progress = Progress(lambda fraction, message: seen.append(fraction), lambda: cancelled)
    progress.update(0.1)
    cancelled = True
    with pytest.raises(CancelledError, match="cancelled"):
        progress.part(0.5, 1).update(0.2)
    with pytest.raises(CancelledError):
        progress.check()
    assert seen == [0.1]


def test_silent_progress_never_stops() -> None:
    SILENT.check()
    SILENT.part(0, 0.5).update(1.0, "unheard")
