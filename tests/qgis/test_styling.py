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


def process(layer: Any, **how: Any) -> str:
    """Finish a layer that is in no project; return the log."""
    from groundtie_qgis.styling import LayerFinisher, LoadedLayers
    from qgis.core import QgsProcessingContext, QgsProcessingFeedback, QgsProject

    context, feedback = QgsProcessingContext(), QgsProcessingFeedback()
    finisher = LayerFinisher(LoadedLayers("run"), QgsProject(), **how)
    finisher.postProcessLayer(layer, context, feedback)
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


def test_a_style_that_cannot_be_read_is_told(plugin: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    from groundtie_qgis import styling

    monkeypatch.setattr(styling, "TIE_POINTS", Path("no_such_style.qml"))
    log = process(tie_points(("fit", "used", 1.0)))
    assert "the layer tie_points is not styled" in log


def run_of(paths: list[Path]) -> tuple[Any, Any, Any]:
    """Return a context and a project in which files are to be loaded, and the run's layers."""
    from groundtie_qgis.styling import LoadedLayers
    from qgis.core import QgsProcessingContext, QgsProject

    context, project = QgsProcessingContext(), QgsProject()
    for path in paths:
        details = QgsProcessingContext.LayerDetails(path.stem, project, path.stem)
        context.addLayerToLoadOnCompletion(str(path), details)
    return context, project, LoadedLayers("Register images: optical")


def processor_of(context: Any, path: Path) -> Any:
    return context.layerToLoadOnCompletionDetails(str(path)).postProcessor()


def test_only_layers_to_be_loaded_get_a_post_processor(plugin: Any, tmp_path: Path) -> None:
    wanted, other = tmp_path / "a.gpkg", tmp_path / "b.gpkg"
    context, project, layers = run_of([wanted])
    layers.add(str(wanted), context)
    layers.add(str(other), context)
    assert processor_of(context, wanted) is not None
    assert list(context.layersToLoadOnCompletion()) == [str(wanted)]
    del project


def test_every_run_has_a_post_processor_of_its_own(plugin: Any, tmp_path: Path) -> None:
    from groundtie_qgis import styling

    path = tmp_path / "points.gpkg"

    def context_with_style() -> Any:
        context, project, layers = run_of([path])
        layers.add(str(path), context)
        return context, project

    first = context_with_style()
    del first  # QGIS deletes the post-processor with its context
    second, third = context_with_style(), context_with_style()
    processors = [processor_of(context, path) for context, _ in (second, third)]
    assert processors == styling._kept[-2:]
    assert processors[0] is not processors[1]
    del second, third, processors
    kept = context_with_style()
    assert len(styling._kept) == 1
    del kept


@pytest.mark.parametrize("points_first", [True, False])
def test_points_lie_over_the_raster_in_one_group_on_top(
    plugin: Any, tmp_path: Path, points_first: bool
) -> None:
    from qgis.core import QgsProcessingFeedback, QgsRasterLayer

    raster, points = write(tmp_path / "a.tif"), tmp_path / "p.gpkg"
    context, project, layers = run_of([raster, points])
    loaded = {
        raster: QgsRasterLayer(str(raster), "Registered image"),
        points: tie_points(("fit", "used", 1.0)),
    }
    project.addMapLayer(QgsRasterLayer(str(raster), "what was there"))
    for path in loaded:
        layers.add(str(path), context)
    order = [points, raster] if points_first else [raster, points]
    for path in order:  # as QGIS does when the algorithm has ended
        project.addMapLayer(loaded[path])
        feedback = QgsProcessingFeedback()
        processor_of(context, path).postProcessLayer(loaded[path], context, feedback)
    top, below = project.layerTreeRoot().children()
    assert top.name() == "Register images: optical"
    assert [node.name() for node in top.children()] == ["tie_points", "Registered image"]
    assert below.name() == "what was there"
    drawn = [layer.name() for layer in project.layerTreeRoot().layerOrder()]
    assert drawn == ["tie_points", "Registered image", "what was there"]
    project.clear()


def test_a_single_layer_needs_no_group(plugin: Any, tmp_path: Path) -> None:
    from qgis.core import QgsProcessingFeedback, QgsRasterLayer

    path = write(tmp_path / "a.tif")
    context, project, layers = run_of([path])
    layers.add(str(path), context)
    layer = QgsRasterLayer(str(path), "Filtered image")
    project.addMapLayer(layer)
    processor_of(context, path).postProcessLayer(layer, context, QgsProcessingFeedback())
    assert [node.name() for node in project.layerTreeRoot().children()] == ["Filtered image"]
    project.clear()


def write(path: Path, masked: bool = False) -> Path:
    """Write an image of 100 to 200, the left half of which is masked if asked for, and then 0."""
    import numpy as np
    import rasterio

    values = np.linspace(100, 200, 40 * 40).reshape(1, 40, 40).astype("uint8")
    grid = {"transform": rasterio.Affine(1, 0, 0, 0, -1, 40), "crs": "EPSG:32633"}
    with (
        rasterio.Env(GDAL_TIFF_INTERNAL_MASK=True),
        rasterio.open(path, "w", "GTiff", 40, 40, 1, dtype="uint8", **grid) as raster,
    ):
        known = np.ones((40, 40), bool)
        known[:, :20] = not masked
        raster.write(values * known)
        if masked:
            raster.write_mask(known)
    return path


def test_a_registered_raster_is_drawn_as_the_input(plugin: Any, tmp_path: Path) -> None:
    """Not stretched from the zeros outside of its mask, which stays transparent."""
    from qgis.core import Qgis, QgsRasterLayer

    given = QgsRasterLayer(str(write(tmp_path / "a.tif")), "input")
    made = QgsRasterLayer(str(write(tmp_path / "b.tif", masked=True)), "registered")
    alpha = made.renderer().alphaBand()
    assert alpha > 0
    # Newer ones leave out what is masked.
    if Qgis.versionInt() < 34_000:
        assert made.renderer().contrastEnhancement().minimumValue() < 50
    assert process(made, renderer=given.renderer().clone()) == ""
    stretch = made.renderer().contrastEnhancement()
    assert stretch.minimumValue() > 90
    assert made.renderer().alphaBand() == alpha


def test_a_raster_with_fewer_bands_keeps_its_own_renderer(plugin: Any, tmp_path: Path) -> None:
    from qgis.core import QgsRasterLayer, QgsSingleBandGrayRenderer

    made = QgsRasterLayer(str(write(tmp_path / "a.tif")), "registered")
    fourth = QgsSingleBandGrayRenderer(made.dataProvider(), 4)
    process(made, renderer=fourth)
    assert made.renderer().usesBands() == [1]
