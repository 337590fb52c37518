"""The style of tie points: it is put on when QGIS loads them, and draws what it says."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

FIELDS = "field=role:string&field=state:string&field=residual_px:double&field=score:double"
# role, state, residual -> key of the rule that draws it
CASES = {
    ("fit", "used", 0.4): "fit1",
    ("fit", "used", 1.0): "fit1",
    ("fit", "used", 1.5): "fit2",
    ("fit", "used", 2.5): "fit3",
    ("check", "used", 0.4): "check1",
    ("check", "used", 2.0): "check2",
    ("check", "used", 9.0): "check3",
    ("fit", "rejected: forward–backward error", 0.1): "rejected",
    ("check", "rejected: outlier", 9.0): "rejected",
}


def tie_points(*rows: tuple[str, str, float]) -> Any:
    """Return a layer of lines, one a row, 10 m long and 10 m apart."""
    from qgis.core import QgsFeature, QgsGeometry, QgsPointXY, QgsVectorLayer

    layer = QgsVectorLayer(f"LineString?crs=EPSG:32633&{FIELDS}", "tie_points", "memory")
    features = []
    for number, row in enumerate(rows):
        feature = QgsFeature(layer.fields())
        ends = [QgsPointXY(0, 10 * number), QgsPointXY(10, 10 * number)]
        feature.setGeometry(QgsGeometry.fromPolylineXY(ends))
        feature.setAttributes([*row, 5.0])
        features.append(feature)
    layer.dataProvider().addFeatures(features)
    layer.updateExtents()
    return layer


def process(layer: Any) -> str:
    """Have the post-processor of tie points style a layer; return the log."""
    from groundtie_qgis.library import FOLDER
    from groundtie_qgis.styling import Styler
    from qgis.core import QgsProcessingContext, QgsProcessingFeedback

    feedback = QgsProcessingFeedback()
    styler = Styler(str(FOLDER / "styles" / "tie_points.qml"))
    styler.postProcessLayer(layer, QgsProcessingContext(), feedback)
    return str(feedback.textLog())


def colour_at(layer: Any, x: float, y: float) -> tuple[int, int, int]:
    """Draw the layer and return the colour at a place of the map."""
    from qgis.core import QgsMapRendererSequentialJob, QgsMapSettings, QgsRectangle
    from qgis.PyQt.QtCore import QSize

    settings = QgsMapSettings()
    settings.setLayers([layer])
    settings.setExtent(QgsRectangle(-5, -5, 95, 95))
    settings.setOutputSize(QSize(400, 400))
    settings.setDestinationCrs(layer.crs())
    job = QgsMapRendererSequentialJob(settings)
    job.start()
    job.waitForFinished()
    colour = job.renderedImage().pixelColor(round((x + 5) * 4), round((95 - y) * 4))
    return colour.red(), colour.green(), colour.blue()


@pytest.mark.parametrize(("row", "key"), CASES.items())
def test_one_rule_draws_each_point(plugin: Any, row: tuple[str, str, float], key: str) -> None:
    from qgis.core import QgsRenderContext

    layer = tie_points(row)
    assert process(layer) == ""
    feature, context = next(layer.getFeatures()), QgsRenderContext()
    context.expressionContext().setFields(layer.fields())
    context.expressionContext().setFeature(feature)
    renderer = layer.renderer()
    renderer.startRender(context, layer.fields())
    keys = renderer.legendKeysForFeature(feature, context)
    renderer.stopRender(context)
    groups = {"root", "fit", "check"}
    assert keys - groups == {key}


def test_lines_show_their_residual_by_colour(plugin: Any) -> None:
    layer = tie_points(("fit", "used", 0.5), ("fit", "used", 1.5), ("check", "used", 3.0))
    process(layer)
    green, orange, red = (colour_at(layer, 5, y) for y in (0, 10, 20))
    assert green[1] > green[0] + 50
    assert orange[0] > 200 > orange[2] + 100
    assert red[0] > red[1] + 100
    assert orange[1] > red[1] + 50


def test_rejected_points_are_grey_and_thin(plugin: Any) -> None:
    layer = tie_points(("fit", "rejected: outlier", 8.0), ("fit", "used", 8.0))
    process(layer)
    rules = [rule for rule in layer.renderer().rootRule().descendants() if rule.symbol()]
    lines = {rule.ruleKey(): rule.symbol().symbolLayer(0) for rule in rules}
    grey = lines.pop("rejected")
    assert grey.color().saturation() == 0
    assert all(grey.width() < line.width() for line in lines.values())


def test_a_mark_stands_at_the_place_on_the_reference(plugin: Any) -> None:
    layer = tie_points(("check", "used", 0.5))
    process(layer)
    white = (255, 255, 255)
    assert colour_at(layer, 0, 1.2) == white
    assert colour_at(layer, 10, 1.2) != white


def test_the_map_tip_tells_the_numbers(plugin: Any) -> None:
    from qgis.core import QgsExpression, QgsExpressionContext

    layer = tie_points(("check", "used", 0.456))
    process(layer)
    context = QgsExpressionContext()
    context.setFeature(next(layer.getFeatures()))
    tip = QgsExpression.replaceExpressionText(layer.mapTipTemplate(), context)
    assert tip == "<b>check point</b>: used<br>residual 0.46 px, score 5.0"


def test_other_layers_are_left_alone(plugin: Any) -> None:
    from qgis.core import QgsVectorLayer

    points = QgsVectorLayer("Point?crs=EPSG:32633", "points", "memory")
    assert process(points) == ""
    assert points.renderer().type() == "singleSymbol"
    assert process(None) == ""


def test_a_style_that_cannot_be_read_is_told(plugin: Any, tmp_path: Path) -> None:
    from groundtie_qgis.styling import Styler
    from qgis.core import QgsProcessingContext, QgsProcessingFeedback

    feedback = QgsProcessingFeedback()
    (tmp_path / "broken.qml").write_text("<qgis><unclosed></qgis>")
    Styler(str(tmp_path / "broken.qml")).postProcessLayer(
        tie_points(("fit", "used", 1.0)), QgsProcessingContext(), feedback
    )
    assert "the layer tie_points is not styled" in feedback.textLog()


@pytest.mark.parametrize(
    ("name", "wanted", "styled"),
    [("tie_points", True, True), ("tie_points", False, False), ("other", True, False)],
)
def test_only_layers_to_be_loaded_get_a_post_processor(
    plugin: Any, tmp_path: Path, name: str, wanted: bool, styled: bool
) -> None:
    from groundtie_qgis.styling import style_when_loaded
    from qgis.core import QgsProcessingContext, QgsProject

    context, path = QgsProcessingContext(), str(tmp_path / "points.gpkg")
    if wanted:
        details = QgsProcessingContext.LayerDetails("points", QgsProject.instance(), "points")
        context.addLayerToLoadOnCompletion(path, details)
    style_when_loaded(name, path, context)
    processor = context.layerToLoadOnCompletionDetails(path).postProcessor() if wanted else None
    assert (processor is not None) == styled


def test_every_run_has_a_post_processor_of_its_own(plugin: Any, tmp_path: Path) -> None:
    from groundtie_qgis import styling
    from qgis.core import QgsProcessingContext, QgsProject

    path = str(tmp_path / "points.gpkg")

    def context_with_style() -> Any:
        context = QgsProcessingContext()
        details = QgsProcessingContext.LayerDetails("points", QgsProject.instance(), "points")
        context.addLayerToLoadOnCompletion(path, details)
        styling.style_when_loaded("tie_points", path, context)
        return context

    first = context_with_style()
    del first  # QGIS deletes the post-processor with its context
    second, third = context_with_style(), context_with_style()
    processors = [
        context.layerToLoadOnCompletionDetails(path).postProcessor() for context in (second, third)
    ]
    assert processors == styling._kept[-2:]
    assert processors[0] is not processors[1]
    del second, third, processors
    kept = context_with_style()
    assert len(styling._kept) == 1
    del kept
