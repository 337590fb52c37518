"""Every kind of parameter becomes a fitting definition, value and output."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

TYPES = {
    "REFERENCE": "raster",
    "INPUT": "raster",
    "OUTPUT": "rasterDestination",
    "SIZE": "number",
    "SEARCH_RADIUS": "number",
    "MODE": "enum",
    "BAND": "band",
    "CAREFUL": "boolean",
    "TITLE": "string",
    "TIE_POINTS": "vectorDestination",
    "REPORT": "fileDestination",
    "FOLDER": "folderDestination",
    "REGIONS": "vector",
    "TRANSFORM": "file",
    "MASK": "layer",
    "OTHERS": "multilayer",
    "SEED": "number",
}


@pytest.fixture
def definitions(provider: Any) -> dict[str, Any]:
    return {d.name(): d for d in provider.algorithm("toy").parameterDefinitions()}


def test_every_kind_has_its_type(definitions: dict[str, Any]) -> None:
    assert {name: d.type() for name, d in definitions.items()} == TYPES


def test_optional_is_what_may_be_absent(definitions: dict[str, Any]) -> None:
    optional = {n for n, d in definitions.items() if d.flags() & d.FlagOptional}
    assert optional == {
        "SEARCH_RADIUS",
        "BAND",
        "TITLE",
        "TIE_POINTS",
        "REPORT",
        "FOLDER",
        "REGIONS",
        "TRANSFORM",
        "MASK",
        "OTHERS",
    }


def test_advanced_parameters_are_folded_away(definitions: dict[str, Any]) -> None:
    advanced = {n for n, d in definitions.items() if d.flags() & d.FlagAdvanced}
    assert advanced == {"REGIONS", "TRANSFORM", "MASK", "OTHERS", "SEED"}


def test_defaults(definitions: dict[str, Any]) -> None:
    defaults = {n: d.defaultValue() for n, d in definitions.items()}
    given = {"MODE": 0, "BAND": 1, "CAREFUL": True, "SEED": 7}
    assert defaults == {**dict.fromkeys(TYPES), **given}


def test_what_can_be_looked_at_is_made_by_default(provider: Any) -> None:
    for name in ("register", "coregister", "match_sar_sar", "match_optical"):
        shown = {
            d.name()
            for d in provider.algorithm(name).parameterDefinitions()
            if d.isDestination() and d.createByDefault()
        }
        assert shown == {"OUTPUT", "TIE_POINTS", "REPORT"}


def test_labels_carry_units_and_helps_are_filled_in(definitions: dict[str, Any]) -> None:
    assert definitions["SIZE"].description() == "Size (px)"
    assert definitions["SEARCH_RADIUS"].description() == "Search radius (m)"
    assert definitions["MODE"].description() == "Mode"
    assert definitions["SIZE"].help() == "How large."
    assert all(d.help() for d in definitions.values())


def test_numbers_keep_their_ranges(definitions: dict[str, Any]) -> None:
    size, radius, seed = (definitions[n] for n in ("SIZE", "SEARCH_RADIUS", "SEED"))
    assert (size.minimum(), size.maximum()) == (1, 9)
    assert radius.minimum() == 0
    assert radius.maximum() > 1e300
    assert size.dataType() == size.Double
    assert seed.dataType() == seed.Integer


def test_choices_have_labels(definitions: dict[str, Any]) -> None:
    assert definitions["MODE"].options() == ["Work", "Refuse", "Crash", "Wait"]


def test_a_band_follows_its_raster(definitions: dict[str, Any]) -> None:
    assert definitions["BAND"].parentLayerParameterName() == "INPUT"


def test_a_mask_is_a_raster_or_a_vector_layer_or_a_file(
    definitions: dict[str, Any], tmp_path: Path
) -> None:
    from groundtie_qgis import compat
    from qgis.core import QgsProcessingContext

    mask = definitions["MASK"]
    assert set(mask.dataTypes()) == {compat.RASTER, compat.GEOMETRY}
    classifier = tmp_path / "classifier.json"
    context = QgsProcessingContext()
    for one in (mask, mask.clone()):
        assert not one.checkValueIsAcceptable(str(classifier), context)
    classifier.write_text("{}")
    for one in (mask, mask.clone()):
        assert (one.name(), one.description()) == ("MASK", "Mask")
        assert one.checkValueIsAcceptable(str(classifier), context)
        assert one.flags() == mask.flags()
    classifier.unlink()


def test_files_have_filters(definitions: dict[str, Any]) -> None:
    assert definitions["REPORT"].fileFilter() == "HTML files (*.html)"
    assert definitions["TRANSFORM"].fileFilter() == "JSON files (*.json *.JSON)"
    assert definitions["TRANSFORM"].checkValueIsAcceptable("/nowhere/T.JSON")
    assert definitions["OUTPUT"].defaultFileExtension() == "tif"
    assert definitions["TIE_POINTS"].defaultFileExtension() == "gpkg"


def test_optional_outputs_are_not_made_unasked(definitions: dict[str, Any]) -> None:
    created = {
        name: definitions[name].createByDefault()
        for name in ("OUTPUT", "TIE_POINTS", "REPORT", "FOLDER")
    }
    assert created == {"OUTPUT": True, "TIE_POINTS": False, "REPORT": False, "FOLDER": False}


def test_outputs_are_declared(provider: Any) -> None:
    outputs = {o.name(): o.type() for o in provider.algorithm("toy").outputDefinitions()}
    assert outputs == {
        "OUTPUT": "outputRaster",
        "TIE_POINTS": "outputVector",
        "REPORT": "outputHtml",
        "FOLDER": "outputFolder",
        "CHECK_RMSE_PX": "outputNumber",
        "REASON": "outputString",
    }


def test_an_unknown_kind_is_a_mistake_of_ours(provider: Any) -> None:
    from groundtie_qgis.definitions import definition
    from groundtie_qgis.library import kinds, library_module

    parameter = library_module("declaration").Parameter
    with pytest.raises(TypeError, match="no Processing parameter for Kind"):
        definition(parameter("odd", kinds.Kind(label="Odd", help="Odd."), required=True))


def test_the_library_in_use_is_the_bundled_one(provider: Any, toy_plugin_folder: Path) -> None:
    from groundtie_qgis import library

    assert library.library_name() == "groundtie_qgis.groundtie"
    assert Path(library.kinds.__file__).is_relative_to(toy_plugin_folder)
