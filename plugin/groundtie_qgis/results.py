"""Reports in QGIS's Results Viewer, and layers to load or not to load."""

from __future__ import annotations

import time
from collections.abc import Iterable
from pathlib import Path

from qgis.core import QgsProcessingContext
from qgis.PyQt.QtGui import QIcon

from .styling import ICON


def show_report(name: str, path: Path) -> None:
    """List a page in the Results Viewer, where QGIS lists only those of successful runs."""
    from qgis.utils import iface

    if iface is None:  # without a desktop
        return
    from processing.core.ProcessingResults import resultsList

    resultsList.addResult(QIcon(str(ICON)), name, time.localtime(), str(path))


def load_on_completion(path: Path, context: QgsProcessingContext) -> None:
    """Schedule a raster that is not a separate output for loading, if there is a desktop."""
    from qgis.utils import iface

    if iface is not None and context.project() is not None:
        details = QgsProcessingContext.LayerDetails(path.stem, context.project(), path.stem)
        context.addLayerToLoadOnCompletion(str(path), details)


def forget_layers(context: QgsProcessingContext, paths: Iterable[str]) -> None:
    """Cancel loading of layers that a run did not write, as QGIS would report each as missing."""
    left = context.layersToLoadOnCompletion()
    for path in paths:
        left.pop(path, None)
    context.setLayersToLoadOnCompletion(left)
