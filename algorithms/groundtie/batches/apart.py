"""Keeping the rows of a batch apart: they run in any order, so none may use another's files."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from ..call_paths import inputs_of
from ..declaration import Tool
from ..errors import OutputError, SameFileError
from ..kinds import FolderOut, RastersIn
from ..series.inputs import would_stand_for
from ..vrt_sources import sources_of
from .calls import Call, files_written
from .input_files import files_read

# Stands for the batch itself among the numbers of rows, which begin at 1.
_BATCH = 0


def check_apart(tool: Tool, calls: Sequence[Call], table: Path, results: Sequence[Path]) -> None:
    """Raise an error if a file that a row or the batch writes is used by another row or the batch.

    Parameters
    ----------
    tool, calls
        The rows.
    table, results
        The files that the batch itself reads and writes.

    Raises
    ------
    SameFileError
        Two of them write the same file.
    OutputError
        One reads a file that another one writes, or that lies in another row's output folder.
    """
    writers = dict.fromkeys((path.resolve() for path in results), _BATCH)
    for call in calls:
        for path in files_written(tool, call):
            other = writers.setdefault(path.resolve(), call.row)
            if other != call.row:
                both = f"rows {other} and" if other else "the batch and row"
                raise SameFileError(f"{both} {call.row} both write {path}")
    _check_read(writers.get(table.resolve()), "the batch", table)
    folders = {
        path.resolve(): call.row
        for call in calls
        for name, path in call.outputs.items()
        if isinstance(tool.parameter(name).kind, FolderOut)
    }
    for call in calls:
        for path in _read(tool, call):
            place = path.resolve()
            _check_read(writers.get(place), _name(call.row), path)
            for above in place.parents:
                if folders.get(above) != call.row:
                    _check_read(folders.get(above), _name(call.row), path)
    _check_named(tool, calls, writers)


def _check_named(tool: Tool, calls: Sequence[Call], writers: dict[Path, int]) -> None:
    """Raise an error if a folder or a pattern stands for a file that another row will write."""
    written: dict[Path, list[Path]] = {}
    for path in writers:
        written.setdefault(path.parent, []).append(path)
    for call in calls:
        for given in _given(tool, call):
            place = given.resolve()
            for path in (*written.get(place, ()), *written.get(place.parent, ())):
                if writers[path] != call.row and would_stand_for(given, path):
                    _check_read(writers[path], _name(call.row), path)


def _check_read(writer: int | None, reader: str, path: Path) -> None:
    if writer is not None:
        raise OutputError(f"{_name(writer)} would write what {reader} reads: {path}")


def _name(row: int) -> str:
    return f"row {row}" if row != _BATCH else "the batch"


def _read(tool: Tool, call: Call) -> Iterator[Path]:
    """Yield the paths that a call reads: its inputs, the files behind them, and their sources."""
    for parameter in tool.parameters:
        value = call.values.get(parameter.name)
        named = (path for path in inputs_of(parameter.kind, value) if isinstance(path, Path))
        # Most names stand for themselves.
        for path in dict.fromkeys((*named, *files_read(parameter.kind, value))):
            yield from (path, *sources_of(path))


def _given(tool: Tool, call: Call) -> Iterator[Path]:
    """Yield the names that may be folders or patterns."""
    for parameter in tool.parameters:
        if isinstance(parameter.kind, RastersIn):
            named = inputs_of(parameter.kind, call.values.get(parameter.name))
            yield from (path for path in named if isinstance(path, Path))
