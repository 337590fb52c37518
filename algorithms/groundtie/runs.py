"""Which call of a tool a file belongs to: all files of one call carry the same id.

It stands for what decides what they hold: tool, version, parameters, and name, size and time of the
files that are read. The same call on the same files has the same id, with any number of workers, so
that its files are the same, too.
"""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from pathlib import Path
from typing import Any

from .version import __version__

# The tag of rasters; in other files the name is RUN.
RUN_TAG = "GROUNDTIE_RUN"
RUN = "run"

_current: ContextVar[str | None] = ContextVar("groundtie_run", default=None)


@contextmanager
def running(run: str) -> Iterator[None]:
    """Let what is written carry an id, unless this is a step of a call that has one."""
    token = _current.set(_current.get() or run)
    try:
        yield
    finally:
        _current.reset(token)


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
    run = _current.get()
    return {} if run is None else {name: run}


def _facts(value: Any) -> Any:
    if isinstance(value, Path):
        try:
            found = value.stat()
        except OSError:
            return str(value)
        return value.name, found.st_size, found.st_mtime_ns
    if isinstance(value, tuple):
        return tuple(map(_facts, value))
    if value is None or isinstance(value, (str, int, float)):
        return value
    return secrets.token_hex(8)
