"""Running calls on an executor, with each outcome as soon as it is known."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future
from queue import Empty, SimpleQueue

from ..declaration import Tool
from ..executors import POLL_SECONDS, result_of
from .calls import Call
from .work import DONE, FAILED, Outcome, Task, ended_by


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
        The calls to run.
    load, tool
        See `Task`.
    executor
        Any executor whose workers can import `load`.
    check
        Called repeatedly; an error that it raises ends the work.
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
    except ImportError as error:
        return Outcome(FAILED, f"a worker cannot import what it needs: {error}")
    except Exception as error:
        return ended_by(error)


def progress_line(ran: Counter[str], ended: int, rows: int, seconds: float) -> str:
    """Return the progress of a batch in words; the time left is extrapolated from rows that ran.

    Parameters
    ----------
    ran
        Numbers of rows that ran, by status.
    ended, rows
        Number of rows that have ended, including those known from an earlier run, and of all rows.
    seconds
        Time since rows began to run.
    """
    troubles = [f"{count} {status}" for status, count in ran.items() if status != DONE]
    left_s = seconds * (rows - ended) / ran.total()
    return ", ".join([f"{ended} of {rows} rows", *troubles, f"{duration(left_s)} left"])


def duration(seconds: float) -> str:
    """Return a duration in words, to about two digits: 45 s, 12 min, 3.2 h."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
