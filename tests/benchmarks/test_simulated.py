from __future__ import annotations

from collections import Counter
from pathlib import Path

from benchmarks import simulated
from benchmarks.accuracy import SILENTLY_WRONG
from benchmarks.attempt import Try
from benchmarks.sar_pairs import SarPair
from benchmarks.simulated import OPPOSITE, REBUILT_PERCENT, SimulatedCase, changes, rebuilt


def test_towns_and_cities_are_rebuilt_by_every_share(tmp_path: Path) -> None:
    cases = [case for case in changes(range(1, 3), tmp_path) if isinstance(case, SimulatedCase)]
    wanted = {rebuilt(d, p): 2 for d in ("suburban", "city") for p in REBUILT_PERCENT}
    assert Counter(case.group for case in cases) == {**wanted, OPPOSITE: 2}
    for case in cases:
        if isinstance(case.simulation, SarPair):
            assert case.simulation.opposite
        else:
            share = dict(case.simulation.further)["changed"]
            assert case.group == rebuilt(case.simulation.density, float(share))


def test_changes_are_reported_and_must_not_be_silently_wrong() -> None:
    outcomes = [Try(None, SILENTLY_WRONG, "accepted", 1.0).unregistered("a", OPPOSITE, 0.0)]
    goals = simulated.goals(OPPOSITE, outcomes)
    assert [goal.reached for goal in goals] == [None, None, False]
