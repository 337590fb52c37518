"""The dialogs of the tools as a person sees them: what is preselected, and in which words.

A picture of each is left in the folder that GROUNDTIE_PICTURES names.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from noise_pairs import write_pair, write_raster

from groundtie.tools import NAMES


def add(path: Path) -> Any:
    from qgis.core import QgsProject, QgsRasterLayer

    layer = QgsRasterLayer(str(path), path.stem)
    assert layer.isValid()
    QgsProject.instance().addMapLayer(layer)
    return layer


def open_dialog(iface: Any, tool: str) -> Any:
    from processing.gui.AlgorithmDialog import AlgorithmDialog
    from qgis.core import QgsApplication

    algorithm = QgsApplication.processingRegistry().createAlgorithmById(f"groundtie:{tool}")
    return AlgorithmDialog(algorithm, False, iface.mainWindow())


def chosen(dialog: Any, *names: str) -> list[Any]:
    return [dialog.mainWidget().wrappers[name].parameterValue() for name in names]


@pytest.mark.parametrize("tool", ["register", "coregister", "match_sar_sar", "similarity_surface"])
def test_two_boxes_begin_with_two_layers(iface: Any, tmp_path: Path, tool: str) -> None:
    write_pair(tmp_path, 0)
    layers = {name: add(tmp_path / f"{name}.tif") for name in ("input", "reference")}
    for active in layers.values():
        iface.activeLayer.return_value = active
        dialog = open_dialog(iface, tool)
        assert set(chosen(dialog, "REFERENCE", "INPUT")) == {x.id() for x in layers.values()}
        dialog.close()


def test_what_has_smaller_pixels_or_more_bands_is_the_input(iface: Any, tmp_path: Path) -> None:
    from groundtie_qgis.preselection import proposed_pair, raster_files
    from rasterio.transform import from_origin

    ground = np.random.default_rng(0).uniform(1, 200, (3, 20, 20))
    coarse, fine = from_origin(5e5, 5e6, 10, 10), from_origin(5e5, 5e6, 2, 2)
    for name, bands, grid in (("a", 1, fine), ("b", 3, coarse), ("c", 1, coarse), ("d", 3, fine)):
        write_raster(tmp_path / f"{name}.tif", ground[:bands], grid)
    layers = {name: add(tmp_path / f"{name}.tif") for name in "abcd"}
    assert {layer.name() for layer in raster_files()} == set("abcd")
    for pair, expected in (("ab", "ba"), ("bc", "cb"), ("da", "ad"), ("dc", "cd")):
        proposed = proposed_pair([layers[name] for name in pair])
        assert "".join(layer.name() for layer in proposed) == expected
    three = [layers[name] for name in "cba"]
    assert {x.name() for x in proposed_pair(three, active=layers["a"])} == {"a", "c"}


def test_one_raster_alone_leaves_the_other_box_empty(iface: Any, tmp_path: Path) -> None:
    from processing.tools.dataobjects import createContext

    write_pair(tmp_path, 0)
    iface.activeLayer.return_value = layer = add(tmp_path / "reference.tif")
    dialog = open_dialog(iface, "coregister")
    reference, input = chosen(dialog, "REFERENCE", "INPUT")
    assert (reference, input.strip()) == (layer.id(), "")
    parameters = {"REFERENCE": reference, "INPUT": input, "OUTPUT": str(tmp_path / "o.tif")}
    algorithm = dialog.algorithm()
    valid, message = algorithm.checkParameterValues(parameters, createContext())
    assert (valid, message) == (False, "Input image is missing")
    dialog.close()


def add_lines(columns: str = "") -> Any:
    from qgis.core import QgsProject, QgsVectorLayer

    layer = QgsVectorLayer(f"LineString?crs=EPSG:32633{columns}", "lines", "memory")
    assert layer.isValid()
    QgsProject.instance().addMapLayer(layer)
    return layer


def offered(dialog: Any, name: str) -> set[str]:
    """Return the names of the layers that a box offers."""
    from qgis.PyQt.QtWidgets import QComboBox

    (box,) = dialog.mainWidget().wrappers[name].wrappedWidget().findChildren(QComboBox)
    return {box.itemText(index).partition(" [")[0] for index in range(box.count())} - {"", " "}


@pytest.mark.parametrize(
    ("tool", "raster", "points"),
    [("warp", "INPUT", "TRANSFORM"), ("assess_sensor", "IMAGE", "CHECK_POINTS")],
)
def test_a_raster_is_never_proposed_as_points(
    iface: Any, tmp_path: Path, tool: str, raster: str, points: str
) -> None:
    write_pair(tmp_path, 0)
    iface.activeLayer.return_value = add(tmp_path / "input.tif")
    add_lines()
    dialog = open_dialog(iface, tool)
    first, second = chosen(dialog, raster, points)
    assert (first, second.strip()) == (iface.activeLayer().id(), "")
    assert offered(dialog, points) == {"lines"}
    dialog.close()
    tie_points = add_lines("&field=input_col:double&field=input_row:double")
    dialog = open_dialog(iface, tool)
    assert chosen(dialog, points) == [tie_points.id()]
    dialog.close()


def test_a_mask_may_be_picked_among_rasters_and_vector_layers(iface: Any, tmp_path: Path) -> None:
    write_pair(tmp_path, 0)
    iface.activeLayer.return_value = add(tmp_path / "input.tif")
    add_lines()
    dialog = open_dialog(iface, "mask_surface")
    assert offered(dialog, "SURFACE_MODEL") == {"input", "lines"}
    reference, surface = chosen(dialog, "REFERENCE", "SURFACE_MODEL")
    assert (reference, surface.strip()) == (iface.activeLayer().id(), "")
    dialog.close()


@pytest.mark.parametrize("name", NAMES)
def test_no_dialog_shows_the_words_of_the_command_line(
    iface: Any, tmp_path: Path, name: str
) -> None:
    from qgis.PyQt.QtWidgets import QComboBox, QLabel

    write_pair(tmp_path, 0)
    for image in ("reference", "input"):
        add(tmp_path / f"{image}.tif")
    dialog = open_dialog(iface, name)
    keep_picture(dialog, name, tmp_path)
    algorithm = dialog.algorithm()
    shown = [label.text() for label in dialog.findChildren(QLabel)]
    for box in dialog.findChildren(QComboBox):
        shown += [box.itemText(index) for index in range(box.count())]
    shown += [definition.help() for definition in algorithm.parameterDefinitions()]
    shown.append(algorithm.shortHelpString())
    leaked = set(re.findall(r"\w+_\w+(?![\w.]*\.\w)", " ".join(shown))) & {
        *NAMES,
        *parameter_names(),
    }
    assert not leaked
    assert not re.search(r"thesis|the same for|`", " ".join(shown))
    assert not [text for text in shown if text.islower() and text.isidentifier()]
    dialog.close()


def keep_picture(dialog: Any, name: str, folder: Path) -> None:
    pictures = Path(os.environ.get("GROUNDTIE_PICTURES") or folder)
    pictures.mkdir(parents=True, exist_ok=True)
    dialog.resize(1000, 700)
    dialog.show()
    assert dialog.grab().save(str(pictures / f"dialog_{name}.png"))


def parameter_names() -> set[str]:
    from groundtie.tools import load_tools

    return {parameter.name for tool in load_tools() for parameter in tool.parameters}


def test_a_crs_is_picked(iface: Any) -> None:
    from qgis.core import QgsCoordinateReferenceSystem
    from qgis.PyQt.QtWidgets import QWidget

    dialog = open_dialog(iface, "orthorectify")
    widgets = {widget.metaObject().className() for widget in dialog.findChildren(QWidget)}
    assert "QgsProjectionSelectionWidget" in widgets
    wrapper = dialog.mainWidget().wrappers["CRS"]
    for code, expected in ((None, None), ("EPSG:32632", "EPSG:32632")):
        crs = QgsCoordinateReferenceSystem(code) if code else QgsCoordinateReferenceSystem()
        wrapper.setParameterValue(crs, dialog.mainWidget().processing_context)
        (value,) = chosen(dialog, "CRS")
        assert read(dialog.algorithm(), "orthorectify", CRS=value) == expected
    dialog.close()


def read(algorithm: Any, tool: str, **values: Any) -> Any:
    """Return what a tool gets for one value of its algorithm."""
    from groundtie_qgis.library import library_module
    from groundtie_qgis.values import Reader
    from qgis.core import QgsProcessingContext, QgsProcessingFeedback

    ((name, _),) = values.items()
    parameter = library_module("tools").load_tool(tool).parameter(name.lower())
    context = QgsProcessingContext()
    return Reader(algorithm, values, context, QgsProcessingFeedback()).read(parameter)


def test_a_crs_without_a_code_keeps_its_text(provider: Any) -> None:
    from qgis.core import QgsCoordinateReferenceSystem

    crs = QgsCoordinateReferenceSystem.fromProj("+proj=utm +zone=33 +ellps=bessel")
    algorithm = provider.algorithm("orthorectify").create()
    assert "Bessel" in read(algorithm, "orthorectify", CRS=crs)


@pytest.mark.parametrize(
    ("given", "word"),
    [(7, "tps"), ("7", "tps"), ("tps", "tps"), ("Thin-plate spline", "tps"), (0, "auto")],
)
def test_a_choice_is_a_number_a_label_or_a_word(provider: Any, given: Any, word: str) -> None:
    algorithm = provider.algorithm("coregister").create()
    definition = algorithm.parameterDefinition("MODEL")
    for one in (definition, definition.clone()):
        assert one.checkValueIsAcceptable(given)
        assert one.options()[7] == "Thin-plate spline"
    assert read(algorithm, "coregister", MODEL=given) == word


@pytest.mark.parametrize("given", [8, -1, "spline", "٣"])
def test_what_is_no_choice_is_refused(provider: Any, given: Any) -> None:
    algorithm = provider.algorithm("coregister").create()
    assert not algorithm.parameterDefinition("MODEL").checkValueIsAcceptable(given)


def test_numbers_of_the_help_are_accepted(qgis_process: Any, tmp_path: Path) -> None:
    """What `qgis_process help` offers, and the command line's word beside it."""
    listed = qgis_process("help", "groundtie:filter_speckle").stdout
    number = re.search(r"(\d): Lee\b", listed)
    assert number
    write_pair(tmp_path, 0)
    sizes = set()
    for given in (number.group(1), "lee"):
        out = tmp_path / f"{given}.tif"
        words = (f"INPUT={tmp_path / 'input.tif'}", f"FILTER={given}", "LOOKS=4", f"OUTPUT={out}")
        called = qgis_process("run", "groundtie:filter_speckle", "--", *words)
        assert called.returncode == 0, called.stderr
        sizes.add(out.read_bytes())
    assert len(sizes) == 1
