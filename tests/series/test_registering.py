"""Which pairs are registered, where registrations are made up: no pixel is read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest
from series_dates import FRAME
from shapely.geometry import box

from groundtie.context import Context
from groundtie.series import registering
from groundtie.series.dates import Footprints
from groundtie.series.pairs import PairResult, Settings, pair_key
from groundtie.series.registering import Matching

SETTINGS = Settings("auto", 3.0, None, None)
ZERO = (0.0,) * 6
COVARIANCE = tuple(tuple(0.01 * (i == j) for j in range(6)) for i in range(6))
WHOLE = (0, 0, 10, 10)


@dataclass(frozen=True)
class FakeDate:
    name: str
    band: None = None

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
    ) -> Matching:
        dates: list[Any] = [FakeDate(str(k)) for k in range(count)]

        def register(task: Any, *_: Any) -> PairResult:
            first, second = task.first, task.second
            ends = int(first.name), int(second.name)
            accepted = not set(bad) & set(ends) and not {ends, ends[::-1]} & set(unlike)
            key = pair_key(first, second, SETTINGS, FRAME)
            if not accepted:
                return PairResult(first.name, second.name, key, False, "a rule", "no")
            return PairResult(first.name, second.name, key, True, "", "yes", 0.3, ZERO, COVARIANCE)

        monkeypatch.setattr(registering, "register_pair", register)
        polygons = [box(*(boxes or {}).get(k, WHOLE)) for k in range(count)]
        footprints = Footprints(tuple(polygons))
        return Matching(dates, footprints, FRAME, SETTINGS, known or {}, one_thread)

    return make


def test_every_date_with_the_hub_and_with_the_next(matching: Make) -> None:
    found = matching(5)
    found.from_hub(0)
    assert set(found.results) == {
        (0, 1), (0, 2), (0, 3), (0, 4), (1, 2), (2, 3), (3, 4)
    }  # fmt: skip
    assert found.done == 7


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
    assert found.footprints.share(0, 1) == pytest.approx(1.0)


def test_shares_are_of_the_smaller_footprint(matching: Make) -> None:
    found = matching(3, boxes={1: (5, 0, 10, 10), 2: (9, 0, 19, 10)})
    assert found.footprints.share(0, 1) == pytest.approx(1.0)
    assert found.footprints.share(2, 0) == pytest.approx(0.1)


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
