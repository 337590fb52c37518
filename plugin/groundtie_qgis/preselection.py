"""Proposes layers for a dialog's boxes, never the same one as reference and as input."""

from __future__ import annotations

from typing import Any

import qgis.utils
from qgis.core import QgsProject, QgsRasterLayer, QgsUnitTypes, QgsVectorLayer
from qgis.PyQt.QtCore import QCoreApplication, QThread

from .compat import METRES
from .definitions import qgis_name, takes_layers
from .library import kinds
from .start_files import has_rpcs

# Value of a box that starts empty; otherwise QGIS would fill it with a layer.
NOTHING = " "


def preselect(algorithm: Any, tool: Any) -> None:
    """Preset the required layer boxes of a tool's dialog with different layers.

    By default, QGIS puts the active layer into all of them, even those for points.
    """
    if not _in_desktop():
        return
    required = [p for p in tool.parameters if p.required]
    proposed: dict[str, Any] = {
        p.name: tie_points() if takes_layers(p.kind) else None
        for p in required
        if takes_layers(p.kind) or isinstance(p.kind, kinds.MaskIn)
    }
    names = [p.name for p in required if isinstance(p.kind, kinds.RasterIn)]
    if len(names) == 2 and "reference" in names:
        reference, input = proposed_pair(raster_files(), qgis.utils.iface.activeLayer())
        proposed |= {name: reference if name == "reference" else input for name in names}
    for name, layer in proposed.items():
        definition = algorithm.parameterDefinition(qgis_name(name))
        definition.setGuiDefaultValueOverride(NOTHING if layer is None else layer.id())


def tie_points() -> Any:
    """Return the topmost layer of the project that has the columns of tie points, or None."""
    for layer in QgsProject.instance().layerTreeRoot().layerOrder():
        if isinstance(layer, QgsVectorLayer) and layer.fields().indexOf("input_col") >= 0:
            return layer
    return None


def raster_files() -> list[Any]:
    """Return the project's raster layers that are files, from the top of the map."""
    order = QgsProject.instance().layerTreeRoot().layerOrder()
    rasters = [layer for layer in order if isinstance(layer, QgsRasterLayer)]
    return [layer for layer in rasters if layer.providerType() == "gdal" and layer.isValid()]


def proposed_pair(rasters: list[Any], active: Any = None) -> tuple[Any, Any]:
    """Return the layers to propose as reference and input; None where there is none.

    Of two layers, the input is the one with RPCs, smaller pixels or more bands, as it is probably
    the optical image.
    """
    first = sorted(rasters, key=lambda layer: layer is not active)[:2]
    if len(first) < 2:
        return (first or [None])[0], None
    reference, input = sorted(first, key=_as_input)
    return reference, input


def _as_input(layer: Any) -> tuple[bool, float, int]:
    to_metres = QgsUnitTypes.fromUnitToUnitFactor(layer.crs().mapUnits(), METRES)
    pixel = layer.rasterUnitsPerPixelX() * (to_metres or 1.0)
    return has_rpcs(layer), -float(f"{pixel:.2g}"), layer.bandCount()


def _in_desktop() -> bool:
    application = QCoreApplication.instance()
    in_main = application is not None and QThread.currentThread() == application.thread()
    return qgis.utils.iface is not None and in_main
