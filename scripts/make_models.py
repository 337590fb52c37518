"""Write the models that the plugin ships, plugin/groundtie_qgis/models/*.model3; needs QGIS.

Like the tests, it runs with QGIS's Python: QT_QPA_PLATFORM=offscreen /usr/bin/python3
scripts/make_models.py.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
FOLDER = ROOT / "plugin" / "groundtie_qgis" / "models"
GROUP = "Models"


@dataclass(frozen=True)
class Step:
    """A tool in a model.

    Parameters
    ----------
    tool
        Name of the tool, which is also that of the step.
    inputs
        Sources of values, by parameter: `name` of an input of the model, `tool.OUTPUT` of another
        step, or `=value`.
    outputs
        Descriptions of the model's outputs, by parameter of the tool.
    """

    tool: str
    inputs: dict[str, str]
    outputs: dict[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Recipe:
    """A model: its name, texts, inputs (functions that make their definitions) and steps."""

    name: str
    title: str
    text: str
    inputs: dict[str, Callable[[str], Any]]
    steps: tuple[Step, ...]


def recipes() -> Iterator[Recipe]:
    """Describe all models."""
    report = {"REPORT": "Report"}
    registered = {"OUTPUT": "Registered image", "TIE_POINTS": "Tie points", **report}
    pair = {"REFERENCE": "reference", "INPUT": "input", "SEARCH_RADIUS": "radius"}
    yield Recipe(
        "sar_optical_by_the_ground",
        "SAR and optical by the ground alone",
        "Masks all of a radar image but homogeneous ground, and registers an optical image to what "
        "is left: for towns, whose walls and roofs lie elsewhere in a radar image.",
        {
            "reference": raster("Radar image"),
            "input": raster("Optical image"),
            "radius": metres("Search radius"),
        },
        (
            Step("mask_regions", {"INPUT": "reference"}, {"OUTPUT": "Ground"}),
            Step("coregister", {**pair, "REFERENCE_MASK": "mask_regions.OUTPUT"}, registered),
        ),
    )
    rpcs = {"IMAGE": "image", "DEM": "dem", "DEM_DATUM": "datum"}
    yield Recipe(
        "rpcs_to_orthoimage",
        "RPCs: ground control, refined RPCs, orthoimage, assessment",
        "Matches ground control for an image with RPCs in a reference image, refines the RPCs by "
        "it, orthorectifies the image on the reference's pixels, and compares both by eye.",
        {
            "image": raster("Image with RPCs"),
            "reference": raster("Reference image"),
            "dem": raster("Terrain model"),
            "datum": words("Heights above", ("ellipsoidal", "EGM96", "EGM2008")),
            "radius": metres("Search radius"),
        },
        (
            Step(
                "extract_gcps",
                {**rpcs, "REFERENCE": "reference", "SEARCH_RADIUS": "radius"},
                {"OUTPUT": "Ground control"},
            ),
            Step(
                "refine_rpc",
                {**rpcs, "GCPS": "extract_gcps.OUTPUT"},
                {"OUTPUT": "Refined RPCs", "RESIDUALS": "Residuals", **report},
            ),
            Step(
                "orthorectify",
                {**rpcs, "RPC": "refine_rpc.OUTPUT", "REFERENCE": "reference"},
                {"OUTPUT": "Orthoimage"},
            ),
            Step(
                "assess",
                {"REFERENCE": "reference", "INPUT": "orthorectify.OUTPUT"},
                {"REPORT": "Assessment"},
            ),
        ),
    )
    yield Recipe(
        "sar_sar_and_other_rasters",
        "SAR and SAR, and another raster of the same scene",
        "Registers a radar image to another one, and applies the same transform to another raster "
        "of its scene: another polarisation, the phase, a classification.",
        {
            "reference": raster("Reference image"),
            "input": raster("Input image"),
            "other": raster("Other raster of the input's scene"),
            "radius": metres("Search radius"),
        },
        (
            Step("match_sar_sar", pair, {**registered, "TRANSFORM": "Transform"}),
            Step(
                "warp",
                {
                    "INPUT": "other",
                    "REFERENCE": "reference",
                    "TRANSFORM": "match_sar_sar.TRANSFORM",
                },
                {"OUTPUT": "Other raster, registered"},
            ),
        ),
    )
    yield Recipe(
        "series_to_reference",
        "A series to one reference, without strong scatterers",
        "Masks the bright part of a radar image, and registers many dates to what is left.",
        {
            "reference": raster("Reference image"),
            "dates": rasters("Images of the series"),
            "radius": metres("Search radius"),
        },
        (
            Step("mask_threshold", {"INPUT": "reference", "MASK_HIGH_PERCENT": "=20"}),
            Step(
                "coregister_series",
                {
                    "INPUTS": "dates",
                    "REFERENCE": "reference",
                    "SEARCH_RADIUS": "radius",
                    "REFERENCE_MASK": "mask_threshold.OUTPUT",
                },
                {"OUTPUT_FOLDER": "Folder of the registered images", **report},
            ),
        ),
    )


def raster(label: str) -> Callable[[str], Any]:
    from qgis.core import QgsProcessingParameterRasterLayer

    return lambda name: QgsProcessingParameterRasterLayer(name, label)


def rasters(label: str) -> Callable[[str], Any]:
    from qgis.core import QgsProcessing, QgsProcessingParameterMultipleLayers

    return lambda name: QgsProcessingParameterMultipleLayers(name, label, QgsProcessing.TypeRaster)


def metres(label: str) -> Callable[[str], Any]:
    from qgis.core import QgsProcessingParameterNumber

    return lambda name: QgsProcessingParameterNumber(
        name, f"{label} [m]", QgsProcessingParameterNumber.Double, None, True, 0
    )


def words(label: str, choices: tuple[str, ...]) -> Callable[[str], Any]:
    from qgis.core import QgsProcessingParameterString

    return lambda name: QgsProcessingParameterString(
        name, f"{label} ({', '.join(choices)})", choices[0]
    )


def model(recipe: Recipe) -> Any:
    """Return the QGIS model of a recipe."""
    from qgis.core import QgsProcessingModelAlgorithm, QgsProcessingModelParameter
    from qgis.PyQt.QtCore import QPointF, QSizeF

    made = QgsProcessingModelAlgorithm(recipe.title, GROUP)
    made.setName(recipe.name)
    made.setHelpContent(
        {"TITLE": recipe.title, "ALG_DESC": recipe.text, "SHORT_DESCRIPTION": recipe.text}
    )
    for row, (name, maker) in enumerate(recipe.inputs.items()):
        box = QgsProcessingModelParameter(name)
        box.setPosition(QPointF(120, 80 + 100 * row))
        box.setSize(QSizeF(200, 40))
        made.addModelParameter(maker(name), box)
    made.setParameterOrder([*recipe.inputs])
    for column, step in enumerate(recipe.steps):
        child = _child(step)
        child.setPosition(QPointF(420 + 300 * column, 120 + 60 * column))
        child.setSize(QSizeF(220, 40))
        made.addChildAlgorithm(child)
    return made


def _child(step: Step) -> Any:
    from qgis.core import (
        QgsProcessingModelChildAlgorithm,
        QgsProcessingModelOutput,
    )
    from qgis.PyQt.QtCore import QPointF, QSizeF

    child = QgsProcessingModelChildAlgorithm(f"groundtie:{step.tool}")
    child.setChildId(step.tool)
    child.setDescription(child.algorithm().displayName())
    for definition in child.algorithm().parameterDefinitions():
        name, default = definition.name(), definition.defaultValue()
        if name in step.inputs:
            child.addParameterSources(name, [_source(step.inputs[name])])
        elif default is not None and not definition.isDestination():
            # as the designer does: a model does not apply defaults by itself
            child.addParameterSources(name, [_source(f"={default}")])
    outputs = {}
    for row, (name, text) in enumerate(step.outputs.items()):
        output = QgsProcessingModelOutput(text)
        output.setChildOutputName(name)
        output.setDescription(text)
        output.setPosition(QPointF(420, 260 + 60 * row))
        output.setSize(QSizeF(200, 30))
        outputs[text] = output
    child.setModelOutputs(outputs)
    return child


def _source(text: str) -> Any:
    from qgis.core import QgsProcessingModelChildParameterSource as Source

    if text.startswith("="):
        return Source.fromStaticValue(text[1:])
    step, _, output = text.partition(".")
    return Source.fromChildOutput(step, output) if output else Source.fromModelParameter(text)


def write(folder: Path) -> list[Path]:
    """Write all models into a folder; QGIS must be running with the provider.

    Raises
    ------
    ValueError
        A model is invalid.
    """
    paths = []
    for recipe in recipes():
        made = model(recipe)
        valid, problems = made.validate()
        if not valid:
            raise ValueError(f"{recipe.name}: {problems}")
        paths.append(folder / f"{recipe.name}.model3")
        made.toFile(str(paths[-1]))
    return paths


def main() -> int:
    os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")
    os.environ.setdefault("QT_HASH_SEED", "0")  # a fixed order of attributes
    sys.path[:0] = [str(ROOT / "plugin"), str(ROOT / "algorithms")]
    from qgis.core import QgsApplication

    application = QgsApplication([], False)
    QgsApplication.initQgis()
    import groundtie_qgis

    plugin = groundtie_qgis.classFactory(None)
    plugin.initProcessing()
    FOLDER.mkdir(exist_ok=True)
    for path in write(FOLDER):
        print(path)
    plugin.unload()
    QgsApplication.exitQgis()
    del application
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
