"""How the layers of a run look and where they lie."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from qgis.core import (
    QgsLayerTreeGroup,
    QgsProcessingContext,
    QgsProcessingFeedback,
    QgsProcessingLayerPostProcessorInterface,
    QgsProject,
    QgsRasterLayer,
    QgsRasterRenderer,
    QgsVectorLayer,
)
from qgis.PyQt import sip

from .compat import LINE
from .library import FOLDER

ICON = FOLDER / "icons" / "groundtie.svg"
# What a layer that was made here keeps, also in a project's file: the file of its raster.
MADE_FROM = "groundtie/made_from"
TIE_POINTS = FOLDER / "styles" / "tie_points.qml"


def icon_of(name: str) -> Path:
    """Return the icon of a tool; GroundTie's own where it has none."""
    path = ICON.with_name(f"{name}.svg")
    return path if path.is_file() else ICON


class LoadedLayers:
    """The layers that one run loads: several come into one group, what is drawn over rasters first.

    Parameters
    ----------
    title
        Name of the group.
    """

    def __init__(self, title: str) -> None:
        self._title = title
        self._count = 0
        self._group: QgsLayerTreeGroup | None = None

    def add(
        self,
        path: str,
        context: QgsProcessingContext,
        renderer: QgsRasterRenderer | None = None,
        made_from: str | None = None,
    ) -> None:
        """Have the layer of the file `path` finished, if the run's context loads it.

        Lines are drawn as tie points, rasters by the renderer of another raster, whose file the
        layer keeps.
        """
        if context.willLoadLayerOnCompletion(path):
            details = context.layerToLoadOnCompletionDetails(path)
            processor = LayerFinisher(self, details.project, renderer, made_from)
            self._count += 1
            _keep(processor)
            details.setPostProcessor(processor)

    def place(self, layer: Any, project: QgsProject) -> None:
        """Put a layer into the group of the run."""
        node = project.layerTreeRoot().findLayer(layer.id()) if project is not None else None
        if node is None or self._count < 2:
            return
        parent = node.parent()
        if self._group is None or sip.isdeleted(self._group):
            # QGIS adds layers above the selected one, which may lie below others.
            self._group = project.layerTreeRoot().insertGroup(0, self._title)
        top = isinstance(layer, QgsVectorLayer)
        self._group.insertChildNode(0 if top else len(self._group.children()), node.clone())
        parent.removeChildNode(node)


class LayerFinisher(QgsProcessingLayerPostProcessorInterface):
    """Gives one layer its look and its place."""

    def __init__(
        self,
        layers: LoadedLayers,
        project: QgsProject,
        renderer: QgsRasterRenderer | None = None,
        made_from: str | None = None,
    ) -> None:
        super().__init__()
        self._layers = layers
        self._project = project
        self._renderer = renderer
        self._made_from = made_from

    def postProcessLayer(
        self, layer: Any, context: QgsProcessingContext, feedback: QgsProcessingFeedback
    ) -> None:
        """Finish `layer` (called by QGIS in the main thread)."""
        if layer is None:
            return
        if isinstance(layer, QgsVectorLayer) and layer.geometryType() == LINE:
            _draw_as_tie_points(layer, feedback)
        if self._renderer is not None and isinstance(layer, QgsRasterLayer):
            draw_alike(layer, self._renderer)
        if self._made_from is not None:
            layer.setCustomProperty(MADE_FROM, self._made_from)
        self._layers.place(layer, self._project)


def _draw_as_tie_points(layer: QgsVectorLayer, feedback: QgsProcessingFeedback) -> None:
    message, loaded = layer.loadNamedStyle(str(TIE_POINTS))
    if loaded:
        layer.triggerRepaint()
    else:
        feedback.pushWarning(f"the layer {layer.name()} is not styled: {message}")


def draw_alike(layer: QgsRasterLayer, renderer: QgsRasterRenderer) -> None:
    """Draw a raster as another one with the same values: same bands, colours and stretch.

    A stretch of its own would count what lies outside of its mask.
    """
    if max(renderer.usesBands(), default=0) > layer.bandCount():
        return
    alike = renderer.clone()
    # a mask of its own is transparent
    alike.setAlphaBand(layer.renderer().alphaBand())
    layer.setRenderer(alike)
    layer.triggerRepaint()


# The context deletes the post-processor at its end; until then its Python half must be kept.
_kept: list[LayerFinisher] = []


def _keep(processor: LayerFinisher) -> None:
    _kept[:] = [kept for kept in _kept if not sip.isdeleted(kept)] + [processor]
