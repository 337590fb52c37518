"""Reports in QGIS's Results Viewer, and layers that were not made."""

from __future__ import annotations

import time
from collections.abc import Iterable
from pathlib import Path

from qgis.core import QgsProcessingContext
from qgis.PyQt.QtGui import QIcon

from .styling import ICON


def show_report(name: str, path: Path) -> None:
    """List a page in the Results Viewer, where QGIS lists those of successful runs alone."""
    from qgis.utils import iface

    if iface is None:  # no desktop
        return
    from processing.core.ProcessingResults import resultsList

    resultsList.addResult(QIcon(str(ICON)), name, time.localtime(), str(path))


def load_on_completion(path: Path, context: QgsProcessingContext) -> None:
    """Have a raster loaded that is no output of its own; where there is a desktop."""
    from qgis.utils import iface

    if iface is not None and context.project() is not None:
        details = QgsProcessingContext.LayerDetails(path.stem, context.project(), path.stem)
        context.addLayerToLoadOnCompletion(str(path), details)


def forget_layers(context: QgsProcessingContext, paths: Iterable[str]) -> None:
    """Have layers not loaded that a run did not make: QGIS would complain of each."""
    left = context.layersToLoadOnCompletion()
    for path in paths:
        left.pop(path, None)
    context.setLayersToLoadOnCompletion(left)
