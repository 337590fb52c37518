"""The suite of margins: which rules refuse what alone."""

from __future__ import annotations

import math

from benchmarks.margins import STATISTICS, Margins, rules_table


def test_rules_are_counted_with_and_without_others() -> None:
    found = [
        of("wrong", False, "a", "b"),
        of("also wrong", False, "a"),
        of("right but refused", True, "b"),
        of("right", True),
    ]
    assert rules_table(found).rows == [["a", "2", "1", "0", "0"], ["b", "1", "0", "1", "1"]]


def of(name: str, is_right: bool, *rules: str) -> Margins:
    return Margins(name, 0.5 if is_right else 9.0, is_right, rules, (math.nan,) * len(STATISTICS))
