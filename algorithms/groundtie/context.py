"""The context of a running step: threads, progress, and the seed of random samples."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TypeVar

from .memo import Memo
from .packages import processors
from .progress import SILENT, Progress

# Largest number of threads.
MOST_WORKERS = 256

T = TypeVar("T")
R = TypeVar("R")


@dataclass(frozen=True)
class Context:
    """Where work runs, how it reports its progress, and the seed of its random samples.

    Parameters
    ----------
    executor
        Any `concurrent.futures.Executor` whose tasks may be closures; by default threads.
    progress
        Receives the share of the work that is done, and holds whether it was cancelled.
    seed
        Seed of random samples: the same seed gives the same result.
    workers
        Number of threads of steps that keep threads of their own, as warping does.
    memo
        Keeps results on the reference for further images that are registered to it; None: there
        are none.
    """

    executor: Executor
    progress: Progress = SILENT
    seed: int = 0
    workers: int = 1
    memo: Memo | None = None

    def part(self, start: float, end: float) -> Context:
        """Return the context of a part of this work, from `start` to `end` (0 to 1)."""
        return replace(self, progress=self.progress.part(start, end))

    def quiet(self) -> Context:
        """Return this context without progress, for a step that is too short to report."""
        return replace(self, progress=Progress(is_cancelled=self.progress.is_cancelled))

    def update(self, fraction: float, message: str = "") -> None:
        """Report `fraction` (0 to 1) of this work as done; raise if it was cancelled."""
        self.progress.update(fraction, message)

    def map(self, function: Callable[[T], R], items: Sequence[T]) -> Iterator[R]:
        """Yield `function` of each item, in their order, while others are computed.

        Raises
        ------
        CancelledError
            The work was cancelled.
        """

        def one(item: T) -> R:
            self.progress.check()
            return function(item)

        for i, result in enumerate(self.executor.map(one, items)):
            self.progress.update((i + 1) / len(items))
            yield result


@contextmanager
def threads(
    workers: int | None = None, progress: Progress = SILENT, seed: int = 0
) -> Iterator[Context]:
    """Open a context with threads of its own; by default one per processor."""
    count = workers or processors()
    with ThreadPoolExecutor(count) as executor:
        yield Context(executor, progress, seed, count)
