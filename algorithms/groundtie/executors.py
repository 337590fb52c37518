"""Where many calls run: processes or threads of this machine, or a cluster's workers.

All are `concurrent.futures.Executor`s: a task that runs on one runs on any.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError as FutureCancelledError
from concurrent.futures import Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import spawn
from typing import Any, ParamSpec, TypeVar

from .errors import ParameterError, SchedulerError, WorkerLostError, raised_by
from .memory import set_heaps
from .packages import use_one_thread

P = ParamSpec("P")
T = TypeVar("T")

# Timeout of a scheduler, which answers within a network's round trip: users should not wait longer
# without a message.
_CONNECT_SECONDS = 5.0

# Longest delay of the user's Cancel while tasks run elsewhere.
POLL_SECONDS = 0.2

# A killed worker may be a coincidence; twice with the same task is not.
_ATTEMPTS = 2

# Guard of programs that start processes, which read the program from its beginning.
_GUARD = 'if __name__ == "__main__":'

_here = threading.local()


def stop_requested() -> bool:
    """Return whether the pool that runs the calling task is to end before its tasks are done."""
    stopped: Callable[[], bool] = getattr(_here, "stopped", lambda: False)
    return stopped()


class Threads(ThreadPoolExecutor):
    """Threads of this process; tasks that ask `stop_requested` end soon.

    Parameters
    ----------
    workers
        Number of threads.
    stop
        Event that asks tasks to stop; None: a `threading.Event`.
    """

    def __init__(self, workers: int, stop: Any = None) -> None:
        self._stop = stop or threading.Event()
        super().__init__(workers, initializer=_heed, initargs=(self._stop.is_set,))

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End all; with `cancel_futures` ask running tasks to stop."""
        if cancel_futures:
            self._stop.set()
        super().shutdown(wait, cancel_futures=cancel_futures)


class Processes(Threads):
    """Threads with a process of its own each, so that a dying process costs no other task.

    The task of a process that died is known, and runs again in a new process. Processes are not
    forked, since threads of OpenCV and GDAL do not survive it: modules that use this at import need
    `if __name__ == "__main__"`.
    """

    def __init__(self, workers: int) -> None:
        self._context = multiprocessing.get_context("spawn")
        super().__init__(workers, self._context.Event())
        self._begun, self._have_none_begun = self._context.Event(), threading.Event()
        self._own = threading.local()
        self._pools: list[ProcessPoolExecutor] = []

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Run a task in the next free process.

        Its future raises `WorkerLostError` if its process dies repeatedly.
        """
        return super().submit(self._run, fn, *args, **kwargs)

    def _run(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> T:
        # If no process could start, tasks do not try another one until one has started after all.
        is_vain = self._have_none_begun.is_set() and not self._begun.is_set()
        for _ in range(0 if is_vain else _ATTEMPTS):
            try:
                return self._pool().submit(fn, *args, **kwargs).result()
            except BrokenProcessPool:
                self._own.pool = None
        if not self._begun.is_set():
            self._have_none_begun.set()
            raise WorkerLostError(
                "no process could be started (out of memory? or by a program that starts some "
                f"without {_GUARD})"
            )
        raise WorkerLostError(
            f"its process was ended {_ATTEMPTS} times, by the system (out of memory?) or somebody"
        )

    def _pool(self) -> ProcessPoolExecutor:
        pool: ProcessPoolExecutor | None = getattr(self._own, "pool", None)
        if pool is None:
            pool = ProcessPoolExecutor(1, self._context, _start_worker, (self._stop, self._begun))
            self._own.pool = pool
            self._pools.append(pool)
        return pool

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes, too."""
        super().shutdown(wait, cancel_futures=cancel_futures)
        for pool in self._pools:
            pool.shutdown(wait, cancel_futures=cancel_futures)


@contextlib.contextmanager
def open_executor(workers: int, scheduler: str | None = None) -> Iterator[Executor]:
    """Open an executor of many calls, and end it afterwards.

    Parameters
    ----------
    workers
        Number of calls run in parallel on this machine: in processes, or in threads if no process
        can be started.
    scheduler
        Address of a Dask scheduler, as `tcp://host:8786`: its workers run the calls, all at once.

    Raises
    ------
    ParameterError
        This process is itself being started, by a program without a guard.
    SchedulerError
        The scheduler does not answer, or Dask is missing.
    """
    if scheduler is not None:
        with _scheduler_executor(scheduler) as executor:
            yield executor
        return
    pool = (Processes if _can_start_processes() else Threads)(workers)
    try:
        yield pool
    except BaseException:
        pool.shutdown(cancel_futures=True)
        raise
    pool.shutdown()


def _can_start_processes() -> bool:
    """Return whether this process can start others.

    It cannot inside QGIS, whose Python is no interpreter that could be started, in a worker of
    `multiprocessing.Pool` (a daemon), or if the program was read from standard input or a pipe,
    since each process reads it.

    Raises
    ------
    ParameterError
        This process is itself being started, and must not do the program's work.
    """
    if "qgis.core" in sys.modules:
        return False
    try:
        start = spawn.get_preparation_data("")  # what each process begins with
    except RuntimeError as error:
        raise ParameterError(
            "this is one of the processes that do the work, and cannot begin it anew: a program "
            f"that starts some must do so below {_GUARD}"
        ) from error
    program = start.get("init_main_from_path")
    is_readable = program is None or os.path.isfile(program)
    return is_readable and not multiprocessing.current_process().daemon


@contextlib.contextmanager
def _scheduler_executor(address: str) -> Iterator[Executor]:
    try:
        import distributed
    except ImportError as error:
        raise SchedulerError(
            "a scheduler needs the Python package distributed: pip install 'groundtie[cluster]'"
        ) from error
    if (__package__ or "").partition(".")[0] != "groundtie":
        raise SchedulerError(
            "a scheduler's workers know the package groundtie alone, not the copy in the QGIS "
            "plugin: install groundtie in QGIS's Python, too"
        )
    if "://" not in address:
        raise ParameterError(f"scheduler must be an address as tcp://host:8786, not {address!r}")
    try:
        client = distributed.Client(address, timeout=_CONNECT_SECONDS, set_as_default=False)
    except (OSError, ValueError, ImportError) as error:  # also for an unknown protocol
        raise SchedulerError(f"no Dask scheduler answers at {address}") from error
    with client:
        # Tasks are no pure functions: they write files.
        yield client.get_executor(pure=False)


def result_of(future: Future[T]) -> T:
    """Return the result of a task that has ended.

    Raises
    ------
    WorkerLostError
        The worker that ran it was lost. Errors of the task itself are raised unchanged.
    SchedulerError
        The scheduler was lost.
    """
    try:
        return future.result()
    except FutureCancelledError as error:
        raise SchedulerError("the scheduler was lost") from error
    except Exception as error:
        if not (raised_by(error, "concurrent") or raised_by(error, "distributed")):
            raise
        raise WorkerLostError(f"its worker was lost: {error}") from error


def enter_worker() -> None:
    """Prepare the process of a task, which may run anywhere, if it is a Dask worker."""
    if "distributed" in sys.modules:
        set_heaps()


def _heed(stopped: Callable[[], bool]) -> None:
    _here.stopped = stopped


def _start_worker(stop: Any, begun: Any) -> None:
    """Prepare a process: libraries use one thread, and the process ends with its parent.

    A terminal's Ctrl-C reaches all processes: the parent alone handles it.
    """
    begun.set()
    use_one_thread()
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _heed(stop.is_set)
    set_heaps()
    threading.Thread(target=_end_with_parent, daemon=True).start()
    import cv2

    cv2.setNumThreads(1)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
