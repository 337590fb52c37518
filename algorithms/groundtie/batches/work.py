"""The work of a worker: one call, whose outcome, also a failure, becomes numbers and words."""

from __future__ import annotations

import os
import time
import traceback
from collections.abc import Callable, Iterable, Mapping
from contextvars import Context
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ..declaration import Tool
from ..errors import CancelledError, GroundTieError, NotRegisteredError, one_line
from ..executors import enter_worker, stop_requested
from ..kinds import plain
from ..progress import Progress
from ..runs import file_state, running
from ..version import __version__

DONE, REFUSED, FAILED = "done", "refused", "failed"

# Exit codes of the command line of a single call, the worst last.
EXIT_CODES = {DONE: 0, REFUSED: NotRegisteredError.exit_code, FAILED: GroundTieError.exit_code}


@dataclass(frozen=True)
class Outcome:
    """How a call ended.

    Parameters
    ----------
    status
        `done`, `refused` or `failed`.
    message
        Reason of a refusal or failure, in one line.
    seconds
        Duration.
    result
        The tool's summary; for a refused registration, its verdict. All numbers are finite.
    files
        Size in bytes and time in nanoseconds of the files that the call wrote, by their paths;
        files that an earlier run left under these names are not among them.
    traceback
        Traceback of a failure that is a bug.
    """

    status: str
    message: str = ""
    seconds: float = 0.0
    result: Mapping[str, Any] = field(default_factory=dict)
    files: Mapping[str, tuple[int, int]] = field(default_factory=dict)
    traceback: str = ""


@dataclass(frozen=True)
class Task:
    """One call as it travels to a worker: names, paths and parameters, no pixels.

    Parameters
    ----------
    load
        Returns a tool by its name; a function of a module that workers can import.
    tool, values
        The call.
    outputs
        Paths that it writes.
    version
        Version of the package here; a worker's must be the same.
    """

    load: Callable[[str], Tool]
    tool: str
    values: Mapping[str, Any]
    outputs: tuple[Path, ...]
    version: str = __version__

    def run(self) -> Outcome:
        """Run the call; any error becomes an outcome, too."""
        enter_worker()
        started = time.perf_counter()
        written: list[Path] = []
        try:
            if self.version != __version__:
                raise GroundTieError(f"the worker has GroundTie {__version__}, not {self.version}")
            outcome = Outcome(DONE, result=self._call(written))
        except CancelledError:
            raise
        except Exception as error:
            outcome = ended_by(error)
        return replace(
            outcome,
            seconds=time.perf_counter() - started,
            # Numbers of one row that are not finite must not cost the table of all rows.
            result=plain(dict(outcome.result)),
            files=files_of((*_among(self.outputs, written), *written)),
        )

    def _call(self, written: list[Path]) -> dict[str, Any]:
        """Run the tool, return its summary, and add the files that it writes to a list."""
        tool = self.load(self.tool)

        def run() -> dict[str, Any]:
            with running(tool.run_of_call(self.values)) as call:
                try:
                    progress = Progress(is_cancelled=stop_requested)
                    return tool.run(**self.values, progress=progress).summary()
                finally:
                    written.extend(call.files)

        # A context of its own: files carry the id of this call (see `runs`), on any executor.
        return Context().run(run)


def _among(outputs: Iterable[Path], written: Iterable[Path]) -> list[Path]:
    """Return the outputs that were written: files, and folders in which files were written."""
    places = {place for path in written for place in (path, *path.parents)}
    return [path for path in outputs if Path(os.path.abspath(path)) in places]


def ended_by(error: Exception) -> Outcome:
    """Return the outcome of a call that ended by an error."""
    if isinstance(error, NotRegisteredError):
        return Outcome(REFUSED, error.one_line(), result=error.summary())
    if isinstance(error, GroundTieError):
        return Outcome(FAILED, error.one_line())
    message = f"this is a bug in GroundTie: {type(error).__name__}: {error}"
    trace = "".join(traceback.format_exception(error))
    return Outcome(FAILED, one_line(message), traceback=trace)


def files_of(paths: tuple[Path, ...]) -> dict[str, tuple[int, int]]:
    """Return size in bytes and time in nanoseconds of the existing ones among these files.

    Folders, whose times change with any file in them, have zeros.
    """
    found = {}
    for path in paths:
        state = (0, 0) if path.is_dir() else file_state(path)
        if state is not None:
            found[str(path)] = state
    return found
