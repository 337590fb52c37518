"""Who is left out, by networks whose registrations are made up."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from series_dates import FRAME, link, shifted, star_and_chain

from groundtie.series.pairs import PairResult
from groundtie.series.settling import Settled, settle

RNG = np.random.default_rng(2)
Ends = tuple[int, int]


def results(
    count: int,
    pairs: list[Ends],
    wrong: Mapping[Ends, tuple[float, float]] | None = None,
    refused: tuple[Ends, ...] = (),
) -> dict[Ends, PairResult]:
    """Return registrations of dates with random displacements, some wrong by so much."""
    true = np.array([shifted(*RNG.uniform(-9, 9, 2)) for _ in range(count)])
    found = {}
    for first, second in [*pairs, *refused]:
        error = shifted(*RNG.normal(0, 0.03, 2))
        error += shifted(*(wrong or {}).get((first, second), (0.0, 0.0)))
        made = link(first, second, true, 0.05, error)
        is_accepted = (first, second) not in refused
        found[first, second] = PairResult(
            str(first),
            str(second),
            "",
            is_accepted,
            "" if is_accepted else "chance agreement",
            "" if is_accepted else "nothing in common was found",
            0.4,
            tuple(made.displacement),
            tuple(map(tuple, made.covariance)),
        )
    return found


def rules(settled: Settled) -> dict[int, str]:
    """Return the rules by which dates are left out."""
    return {date: one.rule for date, one in enumerate(settled.verdicts) if not one.accepted}


def settled(found: dict[Ends, PairResult], count: int) -> Settled:
    return settle(FRAME, found, count, 0, is_free=False)


def test_a_sound_network_keeps_all() -> None:
    found = settled(results(6, star_and_chain(6)), 6)
    assert rules(found) == {} and found.rejected == ()
    assert len(found.closures) == 4 and all(one.is_closed for one in found.closures)


@pytest.mark.parametrize("wrong", [(0, 2), (2, 3)])
def test_one_wrong_registration_costs_no_date(wrong: Ends) -> None:
    found = settled(results(6, star_and_chain(6), {wrong: (4.0, -3.0)}), 6)
    assert rules(found) == {}
    assert found.rejected == (wrong,)
    assert found.open_closures and all(one.is_closed for one in found.closures)


def test_a_triangle_that_does_not_close_costs_both_dates() -> None:
    found = settled(results(3, star_and_chain(3), {(1, 2): (4.0, -3.0)}), 3)
    assert rules(found) == {1: "loops do not close", 2: "loops do not close"}


def test_a_date_at_the_end_that_nothing_confirms() -> None:
    """Of its two registrations one is wrong: its neighbour has another loop, it has none."""
    found = settled(results(5, star_and_chain(5), {(0, 4): (4.0, -3.0)}), 5)
    assert rules(found) == {4: "loops do not close"}


def test_a_date_that_the_hub_hardly_overlaps_is_not_refused_by_it() -> None:
    found = results(3, [(0, 1), (1, 2)], refused=((0, 2),))
    assert rules(settled(found, 3)) == {2: "one way alone"}
    reason = "they overlap by 40 × 300 matching pixels; at least 144 × 144 are needed"
    found[0, 2] = replace(found[0, 2], rule="", reason=reason)
    assert rules(settled(found, 3)) == {}


def test_a_date_that_the_hub_refuses_needs_a_second_way() -> None:
    star = [(0, 1), (0, 2), (0, 3), (1, 2), (2, 3)]
    once = settled(results(5, [*star, (3, 4)], refused=((0, 4),)), 5)
    assert rules(once) == {4: "one way alone"}
    twice = settled(results(5, [*star, (3, 4), (2, 4)], refused=((0, 4),)), 5)
    assert rules(twice) == {}
    assert "reached by other dates" in twice.verdicts[4].reason


def test_dates_that_nothing_reaches_are_named_with_why() -> None:
    found = settled(results(4, [(0, 1)], refused=((0, 2), (1, 2))), 4)
    assert rules(found) == {2: "date not linked", 3: "date not linked"}
    assert "nothing in common was found (2 of 2)" in found.verdicts[2].reason
    assert "overlaps no other date" in found.verdicts[3].reason


def test_who_hangs_on_a_date_that_is_left_out_is_left_out() -> None:
    found = settled(results(4, [(0, 1), (1, 2), (0, 2), (2, 3)], {(1, 2): (5.0, 0.0)}), 4)
    assert set(rules(found)) == {1, 2, 3}


def test_a_pair_without_any_loop_is_believed() -> None:
    found = settled(results(2, [(0, 1)]), 2)
    assert rules(found) == {}
    assert found.verdicts[1].reason == "1 registration, in no loop"


@pytest.mark.parametrize(("count", "is_confirmed"), [(2, False), (3, True)])
def test_the_date_in_the_middle_is_confirmed_by_loops_alone(count: int, is_confirmed: bool) -> None:
    """Without a reference, it is a date like any other: two dates have no loop."""
    found = settle(FRAME, results(count, star_and_chain(count)), count, 0, is_free=True)
    ending = "confirmed by loops" if is_confirmed else "in no loop"
    for one in found.verdicts:
        assert one.accepted and one.evidence.is_confirmed == is_confirmed
        assert one.reason.endswith(ending)
