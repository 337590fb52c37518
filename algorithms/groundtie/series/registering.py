"""Registering the pairs of a series: which pairs, and in which order."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor, wait
from dataclasses import dataclass, field, replace
from itertools import combinations, compress, product

import numpy as np

from ..context import Context
from ..errors import WorkerLostError
from ..executors import POLL_SECONDS, result_of
from ..memo import Memo
from ..memory import DESCRIBED_SHARE, share_bytes
from ..rasters.grid import FloatArray
from .closure import triplet_closures
from .dates import Date
from .frame import PARAMETERS, SeriesFrame
from .network import Link, adjust
from .pairs import PairResult, PairTask, Settings, pair_key, register_pair

# Smaller overlaps of footprints are not worth matching: they hold fewer chips than a small scene.
_LEAST_SHARE = 0.1

# A date is also matched with one that overlaps it by this much more than the next in time does.
_MUCH_MORE = 0.2

# Most dates that are tried, since any may be cloudy: to reach a date that the hub does not, to
# confirm a doubtful date, or as the hub without a reference.
_MOST_TRIES = 3

# Number of links that each date should have: two make a loop.
_WANTED_LINKS = 2


@dataclass
class Matching:
    """The registrations of a series, done as needed.

    Parameters
    ----------
    dates
        The dates, in the order of their times.
    shares
        Overlap of two dates as a share of the smaller footprint; see `footprint_shares`.
    frame, settings
        See `register_pair`.
    known
        Registrations of earlier runs, by their keys.
    context
        Threads and progress.
    executor
        Runs pairs, each as a task of files, instead of the context's threads; None: the threads do.
    keep
        Receives each registration as soon as it is done.
    results, done, reused
        Registrations by the numbers of their dates; how many were done, and how many taken over.
    hub
        The date that others are registered to at present.
    described
        Descriptors of the hub's chips, which all of its registrations need.
    """

    dates: Sequence[Date]
    shares: Mapping[frozenset[int], float]
    frame: SeriesFrame
    settings: Settings
    known: Mapping[str, PairResult]
    context: Context
    executor: Executor | None
    keep: Callable[[PairResult], None]
    results: dict[tuple[int, int], PairResult] = field(default_factory=dict)
    hub: int = 0
    described: Memo | None = None
    done: int = 0
    reused: int = 0

    def __post_init__(self) -> None:
        if not self.known:
            return
        for pair in combinations(range(len(self.dates)), 2):
            # Both directions may be known, as the hub changes: a pair is one registration.
            for settings, ends in product(
                (self.settings, self.settings.of_loops()), (pair, pair[::-1])
            ):
                first, second = (self.dates[date] for date in ends)
                key = pair_key(first, second, settings, self.frame)
                if key in self.known:
                    # The same files may have had other names.
                    known = replace(self.known[key], first=first.name, second=second.name)
                    self.results[ends] = known
                    self.reused += 1
                    break

    @property
    def links(self) -> list[Link]:
        """All registrations that were accepted."""
        return [result.link(*ends) for ends, result in self.results.items() if result.accepted]

    def from_hub(self, hub: int) -> None:
        """Register all dates to a hub, the others to their neighbours, and close loops."""
        self.hub, self.described = hub, Memo(share_bytes(DESCRIBED_SHARE))
        others = [date for date in range(len(self.dates)) if date != hub]
        self._attempt_all([(hub, date) for date in others])
        self._reach(others)
        reached = self.placed(hub)
        linked = [date for date in others if date in reached]
        if all(self._is_linked(hub, date) for date in linked):
            self._attempt_all(self._partners(linked))
        else:
            # Two links of a date may be a path through it to other dates, instead of a loop.
            self._attempt_all(self._neighbours(sorted(reached)))
        for date in linked:
            for other in self._nearest(date, reached):
                if self._degree(date) >= _WANTED_LINKS:
                    break
                self._attempt(other, date)
        self._attempt_all(self._further(linked))

    def freely(self) -> int:
        """Register as `from_hub` from several dates, and return the best hub."""
        count = len(self.dates)
        shares = [sum(self._share(i, j) for j in range(count)) for i in range(count)]
        middle = (count - 1) / 2
        order = sorted(range(count), key=lambda i: (-round(shares[i], 1), abs(i - middle)))
        tried: list[int] = []
        for hub in order:
            reached = set().union(*(self.placed(one) for one in tried))
            if len(tried) == _MOST_TRIES or len(reached) > count / 2:
                break
            if hub not in reached or not tried:
                self.from_hub(hub)
                tried.append(hub)
        best = max(tried, key=lambda one: len(self.placed(one)))
        return max(sorted(self.placed(best)), key=self._degree)

    def placed(self, hub: int) -> dict[int, FloatArray]:
        """Return the displacements of the dates that links reach from a hub, by the first path."""
        found: dict[int, FloatArray] = {hub: np.zeros(PARAMETERS)}
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

    def _reach(self, others: Sequence[int]) -> None:
        """Try to reach dates that the hub does not, from dates that are reached, nearest first."""
        grew = True
        while grew:
            grew = False
            for date in others:
                placed = self.placed(self.hub)
                if date not in placed:
                    nearest = self._nearest(date, placed)[:_MOST_TRIES]
                    grew |= any(self._attempt(other, date) for other in nearest)

    def _attempt(self, first: int, second: int) -> bool:
        """Register a pair unless it is done; return whether it is linked."""
        self._attempt_all([(first, second)])
        return self._is_linked(first, second)

    def _is_linked(self, first: int, second: int) -> bool:
        found = self._known(first, second)
        return found is not None and found.accepted

    def _known(self, first: int, second: int) -> PairResult | None:
        return self.results.get((first, second)) or self.results.get((second, first))

    def _attempt_all(self, pairs: Sequence[tuple[int, int]]) -> None:
        """Register pairs that are not done, from the present displacements of the dates.

        The results do not depend on each other: pairs may run in parallel.
        """
        worth = [ends for ends in pairs if self._share(*ends) >= _LEAST_SHARE]
        # A pair that is refused where the hub places its dates is done again, with a search.
        while asked := {frozenset(ends): ends for ends in worth if not self._is_done(ends)}:
            self._register(tuple(asked.values()))

    def _register(self, pairs: Sequence[tuple[int, int]]) -> None:
        """Register pairs, here or by the executor."""
        placed = self.placed(self.hub)
        tasks = {
            (first, second): PairTask(
                self.dates[first],
                self.dates[second],
                (placed.get(first), placed.get(second)),
                self._settings((first, second)),
                self.frame,
            )
            for first, second in pairs
        }
        if self.executor is None:
            for ends, task in tasks.items():
                part = self._next_part(f"registering {task.second.name} to {task.first.name}")
                memo = self.described if ends[0] == self.hub else None
                self._add(ends, register_pair(task, replace(part, memo=memo)))
            return
        futures = {ends: self.executor.submit(task.elsewhere()) for ends, task in tasks.items()}
        try:
            # In the order of the pairs, whichever ends first, as without an executor.
            for ends, future in futures.items():
                part = self._next_part(f"registering {len(tasks)} pairs")
                while wait([future], timeout=POLL_SECONDS).not_done:
                    part.progress.check()
                try:
                    self._add(ends, result_of(future))
                except WorkerLostError as error:
                    self._add(ends, tasks[ends].lost(error))
        finally:
            for future in futures.values():
                future.cancel()

    def _settings(self, ends: tuple[int, int]) -> Settings:
        """Return the settings of a pair.

        If both dates were registered to the hub by all rules, the pair places neither of them: it
        closes a loop, and the loop checks it.
        """
        found = self._known(*ends)
        is_refused = found is not None and not found.accepted
        links = [self._known(self.hub, date) for date in ends]
        are_placed = all(one is not None and one.accepted and not one.is_placed for one in links)
        return self.settings.of_loops() if are_placed and not is_refused else self.settings

    def _is_done(self, ends: tuple[int, int]) -> bool:
        found = self._known(*ends)
        return found is not None and (not found.is_placed or self._settings(ends).is_placed)

    def _next_part(self, message: str) -> Context:
        expected = max(2 * len(self.dates) - 2, self.done + 1)
        self.context.update(self.done / expected, message)
        return self.context.part(self.done / expected, (self.done + 1) / expected)

    def _add(self, ends: tuple[int, int], result: PairResult) -> None:
        self.results.pop(ends[::-1], None)
        self.results[ends] = result
        self.done += 1
        if result.key:  # empty: it failed for a passing reason
            self.keep(result)

    def _neighbours(self, chain: Sequence[int]) -> list[tuple[int, int]]:
        """Return pairs of each date with the next in time, and with one of much larger overlap."""
        pairs = []
        for number, date in enumerate(chain[:-1]):
            following = chain[number + 1]
            pairs.append((date, following))
            share = self._share(date, following)
            best = max(chain[number + 1 :], key=lambda other: self._share(date, other))
            if self._share(date, best) > share + _MUCH_MORE:
                pairs.append((date, best))
        return pairs

    def _partners(self, dates: Sequence[int]) -> list[tuple[int, int]]:
        """Return pairs of dates that lack links, each with the best of the remaining ones."""
        lacking = [date for date in dates if self._degree(date) < _WANTED_LINKS]
        pairs = []
        while lacking:
            date = lacking.pop(0)
            best = [
                other
                for other in self._nearest(date, lacking)
                if self._known(date, other) is None and self._share(date, other) >= _LEAST_SHARE
            ]
            if best:
                lacking.remove(best[0])
                pairs.append((date, best[0]))
        return pairs

    def _further(self, dates: Sequence[int]) -> list[tuple[int, int]]:
        """Return further pairs of doubtful dates.

        Their links are imprecise, or contradict others: further links show which are wrong.
        """
        links = self.links
        found = adjust(self.frame, links, len(self.dates), self.hub, is_free=False)
        closures = triplet_closures(self.frame, links, found.scatter_px)
        doubtful = set(np.flatnonzero(found.imprecise).tolist())
        doubtful |= {date for one in closures if not one.is_closed for date in one.dates}
        for link in compress(links, ~found.kept):
            doubtful |= {link.first, link.second}
        return [
            (other, date)
            for date in dates
            if date in doubtful
            for other in self._nearest(date, dates)[:_MOST_TRIES]
        ]

    def _nearest(self, date: int, among: Iterable[int]) -> list[int]:
        """Return dates in the order of their overlap, then of their distance in time."""
        return sorted(
            (other for other in among if other != date),
            key=lambda other: (-round(self._share(date, other), 1), abs(other - date)),
        )

    def _share(self, first: int, second: int) -> float:
        """Return the overlap of two dates as a share of the smaller footprint."""
        return self.shares.get(frozenset((first, second)), 0.0)

    def _degree(self, date: int) -> int:
        return sum(date in ends for ends, result in self.results.items() if result.accepted)
