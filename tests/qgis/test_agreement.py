"""What QGIS shows of every tool is its declaration."""

from __future__ import annotations

import json
import math
import re
from typing import Any

import pytest

from groundtie.declaration import Parameter, Tool
from groundtie.kinds import Band, Choice, FileIn, Number, OutputKind
from groundtie.tools import load_tools

INTEGER = 0  # of QgsProcessingParameterNumber.Type
TYPES = {
    "RasterIn": "raster",
    "RastersIn": "multilayer",
    "VectorIn": "vector",
    "MaskIn": "layer",
    "SurfaceIn": "layer",
    "FileIn": "file",
    "RasterOut": "rasterDestination",
    "VectorOut": "vectorDestination",
    "FileOut": "fileDestination",
    "FolderOut": "folderDestination",
    "Number": "number",
    "Distance": "number",
    "Choice": "enum",
    "Flag": "boolean",
    "Text": "string",
    "Views": "string",
    "Crs": "crs",
    "Band": "band",
}


@pytest.fixture(params=load_tools(), ids=lambda tool: tool.name)
def told(request: pytest.FixtureRequest, provider: Any) -> tuple[Tool, dict[str, Any]]:
    """A tool and what QGIS shows of it."""
    return request.param, shown_of(provider.algorithm(request.param.name))


def shown_of(algorithm: Any) -> dict[str, Any]:
    """Return what QGIS shows of an algorithm, as `qgis_process --json help` does."""
    from qgis.core import QgsProcessingAlgorithm, QgsProcessingParameterDefinition

    def has(definition: Any, flag: str) -> bool:
        return bool(definition.flags() & getattr(QgsProcessingParameterDefinition, f"Flag{flag}"))

    def shown(definition: Any) -> dict[str, Any]:
        numbered = enumerate(definition.options()) if definition.type() == "enum" else ()
        return {
            "type": definition.type(),
            "optional": has(definition, "Optional"),
            "is_advanced": has(definition, "Advanced"),
            "default_value": definition.defaultValue(),
            "description": definition.description(),
            "help": definition.help(),
            "raw_definition": definition.toVariantMap(),
            "available_options": {str(number): option for number, option in numbered},
        }

    return {
        "algorithm_details": {
            "name": algorithm.displayName(),
            "group": algorithm.group(),
            "short_description": algorithm.shortDescription(),
            "can_cancel": bool(algorithm.flags() & QgsProcessingAlgorithm.FlagCanCancel),
        },
        "parameters": {d.name(): shown(d) for d in algorithm.parameterDefinitions()},
        "outputs": {o.name(): {"type": o.type()} for o in algorithm.outputDefinitions()},
    }


def test_qgis_process_shows_the_same(provider: Any, qgis_process: Any) -> None:
    called = qgis_process("--json", "help", "groundtie:coregister")
    assert (called.returncode, called.stderr) == (0, "")
    printed = json.loads(called.stdout)
    for parameter in printed["parameters"].values():
        parameter["type"] = parameter["type"]["id"]
    shown = shown_of(provider.algorithm("coregister"))
    assert shown["algorithm_details"].items() <= printed["algorithm_details"].items()
    for part in ("parameters", "outputs"):
        assert set(shown[part]) == set(printed[part])
        for name, known in shown[part].items():
            assert {key: printed[part][name].get(key, {}) for key in known} == known


def each(told: tuple[Tool, dict[str, Any]]) -> list[tuple[Parameter, dict[str, Any]]]:
    tool, shown = told
    return [(p, shown["parameters"][p.name.upper()]) for p in tool.parameters]


def test_names(told: tuple[Tool, dict[str, Any]]) -> None:
    tool, shown = told
    assert set(shown["parameters"]) == {p.name.upper() for p in tool.parameters}
    details = shown["algorithm_details"]
    assert details["name"] == tool.title
    assert details["group"] == tool.group
    assert details["short_description"] == tool.summary
    assert details["can_cancel"]


def test_types(told: tuple[Tool, dict[str, Any]]) -> None:
    for parameter, shown in each(told):
        # a file that may hold a layer of points is chosen among the layers, too
        layers = isinstance(parameter.kind, FileIn) and ".gpkg" in parameter.kind.suffixes
        expected = "layer" if layers else TYPES[type(parameter.kind).__name__]
        assert shown["type"] == expected


def test_what_is_required(told: tuple[Tool, dict[str, Any]]) -> None:
    for parameter, shown in each(told):
        absent = not parameter.required and (
            parameter.default is None or isinstance(parameter.kind, Band)
        )
        assert shown["optional"] == absent
        if parameter.required:
            assert shown["default_value"] is None


def test_defaults(told: tuple[Tool, dict[str, Any]]) -> None:
    for parameter, shown in each(told):
        default, kind = parameter.default, parameter.kind
        if isinstance(kind, Choice) and default is not None:
            default = kind.choices.index(default)
        assert shown["default_value"] == default


def test_labels_units_and_help(told: tuple[Tool, dict[str, Any]]) -> None:
    for parameter, shown in each(told):
        unit = getattr(parameter.kind, "unit", "")
        assert shown["description"] == parameter.kind.label + (f" ({unit})" if unit else "")
        assert shown["help"] == with_titles(parameter.kind.help, told[0])


def with_titles(text: str, tool: Tool) -> str:
    """Return a help text with tools and parameters called as dialogs call them."""
    named = {other.name: other.title for other in load_tools()}
    named |= {parameter.name: parameter.kind.label for parameter in tool.parameters}
    for name in sorted(named, key=len, reverse=True):
        is_a_name = "_" in name or name == "coregister"
        bare = rf"|\b{name}\b" if is_a_name else ""
        text = re.sub(rf"`{name}`|the tool {name}\b{bare}", f"“{named[name]}”", text)
    return text


def test_what_is_advanced(told: tuple[Tool, dict[str, Any]]) -> None:
    for parameter, shown in each(told):
        assert shown["is_advanced"] == parameter.kind.advanced


def test_choices(told: tuple[Tool, dict[str, Any]]) -> None:
    for parameter, shown in each(told):
        if isinstance(parameter.kind, Choice):
            # qgis_process sorts the numbers of options as text: 10 comes before 2.
            options = sorted(shown["available_options"].items(), key=lambda option: int(option[0]))
            assert len({option for _, option in options}) == len(parameter.kind.choices)
            assert not [option for _, option in options if "_" in option]


def test_ranges(told: tuple[Tool, dict[str, Any]]) -> None:
    for parameter, shown in each(told):
        if isinstance(parameter.kind, Number):
            definition = shown["raw_definition"]
            for bound, shown_bound in (("minimum", "min"), ("maximum", "max")):
                declared, found = getattr(parameter.kind, bound), definition[shown_bound]
                # without a bound QGIS has the largest number that its type can hold
                assert found == declared if math.isfinite(declared) else abs(found) > 2e9
            assert (definition["data_type"] == INTEGER) == parameter.kind.integer


def test_outputs(told: tuple[Tool, dict[str, Any]]) -> None:
    tool, shown = told
    expected = {p.name.upper() for p in tool.parameters if isinstance(p.kind, OutputKind)}
    numbers = {o.name.upper(): "outputString" if o.text else "outputNumber" for o in tool.outputs}
    outputs = {name: output["type"] for name, output in shown["outputs"].items()}
    assert expected <= set(outputs)
    assert {n: t for n, t in outputs.items() if n in numbers} == numbers
