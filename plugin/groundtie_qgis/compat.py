"""QGIS's enumerations: members live in their enumeration (QGIS 4), or beside it (QGIS 3.22)."""

from __future__ import annotations

from typing import Any

from qgis.core import (
    Qgis,
    QgsContrastEnhancement,
    QgsMapLayerProxyModel,
    QgsProcessing,
    QgsProcessingParameterDefinition,
    QgsProcessingParameterFile,
    QgsProcessingParameterNumber,
    QgsRasterMinMaxOrigin,
    QgsUnitTypes,
    QgsWkbTypes,
)
from qgis.PyQt.QtCore import Qt


def _member(owner: Any, enumeration: str, member: str) -> Any:
    scope = getattr(owner, enumeration, owner)
    return getattr(scope, member) if hasattr(scope, member) else getattr(owner, member)


ADVANCED = _member(QgsProcessingParameterDefinition, "Flag", "FlagAdvanced")
INTEGER = _member(QgsProcessingParameterNumber, "Type", "Integer")
DOUBLE = _member(QgsProcessingParameterNumber, "Type", "Double")
FILE = _member(QgsProcessingParameterFile, "Behavior", "File")
RASTER = _member(QgsProcessing, "SourceType", "TypeRaster")
ANY_VECTOR = _member(QgsProcessing, "SourceType", "TypeVector")
GEOMETRY = _member(QgsProcessing, "SourceType", "TypeVectorAnyGeometry")
LINE = _member(QgsWkbTypes, "GeometryType", "LineGeometry")
WARNING = _member(Qgis, "MessageLevel", "Warning")
RASTER_LAYERS = _member(QgsMapLayerProxyModel, "Filter", "RasterLayer")
METRES = _member(QgsUnitTypes, "DistanceUnit", "DistanceMeters")
STRETCH = _member(QgsContrastEnhancement, "ContrastEnhancementAlgorithm", "StretchToMinimumMaximum")
WITHOUT_EXTREMES = _member(QgsRasterMinMaxOrigin, "Limits", "CumulativeCut")

_RIGHT = Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
# Alignment that a table model returns, as a plain number, which Qt 5 requires.
RIGHT = int(getattr(_RIGHT, "value", _RIGHT))
