"""Batches: rows per second in warm processes with one worker, two workers, and Dask on loopback."""

from __future__ import annotations

import dataclasses
import functools
import json
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import Executor, wait
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from groundtie.batches.batch import Batch
from groundtie.batches.result import BatchResult
from groundtie.declaration import Tool
from groundtie.executors import Processes
from groundtie.progress import SILENT
from groundtie.tools import load_tool

from .attempt import Pair
from .simulations import Simulation
from .suites import Goal, Settings, SuiteResult, Table

SIZE_PX = 500
WORKERS = 2
ONE, TWO, DASK = "one process", "two processes", "Dask, two workers on loopback"
_ROWS, _QUICK_ROWS = 20, 4
_SEED = 1


@dataclass(frozen=True)
class Record:
    """One batch: its rows, wall-clock seconds, and processor seconds per row."""

    executor: str
    rows: int
    seconds: float
    cpu_seconds_per_row: float

    @property
    def rows_per_second(self) -> float:
        """Rows per second."""
        return self.rows / self.seconds


@dataclass(frozen=True)
class _Timed:
    """A tool's result, and its processor time."""

    summary_of: dict[str, Any]

    def summary(self) -> dict[str, Any]:
        return self.summary_of


def load_timed(name: str) -> Tool:
    """Return a tool whose summary also holds the processor seconds of its call."""
    tool = load_tool(name)

    @functools.wraps(tool.run)
    def run(**values: Any) -> Any:
        started = time.process_time()
        summary = tool.run(**values).summary()
        return _Timed({**summary, "cpu_seconds": time.process_time() - started})

    return dataclasses.replace(tool, run=run)


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    rows = _QUICK_ROWS if settings.quick else _ROWS
    pair = Simulation(SIZE_PX, "rural", _SEED, further=(("looks", 4.0),)).pair(settings.cache)
    records = []
    for name, opened in (
        (ONE, lambda: Processes(1)),
        (TWO, lambda: Processes(WORKERS)),
        (DASK, _dask),
    ):
        with opened() as executor:
            if executor is not None:
                records.append(time_batch(name, executor, pair, rows))
    return SuiteResult(
        "Batches",
        goals(records),
        (measurements(records),),
        [{**asdict(record), "rows_per_second": record.rows_per_second} for record in records],
        (
            f"`coregister` of one simulated pair of {SIZE_PX}×{SIZE_PX} px with all defaults; "
            "every worker has registered it once before the clock starts. Processor seconds "
            "count where the machine does other things, too.",
        ),
    )


@contextmanager
def _dask() -> Iterator[Executor | None]:
    try:
        import distributed
    except ImportError:
        yield None
        return
    with (
        distributed.LocalCluster(
            n_workers=WORKERS, threads_per_worker=1, host="127.0.0.1", dashboard_address=None
        ) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        yield client.get_executor(pure=False)


def time_batch(name: str, executor: Executor, pair: Pair, rows: int) -> Record:
    """Time a batch in warm workers."""
    with tempfile.TemporaryDirectory() as folder:
        warm(executor)
        _batch(executor, pair, WORKERS, Path(folder))
        started = time.perf_counter()
        result = _batch(executor, pair, rows, Path(folder))
        seconds = time.perf_counter() - started
    if result.exit_code:
        raise RuntimeError(result.lines()[1])
    used = [row.outcome.result["cpu_seconds"] for row in result.rows]
    return Record(name, rows, seconds, sum(used) / rows)


def warm(executor: Executor) -> None:
    """Let every worker import the tool; the tasks last long enough that no worker takes two."""
    wait([executor.submit(_import) for _ in range(WORKERS)])


def _import() -> None:
    load_tool("coregister")
    time.sleep(0.5)


def _batch(executor: Executor, pair: Pair, rows: int, folder: Path) -> BatchResult:
    table = folder / "pairs.json"
    row = {"reference": str(pair.reference), "input": str(pair.input)}
    table.write_text(json.dumps([row] * rows))
    batch = Batch(load_timed, "coregister", table, folder, folder / "log.jsonl")
    return batch.run(False, SILENT, executor)


def goals(records: list[Record]) -> list[Goal]:
    """Return the goals for the records and their results."""
    by_name = {record.executor: record for record in records}
    two = by_name[TWO].rows_per_second
    found = [
        ("rows a second of two processes", 1.5, two),
        ("two processes against one", 1.8, two / by_name[ONE].rows_per_second),
    ]
    if DASK in by_name:
        found.append(("Dask against two processes", 0.85, by_name[DASK].rows_per_second / two))
    return [
        Goal(what, f"≥ {wanted:g}", f"{number:.2f}", number >= wanted)
        for what, wanted, number in found
    ]


def measurements(records: list[Record]) -> Table:
    """Return the records as a table."""
    head = ("where", "rows", "seconds", "rows a second", "processor seconds a row")
    return Table(
        "Batches",
        head,
        [
            (
                record.executor,
                str(record.rows),
                f"{record.seconds:.1f}",
                f"{record.rows_per_second:.2f}",
                f"{record.cpu_seconds_per_row:.2f}",
            )
            for record in records
        ],
    )
