"""Which pairs are registered, where registrations are made up: no pixel is read."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import CancelledError as FutureCancelledError
from concurrent.futures import Executor, Future
from dataclasses import dataclass, replace
from typing import Any

import pytest
from series_dates import FRAME
from shapely.geometry import box

from groundtie.context import Context
from groundtie.errors import SchedulerError, WorkerLostError
from groundtie.series import registering
from groundtie.series.dates import footprint_shares
from groundtie.series.pairs import PairResult, PairTask, Settings, pair_key
from groundtie.series.registering import Matching

SETTINGS = Settings("auto", 3.0, None, None)
ZERO = (0.0,) * 6
PRECISE = tuple(tuple(1e-4 * (i == j) for j in range(6)) for i in range(6))
IMPRECISE = tuple(tuple(0.1 * (i == j) for j in range(6)) for i in range(6))
WHOLE = (0, 0, 10, 10)


@dataclass(frozen=True)
class FakeDate:
    name: str

    @property
    def key(self) -> str:
        return self.name


Make = Callable[..., Matching]


@pytest.fixture
def matching(monkeypatch: pytest.MonkeyPatch, one_thread: Context) -> Make:
    """Return what makes the matching of dates, some of which match only some others."""

    def make(
        count: int,
        bad: tuple[int, ...] = (),
        unlike: tuple[tuple[int, int], ...] = (),
        boxes: dict[int, tuple[int, ...]] | None = None,
        known: dict[str, PairResult] | None = None,
        off_px: dict[tuple[int, int], float] | None = None,
        far: tuple[tuple[int, int], ...] = (),
        imprecise: tuple[tuple[int, int], ...] = (),
    ) -> Matching:
        dates: list[Any] = [FakeDate(str(k)) for k in range(count)]

        def register(task: Any, *_: Any) -> PairResult:
            first, second = task.first, task.second
            ends = int(first.name), int(second.name)
            accepted = not set(bad) & set(ends) and not {ends, ends[::-1]} & set(unlike)
            key = pair_key(first, second, task.settings, FRAME)
            names, placed = (first.name, second.name), task.settings.is_placed
            if not accepted or (placed and ends in far):
                return PairResult(*names, key, False, "a rule", "no", is_placed=placed)
            moved = ((off_px or {}).get(ends, 0.0), *ZERO[1:])
            covariance = IMPRECISE if ends in imprecise else PRECISE
            return PairResult(
                *names, key, True, "", "yes", 0.3, moved, covariance, is_placed=placed
            )

        monkeypatch.setattr(registering, "register_pair", register)
        polygons = [box(*(boxes or {}).get(k, WHOLE)) for k in range(count)]
        shares = footprint_shares(polygons)
        return Matching(
            dates, shares, FRAME, SETTINGS, known or {}, one_thread, None, lambda _: None
        )

    return make


def test_every_date_with_the_hub_and_in_a_loop(matching: Make) -> None:
    found = matching(6)
    found.from_hub(0)
    # Of five dates two pairs, and the last with its neighbour.
    assert set(found.results) == {
        (0, 1), (0, 2), (0, 3), (0, 4), (0, 5), (1, 2), (3, 4), (4, 5)
    }  # fmt: skip
    assert found.done == 8


def test_only_links_that_close_loops_of_accepted_ones_are_matched_where_the_hub_has_them(
    matching: Make,
) -> None:
    found = matching(6, unlike=((0, 3),))
    found.from_hub(0)
    # 3, which 0 refused, is placed by its neighbours; the others are placed by 0.
    assert {ends for ends, one in found.results.items() if one.is_placed} == {(1, 2), (4, 5)}
    assert {(2, 3), (3, 4)} <= found.results.keys()


@pytest.mark.parametrize("wrong", [(0, 2), (1, 2)])
def test_a_loop_that_does_not_close_gets_further_links(
    matching: Make, wrong: tuple[int, int]
) -> None:
    sound = matching(7)
    sound.from_hub(0)
    found = matching(7, off_px={wrong: 5.0})
    found.from_hub(0)
    further = set(found.results) - set(sound.results)
    # With every date that one of the loop was not yet linked with, but no more than are near.
    assert further and all({1, 2} & set(ends) for ends in further)
    assert all(found.results[ends].is_placed != (0 in ends) for ends in further)


def test_a_date_whose_links_are_imprecise_gets_further_ones(matching: Make) -> None:
    sound = matching(8)
    sound.from_hub(0)
    found = matching(8, imprecise=((0, 3), (3, 4)))
    found.from_hub(0)
    further = set(found.results) - set(sound.results)
    # Of the three next in time, it was linked with 4 already.
    assert further == {(2, 3), (1, 3)}


def test_what_is_refused_where_the_hub_has_it_is_searched_for(matching: Make) -> None:
    found = matching(5, far=((1, 2),))
    found.from_hub(0)
    assert {ends for ends, one in found.results.items() if one.is_placed} == {(3, 4)}
    assert found.results[1, 2].accepted
    # Six pairs, one of them twice.
    assert (len(found.results), found.done) == (6, 7)


def test_a_link_that_was_placed_places_no_date_later(matching: Make) -> None:
    first = matching(3)
    first.from_hub(0)
    assert first.results[1, 2].is_placed
    known = {one.key: one for one in first.results.values()}
    again = matching(3, unlike=((0, 2),), known={first.results[1, 2].key: first.results[1, 2]})
    again.from_hub(0)
    assert not again.results[1, 2].is_placed and (2, 1) not in again.results
    # As another's loop it is still good for nothing to be done again.
    unchanged = matching(3, known=known)
    unchanged.from_hub(0)
    assert (unchanged.done, unchanged.reused) == (0, 3)


class Losing(Executor):
    """Runs tasks here, but is lost with those of some pairs."""

    def __init__(self, lost: set[tuple[str, str]], error: Exception) -> None:
        self._lost, self._error = lost, error

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        result = fn(*args, **kwargs)
        if (result.first, result.second) in self._lost:
            future.set_exception(self._error)
        else:
            future.set_result(result)
        return future


def test_a_worker_that_is_lost_costs_its_pair_alone(
    matching: Make, one_thread: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    def elsewhere(task: PairTask) -> Callable[[], PairResult]:
        return lambda: registering.register_pair(task, one_thread)

    monkeypatch.setattr(PairTask, "elsewhere", elsewhere)
    found = matching(5)
    found.executor = Losing({("0", "2")}, WorkerLostError("its process was ended"))
    found.from_hub(0)
    lost = found.results[0, 2]
    assert (lost.accepted, lost.reason, lost.key) == (False, "its process was ended", "")
    # Others reach its date by two ways, and all other pairs are there.
    assert sorted(found.placed(0)) == list(range(5))
    assert sum(2 in ends and one.accepted for ends, one in found.results.items()) >= 2
    # It alone is done again.
    again = matching(5, known={one.key: one for one in found.results.values()})
    again.from_hub(0)
    assert again.results[0, 2].accepted and again.done == 1
    # Without a scheduler there is nobody left who could reach them.
    gone = matching(5)
    gone.executor = Losing({("0", "2")}, FutureCancelledError())
    with pytest.raises(SchedulerError, match="the scheduler was lost"):
        gone.from_hub(0)


def test_a_bad_date_is_skipped_in_the_chain(matching: Make) -> None:
    found = matching(5, bad=(2,))
    found.from_hub(0)
    accepted = {ends for ends, one in found.results.items() if one.accepted}
    assert accepted == {(0, 1), (0, 3), (0, 4), (1, 3), (3, 4)}
    assert sum(2 in ends for ends in found.results) <= 1 + 3
    assert sorted(found.placed(0)) == [0, 1, 3, 4]


def test_a_date_that_the_hub_refuses_is_reached_by_two_others(matching: Make) -> None:
    found = matching(6, unlike=((0, 3),))
    found.from_hub(0)
    own = {ends for ends, one in found.results.items() if 3 in ends and one.accepted}
    assert len(own) >= 2


def test_all_neighbours_are_linked_where_the_hub_refuses_a_date(matching: Make) -> None:
    found = matching(7, unlike=((0, 4), (0, 5)))
    found.from_hub(0)
    assert {(date, date + 1) for date in range(1, 6)} <= set(found.results) | {
        ends[::-1] for ends in found.results
    }


def test_a_chain_of_dates_that_the_hub_refuses_is_followed(matching: Make) -> None:
    """As from summer to winter: each resembles the next alone."""
    unlike = tuple((a, b) for a in range(6) for b in range(a + 2, 6))
    found = matching(6, unlike=unlike)
    found.from_hub(0)
    assert sorted(found.placed(0)) == list(range(6))


def test_dates_that_do_not_overlap_are_not_tried(matching: Make) -> None:
    found = matching(3, boxes={2: (100, 100, 110, 110)})
    found.from_hub(0)
    assert set(found.results) == {(0, 1)}
    assert found.shares[frozenset((0, 1))] == pytest.approx(1.0)


def test_shares_are_of_the_smaller_footprint(matching: Make) -> None:
    found = matching(3, boxes={1: (5, 0, 10, 10), 2: (9, 0, 19, 10)})
    assert found.shares[frozenset((0, 1))] == pytest.approx(1.0)
    assert found.shares[frozenset((2, 0))] == pytest.approx(0.1)


def test_the_best_overlap_beside_the_next_in_time(matching: Make) -> None:
    found = matching(4, boxes={1: (0, 0, 5, 10), 2: (4, 0, 10, 10), 3: (0, 0, 5, 10)})
    found.from_hub(0)
    assert {(1, 2), (1, 3)} <= set(found.results)


def test_without_a_reference_a_bad_hub_is_given_up(matching: Make) -> None:
    found = matching(7, bad=(3,))
    hub = found.freely()
    assert hub != 3
    assert sorted(found.placed(hub)) == [0, 1, 2, 4, 5, 6]


def test_without_a_reference_nothing_may_match(matching: Make) -> None:
    found = matching(4, bad=(0, 1, 2, 3))
    assert found.placed(found.freely()).keys() <= {0, 1, 2, 3}
    assert not found.links


def test_what_is_known_has_the_present_names_of_its_dates(matching: Make) -> None:
    first = matching(3)
    first.from_hub(0)
    known = {one.key: replace(one, first="a", second="b") for one in first.results.values()}
    again = matching(3, known=known)
    names = {ends: (one.first, one.second) for ends, one in again.results.items()}
    assert names == {(i, j): (str(i), str(j)) for i, j in first.results}


def test_what_is_known_is_not_registered_again(matching: Make) -> None:
    first = matching(4)
    first.from_hub(0)
    known = {one.key: one for one in first.results.values()}
    again = matching(4, known=known)
    again.from_hub(0)
    assert (again.done, again.reused) == (0, len(known))
    more = matching(5, known=known)
    more.from_hub(0)
    assert set(more.results) - set(first.results) == {(0, 4), (3, 4)}
    assert more.done == 2


@pytest.mark.parametrize("is_first_placed", [True, False])
def test_a_pair_that_is_known_both_ways_is_one_registration(
    matching: Make, is_first_placed: bool
) -> None:
    """One hub's loop is another hub's registration: it does not confirm itself."""
    ways = {}
    for ends, placed in (((0, 1), is_first_placed), ((1, 0), not is_first_placed)):
        settings = SETTINGS.of_loops() if placed else SETTINGS
        dates: list[Any] = [FakeDate(str(k)) for k in ends]
        key = pair_key(*dates, settings, FRAME)
        names = [date.name for date in dates]
        ways[key] = PairResult(*names, key, True, "", "yes", 0.3, ZERO, PRECISE, is_placed=placed)
    (found,) = matching(2, known=ways).results.values()
    assert not found.is_placed, "the registration by all rules counts"
