"""File names of layers and of the dock's outputs, and detection of images with RPCs."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

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


def has_rpcs(layer: Any) -> bool:
    """Whether a raster layer is located only by RPCs, with which GDAL warps it for QGIS."""
    from osgeo import gdal

    if layer is None or layer.providerType() != "gdal":
        return False
    try:
        dataset = gdal.Open(file_name(layer))
    except RuntimeError:  # Another plugin may have enabled GDAL exceptions; the file is gone.
        return False
    if dataset is None or dataset.GetGeoTransform(can_return_null=True) is not None:
        return False
    return bool(dataset.GetMetadata("RPC"))
