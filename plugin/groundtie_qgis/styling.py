"""Style and grouping of the layers of a run."""

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
from .start_files import file_name

ICON = FOLDER / "icons" / "groundtie.svg"
# Custom property, saved in projects, of layers made here: their `origin`.
_MADE_FROM = "groundtie/made_from"
TIE_POINTS = FOLDER / "styles" / "tie_points.qml"


def icon_of(name: str) -> Path:
    """Return the icon of a tool, or GroundTie's icon if it has none."""
    path = ICON.with_name(f"{name}.svg")
    return path if path.is_file() else ICON


def origin(layer: Any) -> str:
    """Return the raster file that a layer was made from here, in one step or more; else its own."""
    return str(layer.customProperty(_MADE_FROM) or file_name(layer))


class LoadedLayers:
    """The layers that a run loads; several layers form a group, with vectors above rasters.

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
        """Schedule the layer of the file `path` for finishing, if the run's context loads it.

        Lines are styled as tie points. Rasters take `renderer`, which is that of another raster,
        and the `origin` of that raster, `made_from`.
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
            # QGIS adds layers above the selected one, which may be below others.
            self._group = project.layerTreeRoot().insertGroup(0, self._title)
        top = isinstance(layer, QgsVectorLayer)
        self._group.insertChildNode(0 if top else len(self._group.children()), node.clone())
        parent.removeChildNode(node)


class LayerFinisher(QgsProcessingLayerPostProcessorInterface):
    """Applies the style and the group to one layer."""

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
            layer.setCustomProperty(_MADE_FROM, self._made_from)
        self._layers.place(layer, self._project)


def _draw_as_tie_points(layer: QgsVectorLayer, feedback: QgsProcessingFeedback) -> None:
    message, loaded = layer.loadNamedStyle(str(TIE_POINTS))
    if loaded:
        layer.triggerRepaint()
    else:
        feedback.pushWarning(f"the layer {layer.name()} is not styled: {message}")


def draw_alike(layer: QgsRasterLayer, renderer: QgsRasterRenderer) -> None:
    """Draw a raster like another one with the same values: same bands, colours and stretch.

    A separate stretch would include pixels outside the raster's mask.
    """
    if max(renderer.usesBands(), default=0) > layer.bandCount():
        return
    alike = renderer.clone()
    # the raster keeps its own mask as transparency
    alike.setAlphaBand(layer.renderer().alphaBand())
    layer.setRenderer(alike)
    layer.triggerRepaint()


# The context deletes the post-processor at its end; its Python object must live until then.
_kept: list[LayerFinisher] = []


def _keep(processor: LayerFinisher) -> None:
    _kept[:] = [kept for kept in _kept if not sip.isdeleted(kept)] + [processor]
