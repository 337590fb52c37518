"""Layers of lines in a GeoPackage. Importing this is slow: it loads fiona."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import fiona
from fiona.errors import FionaError, TransactionError
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
        with fiona.open(
            path,
            "w",
            driver="GPKG",
            layer=name,
            crs_wkt="" if crs is None else crs.to_wkt(),
            schema={"geometry": "LineString", "properties": properties},
        ) as layer:
            layer.writerecords(records)
        # SQLite may meet a full disk in silence.
        with fiona.open(path, layer=name) as layer:
            complete = len(layer) == len(records)
    except (TransactionError, RuntimeError):
        complete = False
    except FionaError as error:
        raise OSError(str(error)) from error
    except Exception as error:
        if not raised_by(error, "fiona"):
            raise
        complete = False
    if not complete:
        raise OSError("the file is not complete; is the disk full?")


def read_layer(path: Path) -> tuple[list[dict[str, Any]], list[Any], CRS | None]:
    """Return the properties and geometries of the first layer's features, and its CRS.

    Raises
    ------
    OSError
        The file cannot be read.
    """
    try:
        with fiona.open(path) as layer:
            wkt = layer.crs_wkt
            features = list(layer)
    except Exception as error:
        if not raised_by(error, "fiona"):
            raise
        raise OSError(str(error)) from error
    # So GDAL calls the two that stand for none in every GeoPackage (OGC 12-128r18, 1.1.2.1.2).
    crs = None if not wkt or '"Undefined ' in wkt else CRS.from_wkt(wkt)
    properties = [dict(feature["properties"]) for feature in features]
    return properties, [feature["geometry"] for feature in features], crs
