"""The calls of a table's rows, with values checked as for a single call."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any

from ..declaration import Parameter, Tool
from ..errors import GroundTieError, ParameterError
from ..kinds import Flag, InputKind, OutputKind, RastersIn, Text, Views, WrittenKind
from ..raster_names import is_utf8, raster_name, require_possible
from ..rasters.atomic import make_folder
from ..runs import digest
from .input_files import Listed, facts_read, names_in

# The column that is no parameter.
NAME = "name"

# Main outputs of tools, which are named by their row alone.
_MAIN = ("output", "folder", "output_folder")

_YES, _NO = ("true", "yes", "1"), ("false", "no", "0")


@dataclass(frozen=True)
class Call:
    """A row of a table as a call of the tool.

    Parameters
    ----------
    row
        Its number, from 1.
    name
        Its name in results, and in the names of outputs that the row does not name.
    values
        Checked values of all parameters; empty if there is a problem.
    outputs
        Paths of the requested outputs, by the parameters' names.
    key
        Digest of tool, version, parameters, outputs, and the files that are read with their
        places, sizes and times: calls with the same key have the same results.
    problem
        Why the row cannot be run at all; empty if it can.
    """

    row: int
    name: str
    values: Mapping[str, Any] = field(default_factory=dict)
    outputs: Mapping[str, Path] = field(default_factory=dict)
    key: str = ""
    problem: str = ""


def make_calls(
    tool: Tool, rows: Sequence[Mapping[str, Any]], inputs: Path, outputs: Path, threads: int
) -> list[Call]:
    """Return the calls of a table's rows.

    Parameters
    ----------
    tool
        The tool to call.
    rows
        Values by parameters' names (see `read_rows`), and perhaps a `name`.
    inputs, outputs
        Folders at which relative paths of inputs and of outputs begin.
    threads
        Workers of a call, if the tool has that parameter and the row does not state it.

    Raises
    ------
    ParameterError
        The table has a column that the tool does not know.
    """
    known = {parameter.name for parameter in tool.all_parameters}
    for name in {name: None for row in rows for name in row}:
        if name not in known and name != NAME:
            raise ParameterError(f"the table has a column {name}, which {tool.name} does not know")
    width = len(str(len(rows)))
    calls, listed = [], cache(names_in)
    for number, row in enumerate(rows, 1):
        name = str(row.get(NAME, f"{number:0{width}}"))
        if not is_utf8(name):
            label = name.encode("utf-8", "backslashreplace").decode("utf-8")
            calls.append(Call(number, label, problem=f"the row's name {name!a} is not UTF-8"))
            continue
        given = {"workers": threads, **row} if "workers" in known else row
        try:
            calls.append(_call(tool, number, name, given, inputs, outputs, listed))
        except GroundTieError as error:
            calls.append(Call(number, name, problem=error.one_line()))
    return calls


def _call(
    tool: Tool,
    number: int,
    name: str,
    row: Mapping[str, Any],
    inputs: Path,
    outputs: Path,
    listed: Listed,
) -> Call:
    values = {
        p.name: _value(p, row.get(p.name), name, inputs, outputs) for p in tool.all_parameters
    }
    asked = [p.name for p in tool.parameters if _is_output(p) and values[p.name] is not None]
    for key in asked:
        # Not by the rows: one that fails must not remove a folder that another is about to use.
        make_folder(values[key].parent)
    checked = tool.check(values)
    written = {key: checked[key] for key in asked}
    places = sorted((key, str(path)) for key, path in written.items())
    call = Call(number, name, checked, written)
    read = facts_read(tool, checked, tuple(files_written(tool, call)), listed)
    return replace(call, key=digest(tool.run_of_call(checked), places, read))


def _require_inside(name: str) -> None:
    """Raise an error for a row's name by which its outputs would leave the output folder."""
    # By the separators of both systems: a table may be run on another system than before.
    parts = name.replace("\\", "/").split("/")
    anchor = PurePosixPath(name).anchor or PureWindowsPath(name).anchor
    if ".." in parts or anchor or "\0" in name:
        raise ParameterError(f"the row's name {name!r} cannot name a file in the output folder")


def _value(parameter: Parameter, value: Any, name: str, inputs: Path, outputs: Path) -> Any:
    kind = parameter.kind
    if _is_output(parameter):
        return _output(parameter, value, name, outputs)
    if value is None:
        return None
    if isinstance(kind, InputKind):
        return _located(value, inputs)
    if isinstance(kind, RastersIn):
        several = value.split(";") if isinstance(value, str) else value
        return [_located(one, inputs) for one in several] if isinstance(several, list) else several
    if isinstance(kind, Views) and isinstance(value, str):
        return kind.located(value, inputs)
    if isinstance(kind, Flag) and str(value).lower() in (*_YES, *_NO):
        return str(value).lower() in _YES
    if isinstance(kind, Text) and isinstance(value, (int, float)):
        return str(value)  # YAML and JSON have numbers where a text was meant
    return value


def _located(value: Any, inputs: Path) -> Any:
    """Return an input's place; values that are no names are left to the parameter's check."""
    if not isinstance(value, str) or not value or "\0" in value:
        return value
    found = raster_name(value, inputs)
    return inputs / found if isinstance(found, Path) else found


def _is_output(parameter: Parameter) -> bool:
    return isinstance(parameter.kind, WrittenKind)


def _output(parameter: Parameter, value: Any, name: str, folder: Path) -> Path | None:
    """Return the path of an output; required outputs have a default name."""
    kind = parameter.kind
    if value is None:
        if not parameter.required:
            return None
        stem = "{name}" if parameter.name in _MAIN else f"{{name}}_{parameter.name}"
        value = stem + (kind.suffixes[0] if isinstance(kind, OutputKind) else "")
    if not isinstance(value, str):
        raise ParameterError(f"{parameter.name} must be a path, not {value!r}")
    require_possible(parameter.name, value)
    if "{name}" in value:
        _require_inside(name)
    return folder / value.replace("{name}", name)


def files_written(tool: Tool, call: Call) -> Iterator[Path]:
    """Yield all files that a call writes, also those beside its outputs."""
    for name, path in call.outputs.items():
        kind = tool.parameter(name).kind
        assert isinstance(kind, WrittenKind)
        yield from (path, *kind.also_written(path))
