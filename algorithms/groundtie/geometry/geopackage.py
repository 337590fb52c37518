"""Writing layers of lines in a GeoPackage. Importing this is slow: it loads fiona."""

from __future__ import annotations

from pathlib import Path
from typing import Any

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
