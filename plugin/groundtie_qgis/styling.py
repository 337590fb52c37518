"""The icon, and the styles of layers: `styles/NAME.qml` is for the output parameter NAME."""

from __future__ import annotations

import functools
from typing import Any

from qgis.core import (
    QgsProcessingContext,
    QgsProcessingFeedback,
    QgsProcessingLayerPostProcessorInterface,
    QgsVectorLayer,
)

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


# QGIS does not own a post-processor: the cache keeps it until QGIS calls it.
_styler = functools.cache(Styler)


def style_when_loaded(name: str, path: str, context: QgsProcessingContext) -> None:
    """Have the layer of output parameter `name`, written to `path`, styled if it is loaded."""
    style = FOLDER / "styles" / f"{name}.qml"
    if style.exists() and context.willLoadLayerOnCompletion(path):
        details = context.layerToLoadOnCompletionDetails(path)
        details.setPostProcessor(_styler(str(style)))
