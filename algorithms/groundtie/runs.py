"""The call of a tool that is running: the id that all its files carry, and what it has made.

The id stands for what decides what they hold: tool, version, parameters, and name, size and time of
the files that are read. The same call on the same files has the same id, with any number of
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
        Those that it made, each after that which it lies in.
    files
        Those that it wrote, and those of an earlier call that it left as they are.
    """

    run: str
    folders: list[Path] = field(default_factory=list)
    files: list[Path] = field(default_factory=list)


_current: ContextVar[RunningCall | None] = ContextVar("groundtie_call", default=None)


@contextmanager
def running(run: str) -> Iterator[RunningCall]:
    """Let what is written carry an id, and no folder stay that was made and is empty at the end.

    A step of a call that has an id is a part of that call.
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
            with suppress(OSError):  # it has something in it, or could not be made
                folder.rmdir()


def will_make(folder: Path) -> None:
    """Note which of a folder, and of those that it lies in, the running call is about to make."""
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
        Its name.
    inputs
        Checked values by name of what decides the results: neither outputs nor workers. With a
        raster in memory no other call has the same id.
    """
    facts = {name: _facts(value) for name, value in sorted(inputs.items())}
    return digest(tool, __version__, facts)


def digest(*facts: Any) -> str:
    """Return what stands for facts, by what `repr` shows of them."""
    return hashlib.sha256(repr(facts).encode()).hexdigest()[:16]


def run_tags(name: str = RUN) -> dict[str, str]:
    """Return the id of the call that is running, by a name; empty outside of a tool's call."""
    call = _current.get()
    return {} if call is None else {name: call.run}


def file_state(path: Path | str) -> tuple[int, int] | None:
    """Return size in bytes, and time of the last change in nanoseconds; None: there is no file."""
    try:
        found = os.stat(path)
    except (OSError, ValueError):  # also of what cannot be a name
        return None
    return found.st_size, found.st_mtime_ns


def file_facts(path: Path | str) -> tuple[Any, ...]:
    """Return place, size and time of a file, from whatever folder it is named; else the name."""
    state = file_state(path)
    return (str(path),) if state is None else (os.path.abspath(path), *state)


def unknown_facts(name: Path | str) -> tuple[str, str]:
    """Return facts of what may have changed without a trace: no others are the same."""
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
