"""Runs calls on an executor, and hands over each outcome as soon as it is there."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future
from queue import Empty, SimpleQueue

from ..declaration import Tool
from ..errors import GroundTieError
from ..executors import POLL_SECONDS, result_of
from ..progress import Progress
from .calls import Call
from .work import DONE, FAILED, Outcome, Task, bug


def run_calls(
    calls: Sequence[Call],
    load: Callable[[str], Tool],
    tool: str,
    executor: Executor,
    check: Callable[[], None],
) -> Iterator[tuple[Call, Outcome]]:
    """Yield calls and their outcomes in the order in which they end.

    Parameters
    ----------
    calls
        What to run.
    load, tool
        See `Task`.
    executor
        Where: any executor whose workers can import `load`.
    check
        Called again and again; what it raises ends the work.
    """
    ended: SimpleQueue[Future[Outcome]] = SimpleQueue()
    waiting: dict[Future[Outcome], Call] = {}
    try:
        for call in calls:
            task = Task(load, tool, call.values, tuple(call.outputs.values()))
            future = executor.submit(task.run)
            waiting[future] = call
            future.add_done_callback(ended.put)
        while waiting:
            check()
            try:
                future = ended.get(timeout=POLL_SECONDS)
            except Empty:
                continue
            yield waiting.pop(future), _outcome(future)
    finally:
        for future in waiting:
            future.cancel()


def _outcome(future: Future[Outcome]) -> Outcome:
    try:
        return result_of(future)
    except GroundTieError as error:
        return Outcome(FAILED, error.one_line())
    except ImportError as error:
        return Outcome(FAILED, f"a worker cannot import what it needs: {error}")
    except Exception as error:
        return Outcome(FAILED, bug(error))


class Reporter:
    """Reports how many rows have ended, how, and how long the others will take."""

    def __init__(self, progress: Progress, rows: int, skipped: int) -> None:
        self._progress = progress
        self._rows = rows
        self._skipped = skipped
        self._ended = skipped
        self._counts: dict[str, int] = {}
        self._started = time.monotonic()

    def ended(self, outcome: Outcome) -> None:
        """Report that one more row has ended."""
        self._ended += 1
        self._counts[outcome.status] = self._counts.get(outcome.status, 0) + 1
        self._progress.update(self._ended / self._rows, self.line())

    def remaining_seconds(self) -> float:
        """Return how long the rest takes if rows take as long as those until now."""
        ran = self._ended - self._skipped
        return (time.monotonic() - self._started) * (self._rows - self._ended) / max(ran, 1)

    def line(self) -> str:
        """Return how far the batch is, for people."""
        troubles = [f"{count} {status}" for status, count in self._counts.items() if status != DONE]
        left = f"{duration(self.remaining_seconds())} left"
        return ", ".join([f"{self._ended} of {self._rows} rows", *troubles, left])


def duration(seconds: float) -> str:
    """Return a duration in words, to two digits or so: 45 s, 12 min, 3.2 h."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
