"""Run a tool over the rows of a table."""

from __future__ import annotations

from concurrent.futures import Executor
from pathlib import Path
from typing import Annotated

from ..batches.batch import Batch
from ..batches.result import BatchResult
from ..declaration import Output, tool
from ..kinds import Choice, FileIn, FileOut, Flag, FolderOut
from ..progress import SILENT, Progress
from ..tables import SUFFIXES
from . import NAMES, load_tool
from .parameters import general


@tool(
    title="Run a tool over a table",
    group="Many scenes",
    outputs=(
        Output("DONE", "Rows that are done", "done"),
        Output("REFUSED", "Rows that were refused", "refused"),
        Output("FAILED", "Rows that failed", "failed"),
        Output("TABLE_OF_RESULTS", "Table of results", "table", text=True),
    ),
)
def batch(
    tool: Annotated[
        str,
        Choice(
            help="Name of the tool to run.",
            choices=tuple(name for name in NAMES if name not in ("batch", "doctor")),
        ),
    ],
    table: Annotated[
        Path,
        FileIn(
            help="A row for each run, with a column for each parameter that is given, by its name "
            "on the command line or in Python, and perhaps a column name. Paths of inputs begin "
            "at the folder of the table.",
            suffixes=SUFFIXES,
        ),
    ],
    output_folder: Annotated[
        Path | None,
        FolderOut(
            help="Paths of outputs begin here, and the results of all rows are written here; by "
            "default the folder of the table.",
        ),
    ] = None,
    resume: Annotated[
        bool,
        Flag(
            help="Skip rows that an earlier run has done or refused, by its log: where input "
            "files, parameters, version and outputs are unchanged.",
        ),
    ] = False,
    workers: general.RowWorkers = None,
    scheduler: general.Scheduler = None,
    json_log: Annotated[
        Path | None,
        FileOut(
            label="Log",
            help="JSON lines, one when a row ends; by default TABLE.log.jsonl in the output "
            "folder.",
            suffixes=(".jsonl", ".ndjson", ".log"),
        ),
    ] = None,
    progress: Progress = SILENT,
    executor: Executor | None = None,
) -> BatchResult:
    """Run a tool over the rows of a table.

    Rows run in any order, several at a time, and each one's failure or refusal is its own. A
    table of results (CSV) and the same as JSON are written at the end. The exit code is that of
    the worst row: 2 if one failed, else 3 if one was refused, else 0.
    """
    folder = table.parent if output_folder is None else output_folder
    log = folder / f"{table.name}.log.jsonl" if json_log is None else json_log
    job = Batch(load_tool, tool, table, folder, log, workers, scheduler)
    return job.run(resume, progress, executor)
