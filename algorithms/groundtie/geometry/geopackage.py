"""Layers of lines in a GeoPackage. Importing this is slow: it loads fiona."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import fiona
from fiona.io import MemoryFile
from rasterio.crs import CRS

from ..errors import raised_by


def write_layer(
    path: Path,
    name: str,
    records: list[dict[str, Any]],
    properties: dict[str, str],
    crs: CRS | None,
) -> None:
    """Write features with lines as geometries.

    Parameters
    ----------
    path, name
        The file, and the layer's name.
    records
        The features as GeoJSON has them.
    properties
        Types of the properties, by name.
    crs
        Of the geometries; None: unknown.

    Raises
    ------
    OSError
        Not everything could be written.
    """
    try:
        # In memory: SQLite may meet a full disk in silence.
        with MemoryFile(ext=".gpkg") as memory:
            with memory.open(
                driver="GPKG",
                layer=name,
                crs_wkt="" if crs is None else crs.to_wkt(),
                schema={"geometry": "LineString", "properties": properties},
            ) as layer:
                layer.writerecords(records)
            content = bytes(memory.getbuffer())
    except Exception as error:
        if not raised_by(error, "fiona"):
            raise
        raise OSError(str(error)) from error
    path.write_bytes(content)


def read_layer(path: Path) -> tuple[list[dict[str, Any]], CRS | None]:
    """Return the properties of all features of the first layer, and its CRS.

    Raises
    ------
    OSError
        The file cannot be read.
    """
    try:
        with fiona.open(path) as layer:
            crs = CRS.from_wkt(layer.crs_wkt) if layer.crs_wkt else None
            return [dict(feature["properties"]) for feature in layer], crs
    except Exception as error:
        if not raised_by(error, "fiona"):
            raise
        raise OSError(str(error)) from error
