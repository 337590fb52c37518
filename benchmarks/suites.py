"""The parts that all suites share: settings, the running of many cases, and results."""

from __future__ import annotations

import multiprocessing
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol, TypeVar

import cv2

from .ablation import leave_out, left_out
from .accuracy import SILENTLY_WRONG
from .attempt import Outcome, count


@dataclass(frozen=True)
class Settings:
    """The extent of a run.

    Parameters
    ----------
    quick
        Run only a few cases of each suite: enough to see that it works, not to judge.
    seeds
        Number of simulated pairs of each kind.
    jobs
        Number of processes. One: cases run in this process, each on all processors. More: each
        case has one thread.
    data
        Folder of the real image pairs.
    cache
        Folder of simulated pairs, which take long to make.
    first_seed
        The first of the seeds.
    classes
        For attacks, margins and calibration: the classes to run.
    sample, named, save, large
        For attacks alone: number of cases over all classes; names of cases; folder for the images;
        whether scenes are large.
    """

    quick: bool
    seeds: int
    jobs: int
    data: Path
    cache: Path
    first_seed: int = 1
    sample: int | None = None
    classes: tuple[str, ...] = ()
    named: tuple[str, ...] = ()
    save: Path | None = None
    large: bool = False

    def seed_numbers(self, most: int | None = None) -> range:
        """Return the seeds, at most a given number; one in quick runs."""
        number = min(self.seeds, most or self.seeds)
        return range(self.first_seed, self.first_seed + (1 if self.quick else number))


class Case(Protocol):
    """A case that a pool of processes can run; it must be picklable."""

    def run(self, workers: int | None) -> Outcome:
        """Register, judge and time; `workers` threads."""


@dataclass(frozen=True)
class Goal:
    """A goal and its result.

    Parameters
    ----------
    what, wanted, found
        Text for display.
    reached
        Whether the goal is reached; None: reported only, or too few runs to tell.
    """

    what: str
    wanted: str
    found: str
    reached: bool | None


def none_wrong(what: str, outcomes: Sequence[Outcome]) -> Goal:
    """Return the goal that no registration is silently wrong, with its result."""
    wrong = count(outcomes, SILENTLY_WRONG)
    return Goal(what, "none", f"{wrong} of {len(outcomes)}", wrong == 0)


class Grouped(Protocol):
    """A result that is counted in a group."""

    @property
    def group(self) -> str:
        """Name of the group the case is counted in."""


G = TypeVar("G", bound=Grouped)


def by_group(found: Iterable[G], names: Iterable[str] = ()) -> dict[str, list[G]]:
    """Return results by group: named groups first, then the others in order of appearance."""
    groups: dict[str, list[G]] = {name: [] for name in names}
    for one in found:
        groups.setdefault(one.group, []).append(one)
    return groups


C = TypeVar("C")


def of_classes(
    cases: Sequence[C], classes: Sequence[str], names_of: Callable[[C], set[str]]
) -> list[C]:
    """Return the cases of some classes, by any of their names; without classes, all cases.

    Raises
    ------
    ValueError
        No case has one of these names.
    """
    known = {name for case in cases for name in names_of(case)}
    for name in classes:
        if name not in known:
            raise ValueError(f"no class {name!r}; there are {'; '.join(sorted(known))}")
    return [case for case in cases if not classes or names_of(case) & set(classes)]


@dataclass(frozen=True)
class Table:
    """A table of text."""

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]


@dataclass(frozen=True)
class SuiteResult:
    """The results of a suite: goals, tables for display, records for programs, notes."""

    title: str
    goals: Sequence[Goal]
    tables: Sequence[Table]
    records: Sequence[dict[str, Any]]
    notes: Sequence[str] = field(default_factory=tuple)


def run_cases(
    cases: Sequence[Case], jobs: int, report: Callable[[str], None] = print
) -> list[Outcome]:
    """Run cases and return their outcomes in the same order; `report` gets a line for each."""
    outcomes: list[Outcome | None] = [None] * len(cases)

    def done(index: int, outcome: Outcome) -> None:
        outcomes[index] = outcome
        finished = sum(o is not None for o in outcomes)
        report(f"[{finished}/{len(cases)}] {outcome.line()}")

    if jobs == 1:
        for index, case in enumerate(cases):
            done(index, case.run(None))
        return [o for o in outcomes if o is not None]
    # Spawned, as OpenCV's and GDAL's threads do not survive a fork.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, context, _begin, (left_out(),)) as pool:
        futures = {pool.submit(case.run, 1): index for index, case in enumerate(cases)}
        try:
            for future in as_completed(futures):
                done(futures[future], future.result())
        finally:
            pool.shutdown(cancel_futures=True)
    return [o for o in outcomes if o is not None]


def _begin(without: Sequence[str]) -> None:
    cv2.setNumThreads(1)
    leave_out(without)
