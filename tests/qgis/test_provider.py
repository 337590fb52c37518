"""The plugin and its provider, as QGIS meets them."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path
from typing import Any

import pytest

from groundtie.tools import NAMES

TOOLS = set(NAMES)


def test_the_provider_offers_every_tool(provider: Any) -> None:
    from groundtie_qgis.tool_loading import all_tools

    offered = {a.name() for a in provider.algorithms() if a.group() != "Models"}
    assert offered == {tool.name for tool in all_tools()}
    assert offered >= TOOLS


def test_the_provider_names_itself(provider: Any) -> None:
    from groundtie_qgis.library import plugin_metadata

    assert provider.id() == "groundtie"
    assert provider.name() == "GroundTie"
    assert provider.versionInfo() == plugin_metadata()["version"]
    assert provider.warningMessage() == ""


def test_icons_can_be_drawn(provider: Any) -> None:
    assert not provider.icon().pixmap(32, 32).toImage().isNull()
    for algorithm in provider.algorithms():
        image = algorithm.icon().pixmap(32, 32).toImage()
        colours = {image.pixel(x, y) for x in range(image.width()) for y in range(image.height())}
        assert len(colours) > 3
        assert Path(algorithm.svgIconPath()).exists()


def test_outputs_may_have_the_endings_that_tools_write(provider: Any) -> None:
    assert provider.supportedOutputRasterLayerExtensions()[0] == "tif"
    assert provider.supportedOutputVectorLayerExtensions()[:2] == ["gpkg", "geojson"]
    assert not provider.supportsNonFileBasedOutput()


def test_help_is_filled_in(provider: Any) -> None:
    from qgis.PyQt.QtCore import QUrl

    for algorithm in provider.algorithms():
        if algorithm.group() == "Models":
            continue
        assert algorithm.displayName()
        assert algorithm.group()
        assert algorithm.groupId().replace("_", "").isalnum()
        assert algorithm.shortDescription().endswith(".")
        assert "registration" in algorithm.tags()
        if algorithm.name() != "toy":  # the Help button opens the tool's page in the plugin
            page = QUrl(algorithm.helpUrl()).toLocalFile()
            assert Path(page).stem == algorithm.name().replace("_", "-")
            assert Path(page).is_file()
        help_html = algorithm.shortHelpString()
        for definition in algorithm.parameterDefinitions():
            assert definition.help()
            label = definition.description().partition(" (")[0]
            assert f"<b>{label}</b>: " in help_html


def test_help_text_is_text_not_markup(provider: Any) -> None:
    from dataclasses import replace

    from groundtie_qgis.adapter import help_html

    tool = provider.algorithm("toy")._tool
    shown = help_html(replace(tool, description="a < b & c\nd\n\nnext"))
    assert "<p>a &lt; b &amp; c d</p>\n<p>next</p>" in shown


def test_copies_of_an_algorithm_are_alike(provider: Any) -> None:
    algorithm = provider.algorithm("toy")
    copy = algorithm.create()
    assert copy.id() == "groundtie:toy"
    one, other = ([d.name() for d in a.parameterDefinitions()] for a in (algorithm, copy))
    assert one == other != []


def test_the_plugin_takes_its_provider_away(plugin: Any) -> None:
    from qgis.core import QgsApplication

    registry = QgsApplication.processingRegistry()
    plugin.unload()
    assert registry.providerById("groundtie") is None
    plugin.unload()  # twice does no harm
    plugin.initProcessing()  # as without a desktop
    assert registry.providerById("groundtie") is plugin.provider


@pytest.mark.parametrize("module", ["adapter", "provider", "styling", "values", "definitions"])
def test_enumerations_are_named_in_compat_alone(module: str, toy_plugin_folder: Path) -> None:
    source = (toy_plugin_folder / "groundtie_qgis" / f"{module}.py").read_text()
    assert "PyQt5" not in source
    assert "Flag." not in source
    assert "exec_" not in source


def test_qgis_process_lists_the_tools(qgis_process: Any) -> None:
    listed: subprocess.CompletedProcess[str] = qgis_process("list")
    assert listed.returncode == 0
    assert listed.stderr == ""
    offered = set(re.findall(r"\bgroundtie:(\w+)", listed.stdout))
    assert offered >= TOOLS


def test_the_endings_are_those_of_the_tools(plugin: Any) -> None:
    from groundtie_qgis.provider import RASTERS, VECTORS

    from groundtie.kinds import RasterOut, VectorOut
    from groundtie.tools import load_tools

    for kind, endings in ((RasterOut, RASTERS), (VectorOut, VECTORS)):
        found = {
            suffix[1:]
            for tool in load_tools()
            for parameter in tool.parameters
            if isinstance(parameter.kind, kind)
            for suffix in parameter.kind.suffixes
        }
        assert set(endings) == found
