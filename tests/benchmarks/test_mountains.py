"""The suite of mountains: heights are given where they are asked for, and goals are the issue's."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from benchmark_outcomes import outcome

from benchmarks import mountains
from benchmarks.accuracy import CORRECT, REFUSED, SILENTLY_WRONG
from benchmarks.attempt import Pair
from benchmarks.mountains import DISPLACED, ELSEWHERE, LIT, NEEDLESS, WITH, WITHOUT


def test_only_what_is_needless_was_made_with_right_heights() -> None:
    errors = {
        way: dict(mountains.mountain("hilly", "SAR", way, 1).further)["terrain_error"]
        for way in mountains.WAYS
    }
    right = {NEEDLESS: 0.0, LIT: 0.0, ELSEWHERE: 0.0}
    assert errors == {WITHOUT: 30.0, WITH: 30.0, DISPLACED: 30.0, **right}
    assert mountains.mountain("hilly", "SAR", WITH, 1) == mountains.mountain(
        "hilly", "SAR", WITHOUT, 1
    )


def test_heights_that_are_given() -> None:
    pair = Pair(Path("a/reference.tif"), Path("a/input.tif"))
    dem, taken = Path("a/dem.tif"), Path("a/input_dem.tif")
    assert mountains.further(pair, "SAR", WITHOUT) == {}
    assert mountains.further(pair, "SAR", WITH) == {"dem": dem, "input_dem": taken}
    assert mountains.further(pair, "SAR", NEEDLESS) == {"dem": dem, "input_dem": None}
    assert mountains.further(pair, "SAR", LIT) == {"views": "terrain radar"}
    assert mountains.further(pair, "SAR", DISPLACED) == {"views": "terrain radar"}
    assert mountains.further(pair, "optical", ELSEWHERE) == {"views": "terrain sun"}


@pytest.mark.parametrize(
    ("country", "way", "errors", "expected"),
    [
        ("flat", WITH, [0.9, 1.0], [True, True]),
        ("flat", WITH, [0.9, 1.2], [False, True]),
        ("mountains", WITH, [1.7, 1.8], [True, True]),
        ("mountains", WITH, [1.7, math.nan], [True, True]),
        ("mountains", WITH, [math.nan], [False, True]),
        ("mountains", WITH, [5.0, 0.1], [False, False]),
        ("mountains", WITHOUT, [2.9], [None, True]),
        ("hilly", LIT, [0.9], [True, True]),
        ("hilly", LIT, [1.1], [False, True]),
        ("flat", LIT, [0.1], [False]),
        ("flat", LIT, [math.nan], [True]),
        ("hilly", ELSEWHERE, [math.nan], [True]),
        ("mountains", DISPLACED, [2.0], [None, True]),
        ("mountains", DISPLACED, [5.0], [None, False]),
    ],
)
def test_goals(country: str, way: str, errors: list[float], expected: list[bool | None]) -> None:
    outcomes = [
        outcome(
            error_px=error,
            verdict=REFUSED if math.isnan(error) else SILENTLY_WRONG if error > 3 else CORRECT,
        )
        for error in errors
    ]
    found = mountains.goals(country, "SAR", way, outcomes)
    assert [goal.reached for goal in found] == expected


def test_models_are_counted() -> None:
    groups = {
        "a": [outcome(model="terrain"), outcome(model="terrain"), outcome(model="affine")],
        "b": [outcome(verdict=REFUSED, model="")],
    }
    table = mountains.models_table(groups)
    assert list(table.head) == ["pairs", "affine", "terrain"]
    assert table.rows == [["a", "1", "2"], ["b", "0", "0"]]
