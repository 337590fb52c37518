"""A batch: the rows of a table, run, resumed, logged and summarised."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Callable
from concurrent.futures import Executor
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path

from ..declaration import Tool
from ..errors import CancelledError
from ..executors import open_executor
from ..packages import processors
from ..progress import Progress
from ..rasters.atomic import make_folder
from ..tables import read_rows
from ..version import __version__
from .apart import check_apart
from .calls import Call, make_calls
from .log import EventLog, open_log, read_finished, still_there
from .result import BatchResult, BatchRow
from .running import progress_line, run_calls
from .work import FAILED, Outcome


@dataclass(frozen=True)
class Batch:
    """What to run, and where.

    Parameters
    ----------
    load
        Returns a tool by its name; a function of a module that workers can import.
    tool
        Name of the tool.
    table
        Path of the table. Its inputs' relative paths begin at its folder.
    folder
        Folder of the summary and of outputs with relative paths.
    log
        Path of the log.
    workers
        Number of rows run in parallel on this machine; by default one per processor.
    scheduler
        Address of a Dask scheduler whose workers run the rows instead.
    """

    load: Callable[[str], Tool]
    tool: str
    table: Path
    folder: Path
    log: Path
    workers: int | None = None
    scheduler: str | None = None

    def run(
        self, resume: bool, progress: Progress, executor: Executor | None = None
    ) -> BatchResult:
        """Run the rows.

        Parameters
        ----------
        resume
            Whether to take over the log's results of earlier runs, if their files are unchanged.
        progress
            Progress of the whole batch.
        executor
            Runs the rows instead of `workers` and `scheduler`; it stays open.

        Raises
        ------
        ParameterError
            The table cannot be read or understood.
        SameFileError, OutputError
            A row writes a file that another one, or the batch itself, reads or writes; a file
            cannot be written.
        SchedulerError
            The scheduler does not answer.
        """
        started = time.monotonic()
        rows = read_rows(self.table)
        tool = self.load(self.tool)
        make_folder(self.folder)
        local = executor is None and self.scheduler is None
        available = processors()
        workers = min(self.workers or available, len(rows))
        threads = max(1, available // workers) if local else 1
        base, folder = Path(os.path.abspath(self.table)).parent, Path(os.path.abspath(self.folder))
        calls = make_calls(tool, rows, base, folder, threads)
        log_path = Path(os.path.abspath(self.log))
        summary, details = (
            folder / f"{self.table.name}.results{ending}" for ending in (".csv", ".json")
        )
        check_apart(tool, calls, self.table, [log_path, summary, details])
        ended = self._known(calls, resume)
        resumed = {number for number, outcome in ended.items() if outcome.status != FAILED}
        # Connect before the log is opened: a missing scheduler must not cost an older log.
        opened = (
            open_executor(workers, self.scheduler) if executor is None else nullcontext(executor)
        )
        with opened as pool:
            log = open_log(self.log, resume)
            log.write("batch", tool=tool.name, version=__version__, rows=len(calls))
            self._run(calls, ended, pool, log, progress)
            result = BatchResult(
                tool,
                [BatchRow(call, ended[call.row], call.row in resumed) for call in calls],
                time.monotonic() - started,
                summary,
                details,
                log_path,
            )
            log.write("end", **result.counts, seconds=result.seconds)
        result.write()
        return result

    def _known(self, calls: list[Call], resume: bool) -> dict[int, Outcome]:
        """Return the outcomes that are known without running a call, by the rows' numbers."""
        finished = read_finished(self.log) if resume else {}
        known = {}
        for call in calls:
            earlier = finished.get(call.key)
            if call.problem:
                known[call.row] = Outcome(FAILED, call.problem)
            elif earlier is not None and still_there(earlier):
                known[call.row] = earlier
        return known

    def _run(
        self,
        calls: list[Call],
        ended: dict[int, Outcome],
        pool: Executor,
        log: EventLog,
        progress: Progress,
    ) -> None:
        """Run the calls without a known outcome, and add their outcomes."""
        for call in calls:
            if call.problem:
                log.row(call, ended[call.row])
        waiting = [call for call in calls if call.row not in ended]
        ran, started = Counter[str](), time.monotonic()
        progress.update(len(ended) / len(calls), f"{len(waiting)} of {len(calls)} rows to run")
        try:
            for call, outcome in run_calls(waiting, self.load, self.tool, pool, progress.check):
                ended[call.row] = outcome
                log.row(call, outcome)
                ran[outcome.status] += 1
                line = progress_line(ran, len(ended), len(calls), time.monotonic() - started)
                progress.update(len(ended) / len(calls), line)
        except CancelledError as error:
            log.write("cancelled")
            raise CancelledError(
                f"cancelled after {len(ended)} of {len(calls)} rows; resume runs the others"
            ) from error
