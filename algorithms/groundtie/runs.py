"""The running call of a tool: the id that all its files carry, and the files that it has made.

The id is a digest of all that determines the results: tool, version, parameters, and name, size and
time of the files that are read. The same call on the same files has the same id, with any number of
workers, so that its files are the same, too.
"""

from __future__ import annotations

import hashlib
import os
import secrets
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .version import __version__

# The tag of rasters; in other files the name is RUN.
RUN_TAG = "GROUNDTIE_RUN"
RUN = "run"


@dataclass(frozen=True)
class RunningCall:
    """A call that is running.

    Parameters
    ----------
    run
        Its id.
    folders
        Folders that it made, each after its parent.
    files
        Files that it wrote, and files of an earlier call that it left as they are.
    """

    run: str
    folders: list[Path] = field(default_factory=list)
    files: list[Path] = field(default_factory=list)


_current: ContextVar[RunningCall | None] = ContextVar("groundtie_call", default=None)


@contextmanager
def running(run: str) -> Iterator[RunningCall]:
    """Give written files an id, and remove folders that were made and are empty at the end.

    Within a running call, a step is a part of that call.
    """
    outer = _current.get()
    if outer is not None:
        yield outer
        return
    call = RunningCall(run)
    token = _current.set(call)
    try:
        yield call
    finally:
        _current.reset(token)
        for folder in reversed(call.folders):
            with suppress(OSError):  # the folder is not empty, or could not be made
                folder.rmdir()


def will_make(folder: Path) -> None:
    """Note which folders, of a folder and its parents, the running call is about to make."""
    call = _current.get()
    if call is not None:
        above = [Path(folder), *Path(folder).absolute().parents]
        call.folders.extend(reversed([one for one in above if not one.exists()]))


def has_written(*files: Path) -> None:
    """Note that the running call has written files, or takes them over from an earlier one."""
    call = _current.get()
    if call is not None:
        call.files.extend(files)


def run_of_call(tool: str, inputs: Mapping[str, Any]) -> str:
    """Return the id of a call.

    Parameters
    ----------
    tool
        The tool's name.
    inputs
        Checked values, by name, of the parameters that determine the results: neither outputs nor
        workers. With a raster in memory, the id is unique.
    """
    facts = {name: _facts(value) for name, value in sorted(inputs.items())}
    return digest(tool, __version__, facts)


def digest(*facts: Any) -> str:
    """Return a digest of the `repr` of facts."""
    return hashlib.sha256(repr(facts).encode()).hexdigest()[:16]


def run_tags(name: str = RUN) -> dict[str, str]:
    """Return the id of the running call, by a name; empty outside of a tool's call."""
    call = _current.get()
    return {} if call is None else {name: call.run}


def file_state(path: Path | str) -> tuple[int, int] | None:
    """Return size in bytes, and time of the last change in nanoseconds; None: there is no file."""
    try:
        found = os.stat(path)
    except (OSError, ValueError):  # also for a text that cannot be a name
        return None
    return found.st_size, found.st_mtime_ns


def file_facts(path: Path | str) -> tuple[Any, ...]:
    """Return absolute path, size and time of a file; if there is no file, its name."""
    state = file_state(path)
    return (str(path),) if state is None else (os.path.abspath(path), *state)


def unknown_facts(name: Path | str) -> tuple[str, str]:
    """Return unique facts of a raster or file that may have changed without a trace."""
    return str(name), secrets.token_hex(8)


def _facts(value: Any) -> Any:
    if isinstance(value, Path):
        state = file_state(value)
        return str(value) if state is None else (value.name, *state)
    if isinstance(value, tuple):
        return tuple(map(_facts, value))
    if value is None or isinstance(value, (str, int, float)):
        return value
    return secrets.token_hex(8)
