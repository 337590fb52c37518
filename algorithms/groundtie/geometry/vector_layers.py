"""Vector layers: written as GeoPackages, and read in a separate process.

GDAL's vector drivers, or fiona around them, may crash on damaged files: a GeoPackage of 144 kB
crashes the interpreter with fiona 1.10. An SQLite check of a GeoPackage would read all of it
without checking the geometries, and other formats have no such check. A separate process therefore
reads the layer, and its crash is reported as an error of that layer. The process is a new one, as a
fork of QGIS, or of a process with GDAL's threads, would not work.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from rasterio.crs import CRS
from rasterio.errors import CRSError

from ..errors import GeoreferencingError, VectorLayerError, raised_by
from ..packages import interpreter
from ..rasters.grid import Grid, full_turn, require_both_or_none, require_map
from . import layer_reader

# Usual layers of masks and tie points are read in seconds.
_PATIENCE_S = 120


@dataclass(frozen=True)
class VectorLayer:
    """The first layer of a vector file.

    Parameters
    ----------
    path
        Name of the file in messages.
    crs
        CRS of the layer; None: unknown.
    fields
        Names of the attributes.
    features
        Dictionaries with `geometry` (None, or as in GeoJSON) and `properties`.
    """

    path: str
    crs: CRS | None
    fields: tuple[str, ...]
    features: tuple[dict[str, Any], ...]

    @property
    def kinds(self) -> set[str]:
        """The types of its geometries, as in GeoJSON; of collections, those of their parts."""
        return {
            str(geometry["type"])
            for feature in self.features
            for geometry in simple_geometries(feature["geometry"])
        }

    def on_map(self, grid: Grid) -> VectorLayer:
        """Return the features that have a geometry, on the map of a grid.

        The parts of a geometry collection become separate features with its properties. On another
        map, or one with longitudes, this holds for all geometries of several parts, what lies far
        from the grid is left out, and longitudes are shifted by full turns to lie near the grid's.

        Raises
        ------
        GeoreferencingError
            Only one of the layer and the map has a CRS.
        VectorLayerError
            A geometry is damaged, or it or the grid has no place on the other's map.
        """
        crs = grid.crs
        require_both_or_none(self.crs, crs, f"{self.path} and the image")
        located = [
            (feature, geometry)
            for feature in self.features
            for geometry in simple_geometries(feature["geometry"])
        ]
        if self.crs is not None and (self.crs != crs or full_turn(crs) is not None):
            from shapely.errors import ShapelyError  # slow to load

            from .map_shapes import MapShapes

            around = MapShapes.around(grid, self.crs)
            if around is None:
                raise VectorLayerError(f"the image has no place on the map of {self.path}")
            try:
                located = [(feature, part) for feature, one in located for part in around.of(one)]
            except (ValueError, TypeError, ShapelyError) as error:
                raise VectorLayerError(f"cannot use a geometry of {self.path}: {error}") from error
        features = ({**feature, "geometry": geometry} for feature, geometry in located)
        return replace(self, crs=crs, features=tuple(features))


def simple_geometries(geometry: Any) -> list[Any]:
    """Return the geometries of a collection, nested ones included, or the simple geometry itself.

    The geometries are as in GeoJSON; None has no geometries.
    """
    if geometry is None:
        return []
    if geometry["type"] != "GeometryCollection":
        return [geometry]
    return [simple for part in geometry["geometries"] for simple in simple_geometries(part)]


def read_vector_layer(path: str | os.PathLike[str]) -> VectorLayer:
    """Read the first layer of any vector file that fiona reads.

    Raises
    ------
    VectorLayerError
        The file cannot be read, or is damaged.
    """
    name = os.fspath(path)
    found = _read_apart(name)
    if found is None:
        found = layer_reader.layer_of(name)
    if "error" in found:
        raise VectorLayerError(f"cannot read the vector layer {name}: {found['error']}")
    try:
        wkt = found["crs_wkt"]
        # GDAL's name for a GeoPackage's two undefined CRSs (OGC 12-128r18, 1.1.2.1.2).
        is_known = wkt and '"Undefined ' not in wkt
        crs = require_map(CRS.from_wkt(wkt)) if is_known else None
    except (CRSError, GeoreferencingError) as error:
        raise VectorLayerError(f"the CRS of {name} cannot be understood: {error}") from error
    return VectorLayer(name, crs, tuple(found["fields"]), tuple(found["features"]))


def write_vector_layer(
    path: Path,
    name: str,
    records: list[dict[str, Any]],
    properties: dict[str, str],
    crs: CRS | None,
) -> None:
    """Write features with lines as geometries to a GeoPackage.

    Parameters
    ----------
    path, name
        The file, and the layer's name.
    records
        The features as in GeoJSON.
    properties
        Types of the properties, by name.
    crs
        CRS of the geometries; None: unknown.

    Raises
    ------
    OSError
        The layer could not be written completely.
    """
    from fiona.io import MemoryFile  # slow to load

    try:
        # In memory: SQLite may ignore a full disk silently.
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


def _read_apart(name: str) -> dict[str, Any] | None:
    """Return the result of `layer_reader` in a separate process; None if none can be started."""
    python = interpreter()
    if python is None:
        return None
    # The process must find fiona where this one does: in QGIS, the plugin's folder is on the path.
    folders = os.pathsep.join(folder for folder in sys.path if folder)
    try:
        done = subprocess.run(
            [python, layer_reader.__file__, name],
            env={**os.environ, "PYTHONPATH": folders},
            check=False,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            timeout=_PATIENCE_S,
            # Ctrl-C must reach this process only, which then ends its work in order.
            start_new_session=True,
            creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
        )
    except subprocess.TimeoutExpired:
        return {"error": f"it took more than {_PATIENCE_S} s"}
    if done.returncode == 0:
        return dict(json.loads(done.stdout))
    # Python's own failures have code 1: an interpreter without fiona does not count.
    return None if done.returncode == 1 else {"error": "it is damaged: GDAL crashes on it"}
