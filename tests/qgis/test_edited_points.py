"""Tie points that were edited on the map: their layer can be chosen, and edits count."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio
from noise_pairs import ORIGIN, write_pair

PX = [(60.0, 60.0), (300.0, 70.0), (80.0, 310.0), (310.0, 300.0), (200.0, 180.0)]
COLUMNS = "field=reference_crs:string&field=state:string&field=role:string"


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pair")
    write_pair(folder, 0)
    return folder


def drawn(layer: Any, shift: tuple[float, float]) -> list[Any]:
    """Return lines from the input's map to the same place moved by `shift`, without columns."""
    from qgis.core import QgsFeature, QgsGeometry, QgsPointXY

    lines = []
    for start in ORIGIN + np.array(PX) * [1, -1]:
        feature = QgsFeature(layer.fields())
        ends = [QgsPointXY(*start), QgsPointXY(*(start + shift))]
        feature.setGeometry(QgsGeometry.fromPolylineXY(ends))
        lines.append(feature)
    return lines


def warped_origin(provider: Any, layer: Any, pair: Path, output: Path) -> np.ndarray:
    """Warp the input by a layer's points; return how far its corner went."""
    from qgis.core import QgsProcessingContext, QgsProcessingFeedback, QgsProject

    context, feedback = QgsProcessingContext(), QgsProcessingFeedback()
    context.setProject(QgsProject.instance())
    values = {
        "INPUT": str(pair / "input.tif"),
        "OUTPUT": str(output),
        "TRANSFORM": layer,
        "MODEL": "translation",
        "RESAMPLING": "nearest",
    }
    algorithm = provider.algorithm("warp").create()
    valid, message = algorithm.checkParameterValues(values, context)
    assert valid, message
    _, finished = algorithm.run(values, context, feedback)
    assert finished, feedback.textLog()
    assert f"edited by hand: {len(PX)} points" in feedback.textLog()
    with rasterio.open(output) as made, rasterio.open(pair / "input.tif") as given:
        places = [np.array([raster.transform.c, raster.transform.f]) for raster in (made, given)]
        return places[0] - places[1]


def test_unsaved_lines_of_a_layer_count(provider: Any, pair: Path, tmp_path: Path) -> None:
    from qgis.core import QgsProject, QgsVectorLayer

    layer = QgsVectorLayer(f"LineString?crs=EPSG:32633&{COLUMNS}", "my points", "memory")
    layer.dataProvider().addFeatures(drawn(layer, (10.0, -6.0)))
    QgsProject.instance().addMapLayer(layer)
    try:
        moved = warped_origin(provider, layer.id(), pair, tmp_path / "a.tif")
        np.testing.assert_allclose(moved, [10, -6], atol=0.01)
        # all ends on the reference 50 m further east, and not yet saved
        layer.startEditing()
        for feature in layer.getFeatures():
            end = feature.geometry().asPolyline()[1]
            layer.moveVertex(end.x() + 50, end.y(), feature.id(), 1)
        moved = warped_origin(provider, layer, pair, tmp_path / "b.tif")
        np.testing.assert_allclose(moved, [60, -6], atol=0.01)
        layer.rollBack()
    finally:
        QgsProject.instance().clear()


def test_edits_of_a_geopackage_that_are_not_saved(
    provider: Any, pair: Path, tmp_path: Path
) -> None:
    from qgis.core import QgsProject, QgsVectorFileWriter, QgsVectorLayer

    memory = QgsVectorLayer("LineString?crs=EPSG:32633", "points", "memory")
    memory.dataProvider().addFeatures(drawn(memory, (0.0, 0.0)))
    options = QgsVectorFileWriter.SaveVectorOptions()
    context = QgsProject.instance().transformContext()
    path = str(tmp_path / "points.gpkg")
    QgsVectorFileWriter.writeAsVectorFormatV3(memory, path, context, options)
    layer = QgsVectorLayer(f"{path}|layername=points", "points")
    layer.startEditing()
    for number in [feature.id() for feature in layer.getFeatures()]:
        layer.deleteFeature(number)
    layer.addFeatures(drawn(layer, (5.0, 0.0)))
    moved = warped_origin(provider, layer, pair, tmp_path / "a.tif")
    np.testing.assert_allclose(moved, [5, 0], atol=0.01)
    layer.rollBack()


def test_the_dialog_offers_layers_for_points(provider: Any) -> None:
    from groundtie_qgis import compat

    definition = provider.algorithm("warp").parameterDefinition("TRANSFORM")
    assert definition.type() == "layer"
    assert definition.dataTypes() == [compat.GEOMETRY]
