"""The icon, and the styles of layers: `styles/NAME.qml` is for the output parameter NAME."""

from __future__ import annotations

from typing import Any

from qgis.core import (
    QgsProcessingContext,
    QgsProcessingFeedback,
    QgsProcessingLayerPostProcessorInterface,
    QgsVectorLayer,
)
from qgis.PyQt import sip

from .compat import LINE
from .library import FOLDER

ICON = FOLDER / "icons" / "groundtie.svg"


class Styler(QgsProcessingLayerPostProcessorInterface):
    """Gives a layer of lines the style of a file."""

    def __init__(self, style: str) -> None:
        super().__init__()
        self._style = style

    def postProcessLayer(
        self, layer: Any, context: QgsProcessingContext, feedback: QgsProcessingFeedback
    ) -> None:
        """Style `layer` (called by QGIS in the main thread)."""
        if not isinstance(layer, QgsVectorLayer) or layer.geometryType() != LINE:
            return
        message, loaded = layer.loadNamedStyle(self._style)
        if loaded:
            layer.triggerRepaint()
        else:
            feedback.pushWarning(f"the layer {layer.name()} is not styled: {message}")


# The context deletes the post-processor at its end; until then its Python half must be kept.
_kept: list[Styler] = []


def style_when_loaded(name: str, path: str, context: QgsProcessingContext) -> None:
    """Have the layer of output parameter `name`, written to `path`, styled if it is loaded."""
    style = FOLDER / "styles" / f"{name}.qml"
    if style.exists() and context.willLoadLayerOnCompletion(path):
        styler = Styler(str(style))
        _kept[:] = [kept for kept in _kept if not sip.isdeleted(kept)] + [styler]
        context.layerToLoadOnCompletionDetails(path).setPostProcessor(styler)
