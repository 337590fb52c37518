"""Files of layers and of the dock's outputs: names, CRSs, and whether RPCs locate them."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

from qgis.core import QgsCoordinateReferenceSystem
from qgis.PyQt import sip

from .dependencies import missing_for


def points_name() -> str:
    """Return a name for a tie-point file in a format that can be written here."""
    name = "tie_points.gpkg"
    return "tie_points.geojson" if missing_for("", [Path(name)]) else name


def file_name(layer: Any) -> str:
    """Return a raster layer's source without the options that QGIS appends."""
    return without_options(layer.source())


def without_options(source: str) -> str:
    """Return a source of GDAL without the options that QGIS appends."""
    return re.sub(r"\|(option|credential):[^|]*| authcfg='[^']+'", "", source)


def is_file(layer: Any) -> bool:
    """Whether a layer, which may be None or removed from the project, is a raster file."""
    return layer is not None and not sip.isdeleted(layer) and layer.providerType() == "gdal"


def has_rpcs(layer: Any) -> bool:
    """Whether a raster layer is located only by RPCs, with which GDAL warps it for QGIS."""
    if not is_file(layer):
        return False
    dataset = opened(layer)
    if dataset is None or dataset.GetGeoTransform(can_return_null=True) is not None:
        return False
    return bool(dataset.GetMetadata("RPC"))


def crs_of_file(layer: Any) -> QgsCoordinateReferenceSystem:
    """Return the CRS that the file of a raster layer has now.

    It is the layer's where that is nothing to the file's georeferencing: none, or RPCs or GCPs.
    """
    # The layer's provider keeps the CRS of when it was loaded.
    dataset = None if layer.crs() == layer.dataProvider().crs() else opened(layer)
    if dataset is None or dataset.GetGeoTransform(can_return_null=True) is None:
        return layer.crs()
    return QgsCoordinateReferenceSystem.fromWkt(dataset.GetProjection())


def opened(layer: Any) -> Any:
    """Return GDAL's dataset of a raster layer; None if its file is gone."""
    from osgeo import gdal

    try:
        return gdal.Open(file_name(layer))
    except RuntimeError:  # Another plugin may have enabled GDAL exceptions.
        return None
