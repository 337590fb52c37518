"""QGIS's enumerations: members live in their enumeration (QGIS 4), or beside it (QGIS 3.22)."""

from __future__ import annotations

from typing import Any

from qgis.core import (
    Qgis,
    QgsProcessing,
    QgsProcessingParameterDefinition,
    QgsProcessingParameterFile,
    QgsProcessingParameterNumber,
    QgsWkbTypes,
)


def _member(owner: Any, enumeration: str, member: str) -> Any:
    scope = getattr(owner, enumeration, owner)
    return getattr(scope, member) if hasattr(scope, member) else getattr(owner, member)


ADVANCED = _member(QgsProcessingParameterDefinition, "Flag", "FlagAdvanced")
INTEGER = _member(QgsProcessingParameterNumber, "Type", "Integer")
DOUBLE = _member(QgsProcessingParameterNumber, "Type", "Double")
FILE = _member(QgsProcessingParameterFile, "Behavior", "File")
RASTER = _member(QgsProcessing, "SourceType", "TypeRaster")
ANY_VECTOR = _member(QgsProcessing, "SourceType", "TypeVector")
LINE = _member(QgsWkbTypes, "GeometryType", "LineGeometry")
WARNING = _member(Qgis, "MessageLevel", "Warning")
