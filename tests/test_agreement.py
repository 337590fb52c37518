"""The command line and the Python function of every tool say the same as its declaration.

QGIS, the third, is compared in tests/qgis/test_agreement.py. They differ in one thing: what is
`optional_in_python` (a registered image, say) must be named where nothing can be returned.
"""

from __future__ import annotations

import inspect
import re
from pathlib import Path

import pytest
import toys
from toys import run_tools

import groundtie
from groundtie.cli import spelled
from groundtie.declaration import HANDED_THROUGH, Parameter, Tool
from groundtie.kinds import Band, Choice, Flag, Kind, Number, OutputKind
from groundtie.tools import load_tools

TOOLS = load_tools()
ALL = [toys.TOY, toys.RETURNING_TOY, *TOOLS]
each_tool = pytest.mark.parametrize("tool", ALL, ids=lambda tool: tool.name)
each_real_tool = pytest.mark.parametrize("tool", TOOLS, ids=lambda tool: tool.name)
EVERY = [
    pytest.param(tool, p, id=f"{tool.name}-{p.name}") for tool in ALL for p in tool.all_parameters
]
NUMBERS = [case for case in EVERY if isinstance(case.values[1].kind, Number)]
CHOICES = [case for case in EVERY if isinstance(case.values[1].kind, Choice)]
# `name` is a column of the tables of batch.
RESERVED = {"json", "quiet", "help", "parameters", "name", *HANDED_THROUGH}


def option(parameter: Parameter) -> str:
    return "--" + parameter.name.replace("_", "-")


def help_text(tool: Tool, capsys: pytest.CaptureFixture[str]) -> str:
    assert run_tools([tool.name.replace("_", "-"), "--help"], [tool]) == 0
    return capsys.readouterr().out


def entry(tool: Tool, parameter: Parameter, capsys: pytest.CaptureFixture[str]) -> str:
    """Return the help's entry of a parameter, without spaces: lines break at hyphens, too."""
    name = parameter.name.replace("_", "-")
    start = name.upper() if parameter.positional else f"--{name}"
    entries = re.split(r"\n  (?=\S)", help_text(tool, capsys))
    found = [text for text in entries if re.match(rf"{start}(?![\w-])", text)]
    assert len(found) == 1
    return squeezed(found[0].partition("\n\n")[0])


def squeezed(text: object) -> str:
    return "".join(str(text).split())


def call(tool: Tool, values: dict[str, str]) -> list[str]:
    """Return the words of a call with these values and fitting ones for what is required."""
    words = [tool.name.replace("_", "-")]
    for parameter in tool.all_parameters:
        value = values.get(parameter.name)
        if value is None and parameter.required:
            value = fitting(parameter.name, parameter.kind)
        if value is not None:
            words += [value] if parameter.positional else [option(parameter), value]
    return words


def fitting(name: str, kind: Kind) -> str:
    if isinstance(kind, Number):
        return str(kind.minimum)
    if isinstance(kind, Choice):
        return kind.choices[0]
    return name + (kind.suffixes[0] if isinstance(kind, OutputKind) else ".tif")


@each_real_tool
def test_the_package_offers_the_function(tool: Tool) -> None:
    assert getattr(groundtie, tool.name) is tool.run
    assert tool.run.__name__ == tool.name


@each_tool
def test_python_has_the_same_parameters_with_the_same_defaults(tool: Tool) -> None:
    parameters = inspect.signature(tool.run).parameters
    needed = {p.name for p in tool.all_parameters if p.required and not p.kind.optional_in_python}
    declared = {
        p.name: inspect.Parameter.empty if p.name in needed else p.default
        for p in tool.all_parameters
    }
    assert {n: p.default for n, p in parameters.items() if n not in HANDED_THROUGH} == declared
    own = [p.name for p in tool.parameters]
    assert [name for name in parameters if name in own] == own


@each_tool
def test_only_outputs_may_be_left_out_in_python_alone(tool: Tool) -> None:
    for parameter in tool.parameters:
        if parameter.kind.optional_in_python:
            assert isinstance(parameter.kind, OutputKind)
            assert (parameter.required, parameter.default) == (True, None)


@each_tool
def test_the_command_line_needs_what_is_required(
    tool: Tool, capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    words = call(tool, {})
    for word in words[1:]:
        if not word.startswith("--"):
            at = words.index(word)
            name = [words[at - 1]] if words[at - 1].startswith("--") else []
            less = words[: at - len(name)] + words[at + 1 :]
            assert run_tools(less, [tool]) == 2
            # What is left moves up, where a choice is the first to look at it.
            assert re.search("issing|must be one of", capsys.readouterr().err)


@each_tool
def test_the_declaration_is_complete(tool: Tool) -> None:
    assert tool.title and tool.group
    assert re.fullmatch(r"[A-Z].*\.", tool.summary)
    assert not RESERVED & {parameter.name for parameter in tool.all_parameters}
    for parameter in tool.all_parameters:
        assert re.fullmatch(r"[a-z][a-z0-9_]*", parameter.name)
        assert parameter.kind.label and parameter.kind.help.endswith((".", ")"))
        assert "\n" not in parameter.kind.help
        assert not (parameter.required and parameter.kind.advanced)


@each_real_tool
def test_a_tool_shows_at_most_ten_parameters_to_begin_with(tool: Tool) -> None:
    assert sum(not parameter.kind.advanced for parameter in tool.parameters) <= 10


@each_tool
def test_labels_tell_parameters_apart(tool: Tool) -> None:
    labels = [parameter.kind.label for parameter in tool.parameters]
    assert len(set(labels)) == len(labels)


@pytest.mark.parametrize(("tool", "parameter"), EVERY)
def test_a_default_is_a_value_that_the_kind_takes(tool: Tool, parameter: Parameter) -> None:
    if parameter.default is not None:
        assert parameter.kind.check(parameter.name, parameter.default) == parameter.default
    if isinstance(parameter.kind, Flag):
        assert isinstance(parameter.default, bool)
    if isinstance(parameter.kind, Band):
        assert tool.parameter(parameter.kind.of)


@pytest.mark.slow
@pytest.mark.parametrize(("tool", "parameter"), EVERY)
def test_the_help_of_the_command_line_tells_all(
    tool: Tool, parameter: Parameter, capsys: pytest.CaptureFixture[str]
) -> None:
    text = entry(tool, parameter, capsys)
    kind = parameter.kind
    assert squeezed(kind.help) in text
    notes = text.rpartition("[")[2] if text.endswith("]") else ""
    if isinstance(kind, Number):
        assert all(squeezed(word) in notes for word in (kind.unit, kind.range_text))
    if isinstance(kind, Choice):
        assert f"[{'|'.join(kind.choices)}]" in text
    if isinstance(kind, Flag):
        assert f"--no-{parameter.name.replace('_', '-')}" in text
        assert f"default:{'yes' if parameter.default else 'no'}" in notes
    elif parameter.default is not None:
        assert f"default:{squeezed(parameter.default)}" in notes
    else:
        assert "default:" not in notes
    assert ("required" in notes) == (parameter.required and not parameter.positional)


@each_tool
def test_advanced_options_come_last(tool: Tool, capsys: pytest.CaptureFixture[str]) -> None:
    plain, _, advanced = help_text(tool, capsys).partition("\nAdvanced options:\n")
    for parameter in tool.parameters:
        if not parameter.positional:
            section = advanced if parameter.kind.advanced else plain
            assert re.search(rf"(?m)^  {option(parameter)}\b", section)


@pytest.mark.parametrize(("tool", "parameter"), NUMBERS)
def test_both_refuse_what_is_out_of_range(
    tool: Tool,
    parameter: Parameter,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    kind = parameter.kind
    assert isinstance(kind, Number)
    for value in (kind.minimum - 1, kind.maximum + 1):
        if abs(value) < 1e300:
            assert run_tools(call(tool, {parameter.name: str(value)}), [tool]) == 2
            assert f"{option(parameter)} must be {kind.range_text}" in capsys.readouterr().err
            required = {p.name: fitting(p.name, p.kind) for p in tool.parameters if p.required}
            with pytest.raises(
                ValueError, match=re.escape(f"{parameter.name} must be {kind.range_text}")
            ):
                tool.run(**{**required, parameter.name: value})


@pytest.mark.parametrize(("tool", "parameter"), CHOICES)
def test_both_refuse_what_is_no_choice(
    tool: Tool,
    parameter: Parameter,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert run_tools(call(tool, {parameter.name: "no-such"}), [tool]) == 2
    assert f"{spelled(parameter)} must be one of" in capsys.readouterr().err
    required = {p.name: fitting(p.name, p.kind) for p in tool.parameters if p.required}
    with pytest.raises(ValueError, match=f"{parameter.name} must be one of"):
        tool.run(**{**required, parameter.name: "no-such"})
