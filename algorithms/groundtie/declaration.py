"""One declaration per tool: a typed Python function whose annotations carry the rest.

A tool is a function decorated with `tool`. Its signature gives the order and the defaults of the
parameters, `Annotated` types give their kind, label, range and help, and its docstring gives the
help text. The command line and the QGIS algorithm are made from this declaration alone.
"""

from __future__ import annotations

import functools
import inspect
import operator
import textwrap
import typing
from collections.abc import Callable, Iterable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, ParamSpec, Protocol, TypeVar, cast

from .call_paths import check_different, check_paths, inputs_of
from .errors import MemoryLimitError, ParameterError
from .kinds import Kind, RasterIn, RastersIn, WrittenKind
from .memory import bounded_cache
from .raster_names import local_files
from .runs import run_of_call, running
from .vrt_sources import sources_of


class ToolResult(Protocol):
    """What a tool returns: numbers for programs, lines for people.

    One that ran but not to a good end, as some rows of a table, has an `exit_code` besides.
    """

    def summary(self) -> dict[str, Any]:
        """Return the result as values that JSON can carry."""

    def lines(self) -> list[str]:
        """Return the result as lines of text."""


def given_files(asked: Mapping[str, Path | None]) -> dict[str, str]:
    """Return the files that were asked for, by name; None: not asked for."""
    return {name: str(path) for name, path in asked.items() if path is not None}


def file_lines(files: Mapping[str, Path | str]) -> list[str]:
    """Return a line of text for each file of a result, by name."""
    return [f"{name}: {path}" for name, path in files.items()]


P = ParamSpec("P")
R = TypeVar("R", bound=ToolResult)

# Values of a tool's parameters by their names, and what its keyword `parameters` has by default.
Values = Mapping[str, Any]
NO_VALUES: Values = MappingProxyType({})

# Parameters that decide where a call runs, and nothing of what it makes.
_WHERE_IT_RUNS = ("workers", "scheduler")

# Keywords of a tool's function that are no parameters: handed through from Python unchecked.
HANDED_THROUGH = ("progress", "executor")


@dataclass(frozen=True)
class Parameter:
    """A parameter of a tool: name, kind and default (None: chosen from the data, or left out).

    `required` is what the command line and QGIS require; Python requires no more, and less where
    the kind is `optional_in_python`.
    """

    name: str
    kind: Kind
    required: bool
    default: Any = None

    @property
    def positional(self) -> bool:
        """Whether the command line takes it by position, without an option's name."""
        return self.required and not self.kind.option

    def check(self, value: Any, called: str, *, in_python: bool = False) -> Any:
        """Return `value`, or the default for None, in its proper type.

        Raises `ParameterError` if it cannot be right; `called` is the parameter's name in it.
        """
        value = self.default if value is None else value
        if value is not None:
            return self.kind.check(called, value)
        if self.required and not (in_python and self.kind.optional_in_python):
            raise ParameterError(f"{called} is missing")
        return None


@dataclass(frozen=True)
class Output:
    """A number (or `text`) in a result's summary that QGIS models can go on with.

    `path` names its place in the summary, with dots between the levels.
    """

    name: str
    label: str
    path: str
    text: bool = False

    def value(self, summary: Mapping[str, Any]) -> Any:
        """Return this output's value in `summary`."""
        return functools.reduce(lambda level, key: level[key], self.path.split("."), summary)


@dataclass(frozen=True)
class Tool:
    """A tool: everything that the command line, Python and QGIS need of it.

    Its `common` parameters are those of a kind that is common to all tools (see `Kind`).
    """

    name: str
    title: str
    group: str
    summary: str
    description: str
    parameters: tuple[Parameter, ...]
    outputs: tuple[Output, ...]
    run: Callable[..., ToolResult]
    common: tuple[Parameter, ...] = ()

    @property
    def all_parameters(self) -> tuple[Parameter, ...]:
        """Its own parameters, and the common ones."""
        return (*self.parameters, *self.common)

    def parameter(self, name: str) -> Parameter:
        """Return the parameter called `name`."""
        return next(parameter for parameter in self.parameters if parameter.name == name)

    def run_of_call(self, checked: Mapping[str, Any]) -> str:
        """Return the id that all files of a call with these checked values carry (see `runs`)."""
        inputs = {
            p.name: _with_files(p.kind, checked[p.name])
            for p in self.parameters
            if p.name not in _WHERE_IT_RUNS and not isinstance(p.kind, WrittenKind)
        }
        return run_of_call(self.name, inputs)

    def check(
        self,
        values: Mapping[str, Any],
        spell: Callable[[Parameter], str] = operator.attrgetter("name"),
        *,
        in_python: bool = False,
    ) -> dict[str, Any]:
        """Return `values` completed with defaults and in their proper types.

        Parameters
        ----------
        values
            Values by the parameters' names; None and what is missing take the default.
        spell
            Gives a parameter the name that error messages call it by.
        in_python
            Whether what is `optional_in_python` may be left out.

        Raises
        ------
        ParameterError
            A value is missing, unknown, of the wrong type or out of its range.
        SameFileError
            Two of the rasters that the tool needs are one file, or an output would overwrite
            another file of this call.
        OutputError
            An output cannot be written.
        """
        unknown = set(values) - {parameter.name for parameter in self.all_parameters}
        if unknown:
            raise ParameterError(f"{self.name} has no parameter {sorted(unknown)[0]}")
        checked = {
            p.name: p.check(values.get(p.name), spell(p), in_python=in_python)
            for p in self.all_parameters
        }
        check_different(
            {
                spell(p): checked[p.name]
                for p in self.parameters
                if p.required and isinstance(p.kind, RasterIn)
            }
        )
        check_paths([(spell(p), p.kind, checked[p.name]) for p in self.parameters])
        return checked


def tool(
    *, title: str, group: str, outputs: tuple[Output, ...] = ()
) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Declare the decorated function as a tool (see `tool_of`).

    Its keywords `progress` and `executor` are handed through unchecked; every other parameter
    must be annotated with a `Kind`. If the function has a keyword `parameters`, it is given the
    checked values of all parameters by name, for its report; callers do not see this keyword.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        signature = inspect.signature(function)

        @functools.wraps(function)
        def checked(*args: P.args, **kwargs: P.kwargs) -> R:
            try:
                bound = signature.bind(*args, **kwargs).arguments
            except TypeError as error:
                raise TypeError(f"{function.__name__}() {error}") from None
            through = {key: bound.pop(key) for key in HANDED_THROUGH if key in bound}
            values = declared.check(bound, in_python=True)
            given = {"parameters": values} if "parameters" in signature.parameters else {}
            rasters = any(isinstance(p.kind, (RasterIn, RastersIn)) for p in declared.parameters)
            try:
                with (
                    running(declared.run_of_call(values)),
                    bounded_cache() if rasters else nullcontext(),
                ):
                    result = cast(Callable[..., R], function)(**values, **given, **through)
            except MemoryError as error:
                raise MemoryLimitError(f"memory does not suffice: {error}") from error
            if through.get("progress") is not None:
                through["progress"].finish()
            return result

        declared = _declare(function, signature, checked, title, group, outputs)
        checked.__signature__ = signature.replace(  # type: ignore[attr-defined]
            parameters=[p for p in signature.parameters.values() if p.name != "parameters"]
        )
        checked.__doc__ = _documented(inspect.getdoc(function) or "", declared.all_parameters)
        checked.__groundtie_tool__ = declared  # type: ignore[attr-defined]
        return checked

    return decorate


def _with_files(kind: Kind, value: Any) -> Any:
    """Return a checked value and the files that it stands for.

    These are the files that views or GDAL's names refer to, and the sources of virtual rasters.
    """
    files: list[Path] = []
    for given in inputs_of(kind, value):
        named = local_files(given) if isinstance(given, str) else [given]
        for path in (one for one in named if isinstance(one, Path)):
            files += [path, *sources_of(path)]
    return (value, *files) if files else value


def tool_of(function: Callable[..., Any]) -> Tool:
    """Return the declaration of a function that `tool` decorated."""
    return cast(Tool, function.__groundtie_tool__)  # type: ignore[attr-defined]


def _declare(
    function: Callable[..., Any],
    signature: inspect.Signature,
    run: Callable[..., Any],
    title: str,
    group: str,
    outputs: tuple[Output, ...],
) -> Tool:
    parameters = _parameters(function, signature)
    summary, _, rest = (inspect.getdoc(function) or "").partition("\n")
    description = rest.strip().partition("\nReturns\n")[0].strip()
    return Tool(
        name=function.__name__,
        title=title,
        group=group,
        summary=summary,
        description=description,
        parameters=tuple(p for p in parameters if not p.kind.common),
        outputs=outputs,
        run=run,
        common=tuple(p for p in parameters if p.kind.common),
    )


def _documented(text: str, parameters: Iterable[Parameter]) -> str:
    """Return a docstring with a section on parameters, for `help`."""
    start, returns, end = text.partition("\nReturns\n")
    lines = ["Parameters", "----------"]
    for parameter in parameters:
        form = parameter.kind.form
        lines.append(f"{parameter.name} : {form}" if form else parameter.name)
        lines += textwrap.wrap(
            parameter.kind.help, 96, initial_indent=" " * 4, subsequent_indent=" " * 4
        )
    return "\n".join([start.rstrip(), "", *lines]) + (f"\n{returns}{end}" if returns else "\n")


def _parameters(function: Callable[..., Any], signature: inspect.Signature) -> list[Parameter]:
    hints = typing.get_type_hints(function, include_extras=True)
    found = []
    for name, argument in signature.parameters.items():
        if name in ("parameters", *HANDED_THROUGH):
            continue
        # Python 3.10 wraps the type of what has the default None in one more Optional.
        parts = (hints[name], *typing.get_args(hints[name]))
        notes = [note for part in parts for note in getattr(part, "__metadata__", ())]
        kinds = [note for note in notes if isinstance(note, Kind)]
        if len(kinds) != 1:
            raise TypeError(f"{function.__name__}: parameter {name} has no kind")
        found.append(_parameter(name, kinds[0], argument.default))
    return found


def _parameter(name: str, kind: Kind, default: Any) -> Parameter:
    absent = default is inspect.Parameter.empty
    if kind.optional_in_python and default is not None:
        raise TypeError(f"parameter {name} is optional in Python: its default must be None")
    required = absent or kind.optional_in_python
    if not kind.label:
        kind = replace(kind, label=name.replace("_", " ").capitalize())
    return Parameter(name, kind, required, None if absent else default)
