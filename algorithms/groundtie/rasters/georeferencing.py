"""Which grid a raster states, if that is one that can be worked with."""

from __future__ import annotations

from typing import Any

from ..errors import GeoreferencingError
from .bands import stated
from .grid import PIXEL_COORDINATES, Grid, is_invertible, require_map


def grid_of(name: str, dataset: Any, *, allow_sensor_geometry: bool) -> Grid:
    """Return the grid of a rasterio dataset; in pixel coordinates if it states none.

    Parameters
    ----------
    name
        What messages call it.
    dataset
        The dataset, open.
    allow_sensor_geometry
        Take images that are located by RPCs or GCPs only, in pixel coordinates.

    Raises
    ------
    GeoreferencingError
        The image is located by RPCs or GCPs only, its pixels have no size, or its CRS is no map's.
    """
    crs, transform = stated(lambda: dataset.crs), dataset.transform
    if crs is None and transform.is_identity:
        if not allow_sensor_geometry:
            _refuse_sensor_geometry(name, dataset)
        transform = PIXEL_COORDINATES
    if not is_invertible(transform):
        raise GeoreferencingError(f"{name} has a geotransform that gives its pixels no size")
    try:
        return Grid(transform, require_map(crs), dataset.width, dataset.height)
    except GeoreferencingError as error:
        raise GeoreferencingError(f"{name}: {error}") from error


def _refuse_sensor_geometry(name: str, dataset: Any) -> None:
    located_by = ""
    if stated(lambda: dataset.tags(ns="RPC")):
        located_by = "RPCs"
    elif stated(lambda: dataset.gcps)[0]:
        located_by = "ground control points"
    if located_by:
        raise GeoreferencingError(
            f"{name} is located by {located_by} only; orthorectify it first (gdalwarp -rpc or -tps)"
        )
