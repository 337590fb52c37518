"""The suite of peaks: pairs that hide their truth where it says, and goals that can be missed."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from textured_pairs import texture

from benchmarks import peaks
from benchmarks.peaks import (
    RADIUS_PX,
    SEARCHES,
    SHARES,
    Aligned,
    bins_goal,
    block_mean,
    climbs_goals,
    counting_goal,
    exhaustive_peak,
    is_true,
    masks_goals,
    masks_table,
    measure_bins,
    measure_masks,
    peak_of,
    time_counting,
)
from groundtie.rasters.patch import Patch

SIDE = 170


def aligned(shift: tuple[int, int] = (0, 0)) -> Aligned:
    """Return a pair of opposite contrast whose truth is off by a shift (right, down)."""
    ground = texture(SIDE + 20, SIDE + 20)
    x, y = shift
    own = ground[10 : 10 + SIDE, 10 : 10 + SIDE]
    other = ground[10 - y : 10 - y + SIDE, 10 - x : 10 - x + SIDE]
    everywhere = np.ones((SIDE, SIDE), bool)
    return Aligned(
        "texture",
        1.0,
        Patch((1000 + 200 * own).astype(np.float32), everywhere),
        Patch((2000 - 300 * other).astype(np.float32), everywhere),
    )


@pytest.mark.parametrize("shift", [(0, 0), (5, -3)])
@pytest.mark.parametrize("centre", [(0, 0), (7, -4)])
def test_the_peak_is_where_the_content_lies(
    shift: tuple[int, int], centre: tuple[int, int]
) -> None:
    windows = aligned(shift).windows(centre, RADIUS_PX)
    assert exhaustive_peak(*windows) == (shift[0] - centre[0], shift[1] - centre[1])


def test_the_highest_value_is_the_peak() -> None:
    surface = np.zeros((9, 9), np.float32)
    surface[1, 6] = 1
    assert peak_of(surface) == (2, -3)
    assert is_true((2, -3), 3.0)
    assert not is_true((2, -3), 1.0)


@pytest.mark.slow
def test_every_number_of_bins_finds_the_peak(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(peaks, "BIN_COUNTS", (16, 32))
    records = measure_bins(aligned((4, -2)))
    assert {record["peak"] for record in records} == {(4, -2)}
    goal = bins_goal(records)
    assert (goal.found, goal.reached) == ("0 of 6", False)
    assert bins_goal(measure_bins(aligned())).reached


def test_blocks_hold_their_mean() -> None:
    values = np.arange(48, dtype=np.float32).reshape(6, 8)
    found = block_mean(values)
    assert found.shape == values.shape
    np.testing.assert_allclose(found[:4, :4], values[:4, :4].mean())
    np.testing.assert_allclose(found[:4, 4:], values[:4, 4:].mean())


@pytest.mark.slow
def test_masks_that_say_nothing_false_leave_the_peak(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(peaks, "SHARES", (0.3,))
    records = measure_masks(aligned((3, 1)))
    assert {record["peak"] for record in records} == {(3, 1)}
    assert {record["moved_px"] for record in records} == {0}
    assert all(goal.reached for goal in masks_goals(records))


def masked(moved: dict[float, int]) -> list[dict[str, Any]]:
    """Return the records of a pair whose peak moves under masks of some shares."""
    return [
        {
            "pair": "one",
            "by": by,
            "surface": surface,
            "share": share,
            "moved_px": moved.get(share, 0),
            "peak": (moved.get(share, 0), 0),
        }
        for by in ("pixels", "blocks")
        for surface in ("cubic", "without trend")
        for share in (0.0, *SHARES)
    ]


@pytest.mark.parametrize(("share", "reached"), [(0.4, False), (0.7, False), (0.8, True)])
def test_one_mask_that_moves_the_peak_misses_the_goal(share: float, reached: bool) -> None:
    records = masked({share: 2})
    assert {goal.reached for goal in masks_goals(records)} == {reached}
    assert "(2, 0)" in masks_table(records).rows[0]


@pytest.mark.parametrize(("worst", "reached"), [(90, True), (89, False)])
def test_the_worst_pair_decides_on_climbs(worst: int, reached: bool) -> None:
    records = [
        {"pair": pair, "search": search, "runs": 100, "reached": found, "evaluations": 10.0}
        for pair, found in (("a", 100), ("b", worst))
        for search in SEARCHES
    ]
    assert [goal.reached for goal in climbs_goals(records)] == [reached, *[None] * 4]


def test_counting_by_fft_counts_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(peaks, "WINDOW_RADIUS_PX", 5)
    record = time_counting(40)
    assert record["same"]
    assert counting_goal(record).reached is None
    full = {"size_px": peaks.WINDOW_PX, "seconds": 1.0, "direct_seconds": 3.5}
    assert counting_goal({**full, "same": True}).reached
    assert not counting_goal({**full, "same": False}).reached
    assert not counting_goal({**full, "direct_seconds": 2.5, "same": True}).reached
