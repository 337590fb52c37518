"""Which pairs of a series are registered, in which order, and what comes of their network."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..context import Context
from .dates import Date, Footprints
from .frame import FloatArray, SeriesFrame
from .network import Link
from .pairs import PairResult, Settings, pair_key, register_pair

# Footprints that have less in common are not worth matching: as many chips as a small scene has do
# not fit in.
_LEAST_SHARE = 0.1

# A date that the next one in time overlaps less than another by this is matched with that, too.
_MUCH_MORE = 0.2

# How many dates are tried until one reaches a date that the hub does not, and how many links each
# date should have: two make a loop.
_MOST_TRIES = 3
_WANTED_LINKS = 2

# Without a reference the first hub may be under clouds: as many are tried.
_MOST_HUBS = 3


@dataclass
class Matching:
    """The registrations of a series, done as they are needed.

    Parameters
    ----------
    dates
        The dates, in the order of their times.
    footprints
        Theirs.
    frame, settings
        See `register_pair`.
    known
        Registrations of earlier runs, by their keys.
    context
        Threads and progress.
    """

    dates: Sequence[Date]
    footprints: Footprints
    frame: SeriesFrame
    settings: Settings
    known: Mapping[str, PairResult]
    context: Context
    results: dict[tuple[int, int], PairResult] = field(default_factory=dict)
    done: int = 0
    reused: int = 0

    def __post_init__(self) -> None:
        count = len(self.dates)
        for i in range(count):
            for j in range(count):
                key = pair_key(self.dates[i], self.dates[j], self.settings, self.frame)
                if i != j and key in self.known:
                    self.results[i, j] = self.known[key]
                    self.reused += 1

    @property
    def links(self) -> list[Link]:
        """All registrations that were accepted."""
        return [result.link(*ends) for ends, result in self.results.items() if result.accepted]

    def from_hub(self, hub: int) -> None:
        """Register all dates to one, reach the others by their neighbours, and close loops."""
        others = [date for date in range(len(self.dates)) if date != hub]
        for date in others:
            self._attempt(hub, date, hub)
        self._reach(others, hub)
        placed = self.placed(hub)
        chain = [date for date in range(len(self.dates)) if date in placed]
        for first, second in self._neighbours(chain):
            self._attempt(first, second, hub)
        for date in chain:
            for other in self._nearest(date, self.placed(hub)):
                if self._degree(date) >= _WANTED_LINKS or date == hub:
                    break
                self._attempt(other, date, hub)

    def freely(self) -> int:
        """Register as `from_hub` from the best of several dates, and return it."""
        shares = [
            sum(self.footprints.share(i, j) for j in range(len(self.dates)))
            for i in range(len(self.dates))
        ]
        middle = (len(self.dates) - 1) / 2
        order = sorted(
            range(len(self.dates)), key=lambda i: (-round(shares[i], 1), abs(i - middle))
        )
        tried: list[int] = []
        for hub in order:
            reached = set().union(*(self.placed(one) for one in tried))
            if len(tried) == _MOST_HUBS or len(reached) > len(self.dates) / 2:
                break
            if hub not in reached or not tried:
                self.from_hub(hub)
                tried.append(hub)
        best = max(tried, key=lambda one: len(self.placed(one)))
        return max(sorted(self.placed(best)), key=self._degree)

    def placed(self, hub: int) -> dict[int, FloatArray]:
        """Return the displacements of the dates that links reach from a hub, by the first way."""
        found: dict[int, FloatArray] = {hub: np.zeros(6)}
        links, frame = self.links, self.frame
        grew = True
        while grew:
            grew = False
            for link in links:
                for start, end, sign in (
                    (link.first, link.second, 1),
                    (link.second, link.first, -1),
                ):
                    if start in found and end not in found:
                        between = np.linalg.matrix_power(frame.matrix(link.displacement), sign)
                        found[end] = frame.of_matrix(between @ frame.matrix(found[start]))
                        grew = True
        return found

    def _reach(self, others: Sequence[int], hub: int) -> None:
        """Try to reach dates that the hub does not, from those that are reached, nearest first."""
        grew = True
        while grew:
            grew = False
            for date in others:
                placed = self.placed(hub)
                if date in placed:
                    continue
                for other in self._nearest(date, placed)[:_MOST_TRIES]:
                    if self._attempt(other, date, hub):
                        grew = True
                        break

    def _attempt(self, first: int, second: int, hub: int) -> bool:
        """Register a pair unless that was done; return whether it is linked."""
        for ends in ((first, second), (second, first)):
            if ends in self.results:
                return self.results[ends].accepted
        if self.footprints.share(first, second) < _LEAST_SHARE:
            return False
        names = self.dates[first].name, self.dates[second].name
        expected = max(2 * len(self.dates) - 2, self.done + 1)
        self.context.update(self.done / expected, f"registering {names[1]} to {names[0]}")
        part = self.context.part(self.done / expected, (self.done + 1) / expected)
        placed = self.placed(hub)
        result = register_pair(
            self.dates[first],
            self.dates[second],
            (placed.get(first), placed.get(second)),
            self.settings,
            self.frame,
            part,
        )
        self.results[first, second] = result
        self.done += 1
        return result.accepted

    def _neighbours(self, chain: Sequence[int]) -> list[tuple[int, int]]:
        """Return for each date the next in time, and another one if they overlap much more."""
        pairs = []
        for number, date in enumerate(chain[:-1]):
            following = chain[number + 1]
            pairs.append((date, following))
            share = self.footprints.share(date, following)
            best = max(chain[number + 1 :], key=lambda other: self.footprints.share(date, other))
            if self.footprints.share(date, best) > share + _MUCH_MORE:
                pairs.append((date, best))
        return pairs

    def _nearest(self, date: int, among: Iterable[int]) -> list[int]:
        """Return dates, those of the best overlap and nearest in time first."""
        return sorted(
            (other for other in among if other != date),
            key=lambda other: (-round(self.footprints.share(date, other), 1), abs(other - date)),
        )

    def _degree(self, date: int) -> int:
        return sum(date in ends for ends, result in self.results.items() if result.accepted)
