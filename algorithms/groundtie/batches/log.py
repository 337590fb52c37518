"""The log of a batch: JSON lines, one an event, from which an interrupted batch is resumed."""

from __future__ import annotations

import contextlib
from dataclasses import asdict, dataclass
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from ..rasters.atomic import append_json, writing
from ..strict_json import read_json_lines
from .calls import Call
from .work import DONE, REFUSED, Outcome, files_of

ROW = "row"


@dataclass(frozen=True)
class EventLog:
    """Writes events to a file, each at once, so that a killed batch has logged all until then."""

    path: Path

    def write(self, event: str, **facts: Any) -> None:
        """Write an event with the current time (RFC 3339, UTC).

        Raises
        ------
        OutputError
            The disk is full, or the file cannot be written to.
        """
        now = datetime.now(timezone.utc).isoformat(timespec="milliseconds")
        append_json(self.path, {"time": now.replace("+00:00", "Z"), "event": event, **facts})

    def row(self, call: Call, outcome: Outcome) -> None:
        """Write how a row ended."""
        self.write(ROW, row=call.row, name=call.name, key=call.key, **asdict(outcome))


def open_log(path: Path, append: bool) -> EventLog:
    """Return a log; without `append` an older one is emptied.

    Raises
    ------
    OutputError
        The file cannot be written to.
    """
    with writing(path):
        path.open("a" if append else "w").close()
    return EventLog(path)


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
