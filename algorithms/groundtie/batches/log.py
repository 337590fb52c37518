"""The log of a batch: JSON lines, one an event, from which an interrupted batch is resumed."""

from __future__ import annotations

import contextlib
import json
import os
from collections.abc import Iterator
from datetime import datetime, timezone
from pathlib import Path
from typing import IO, Any

from ..rasters.atomic import writing
from ..strict_json import read_json_lines
from .calls import Call
from .work import DONE, REFUSED, Outcome, files_of

ROW = "row"


class EventLog:
    """Writes events to a file, each at once, so that a killed batch has logged all until then."""

    def __init__(self, path: Path, file: IO[str]) -> None:
        self._path = path
        self._file = file

    def write(self, event: str, **facts: Any) -> None:
        """Write an event with the current time (RFC 3339, UTC).

        Raises
        ------
        OutputError
            The disk is full, or the file cannot be written to.
        """
        now = datetime.now(timezone.utc).isoformat(timespec="milliseconds")
        held = {"time": now.replace("+00:00", "Z"), "event": event, **facts}
        line = json.dumps(held, allow_nan=False)
        with writing(self._path):
            self._file.write(line + "\n")
            self._file.flush()

    def row(self, call: Call, outcome: Outcome) -> None:
        """Write how a row ended."""
        self.write(ROW, row=call.row, name=call.name, key=call.key, **outcome.summary())


@contextlib.contextmanager
def open_log(path: Path, append: bool) -> Iterator[EventLog]:
    """Open a log; without `append` an older one is replaced.

    Raises
    ------
    OutputError
        The file cannot be written to.
    """
    with writing(path):
        file = path.open("a" if append else "w", encoding="utf-8")
    try:
        if append and _torn(path):
            file.write("\n")
        yield EventLog(path, file)
    finally:
        with writing(path):  # closing retries unwritten text
            file.close()


def read_finished(path: Path) -> dict[str, Outcome]:
    """Return the outcomes of rows that need not run again, by their calls' keys.

    Lines that are no event are skipped.
    """
    finished = {}
    for event in read_json_lines(path, keeps_digits=True):
        with contextlib.suppress(ValueError, TypeError, KeyError, AttributeError):
            if event["event"] == ROW and event["status"] in (DONE, REFUSED):
                finished[event["key"]] = _outcome(event)
    return finished


def _outcome(event: dict[str, Any]) -> Outcome:
    return Outcome(
        event["status"],
        str(event["message"]),
        float(event["seconds"]),
        dict(event["result"]),
        {path: (int(size), int(time)) for path, (size, time) in event["files"].items()},
    )


def still_there(outcome: Outcome) -> bool:
    """Return whether the files of an earlier run are as it left them."""
    return files_of(tuple(map(Path, outcome.files))) == dict(outcome.files)


def _torn(path: Path) -> bool:
    with path.open("rb") as file:
        if not file.seek(0, os.SEEK_END):
            return False
        file.seek(-1, os.SEEK_END)
        return file.read() != b"\n"
