"""The results of a batch: a table for people and spreadsheets, JSON for programs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..declaration import Tool
from ..rasters.atomic import Outputs, write_csv, write_json
from ..runs import run_tags
from ..version import __version__
from ..wording import counted
from .calls import Call
from .work import DONE, EXIT_CODES, Outcome

_FORMAT = "groundtie-batch/1"

# Most refused or failed rows that are printed; the files hold all of them.
_LINES = 20


@dataclass(frozen=True)
class BatchRow:
    """A row and how it ended; `resumed` if that was in an earlier run."""

    call: Call
    outcome: Outcome
    resumed: bool

    def summary(self) -> dict[str, Any]:
        """Return the row as JSON values."""
        return {
            "row": self.call.row,
            "name": self.call.name,
            "status": self.outcome.status,
            "exit_code": EXIT_CODES[self.outcome.status],
            "message": self.outcome.message,
            "seconds": self.outcome.seconds,
            "resumed": self.resumed,
            "outputs": self.outputs(),
            "result": dict(self.outcome.result),
        }

    def outputs(self) -> dict[str, str]:
        """Return the paths of the outputs that were written, by parameters' names."""
        paths = {name: str(path) for name, path in self.call.outputs.items()}
        return {name: path for name, path in paths.items() if path in self.outcome.files}


@dataclass(frozen=True)
class BatchResult:
    """The results of all rows, in the table's order, and the files that hold them.

    Parameters
    ----------
    tool
        The tool that was run.
    rows
        The rows.
    seconds
        Duration of the batch.
    table, details, log
        The summary as CSV and as JSON, and the log.
    """

    tool: Tool
    rows: Sequence[BatchRow]
    seconds: float
    table: Path
    details: Path
    log: Path

    @property
    def counts(self) -> dict[str, int]:
        """How many rows are `done`, `refused` and `failed`."""
        ended = [row.outcome.status for row in self.rows]
        return {status: ended.count(status) for status in EXIT_CODES}

    @property
    def resumed(self) -> int:
        """How many rows ended in an earlier run."""
        return sum(row.resumed for row in self.rows)

    @property
    def exit_code(self) -> int:
        """Exit code of the worst row: 2 if any failed, else 3 if any was refused, else 0."""
        # `EXIT_CODES` has the worst status last.
        return [EXIT_CODES[status] for status, count in self.counts.items() if count][-1]

    def summary(self) -> dict[str, Any]:
        """Return the result as JSON values."""
        return {
            "format": _FORMAT,
            "tool": self.tool.name,
            "version": __version__,
            "seconds": self.seconds,
            **self.counts,
            "resumed": self.resumed,
            "table": str(self.table),
            "log": str(self.log),
            "rows": [row.summary() for row in self.rows],
        }

    def lines(self) -> list[str]:
        """Return the result as lines of text."""
        counts = [f"{count} {status}" for status, count in self.counts.items()]
        counts += [f"{self.resumed} of them in an earlier run"] if self.resumed else []
        bad = [row for row in self.rows if row.outcome.status != DONE]
        lines = [f"{counted(len(self.rows), 'row')}: {', '.join(counts)}"]
        lines += [
            f"row {row.call.row} ({row.call.name}) {row.outcome.status}: {row.outcome.message}"
            for row in bad[:_LINES]
        ]
        lines += [f"… and {len(bad) - _LINES} more"] if len(bad) > _LINES else []
        return [*lines, f"wrote {self.table}, {self.details}"]

    def write(self) -> None:
        """Write the table and the JSON.

        Raises
        ------
        OutputError
            They cannot be written.
        """
        with Outputs() as outputs:
            self._write_table(outputs.stage(self.table))
            write_json(outputs.stage(self.details), self.summary())

    def _write_table(self, path: Path) -> None:
        numbers = [output.name.lower() for output in self.tool.outputs]
        paths = list(dict.fromkeys(name for row in self.rows for name in row.outputs()))
        head = ["row", "name", "status", "message", "seconds", "resumed"]
        rows = []
        for row in self.rows:
            summary = row.summary()
            rows.append(
                {
                    **{name: summary[name] for name in head},
                    "resumed": "yes" if row.resumed else "no",
                    "seconds": f"{row.outcome.seconds:.2f}",
                    **self._numbers(row.outcome),
                    **row.outputs(),
                    **run_tags(),
                }
            )
        write_csv(path, [*head, *numbers, *paths, *run_tags()], rows)

    def _numbers(self, outcome: Outcome) -> dict[str, Any]:
        found = {}
        for output in self.tool.outputs:
            # A refused registration has no more than its verdict.
            try:
                found[output.name.lower()] = output.value(outcome.result)
            except (KeyError, TypeError):
                continue
        return found
