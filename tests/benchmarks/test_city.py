"""The suite of cities: every setting counts on its own, and refused seeds count as not within."""

from __future__ import annotations

import math

import pytest
from benchmark_outcomes import outcome

from benchmarks import city
from benchmarks.accuracy import CORRECT, REFUSED, SILENTLY_WRONG
from benchmarks.city import SETTINGS, Setting

NAME = "wanted"


@pytest.fixture(autouse=True)
def wanted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(SETTINGS, NAME, Setting({}, 1.0, 0.8))


def test_views_are_those_of_the_issue_and_differ() -> None:
    views = [dict(city.city(seed).further) for seed in range(1, 21)]
    assert all(35 <= view["incidence"] <= 47 for view in views)
    assert all(5 <= view["off_nadir"] <= 25 for view in views)
    assert len({view["view_azimuth"] for view in views}) == 20
    assert {view["orbit"] for view in views} == {"ascending", "descending"}
    assert city.city(3) == city.city(3)


@pytest.mark.parametrize(
    ("errors", "expected"),
    [
        ([0.5, 0.6, 0.7, 0.8, 0.9], [True, True, True]),
        ([0.5, 0.6, 0.7, 0.8, math.nan], [True, True, True]),
        ([0.5, 0.6, 0.7, math.nan, math.nan], [True, False, True]),
        ([0.5, 1.1, 1.2, 1.3, 0.6], [False, False, True]),
        ([0.5, 0.6, 0.7, 0.8, 5.0], [True, True, False]),
    ],
)
def test_goals(errors: list[float], expected: list[bool]) -> None:
    outcomes = [
        outcome(
            group=NAME,
            error_px=error,
            verdict=REFUSED if math.isnan(error) else SILENTLY_WRONG if error > 3 else CORRECT,
        )
        for error in errors
    ]
    assert [goal.reached for goal in city.goals(NAME, outcomes)] == expected


def test_settings_without_goals_are_reported() -> None:
    found = city.goals("NMI", [outcome(error_px=2.0)])
    assert [goal.reached for goal in found] == [None, None, True]


def test_nothing_accepted() -> None:
    refused = [outcome(group=NAME, verdict=REFUSED, error_px=math.nan)]
    assert city.ground_table({NAME: refused}).rows == [[NAME, "nan", "0%", "1", "0", "1"]]
    assert [goal.reached for goal in city.goals(NAME, refused)] == [False, False, True]
