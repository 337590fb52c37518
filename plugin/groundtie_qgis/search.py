"""The default search radius."""

from __future__ import annotations

from typing import Any

from qgis.PyQt import sip

from .dependencies import rasterio_env
from .library import errors, library_module
from .start_files import file_name, has_rpcs


def usual_radius_m(tool: str, reference: Any, input: Any) -> float:
    """Return a tool's default search radius for two layers, in metres.

    Without georeferencing, it is in pixels. It is 0 if a layer or its file is gone.
    """
    if any(layer is None or sip.isdeleted(layer) for layer in (reference, input)):
        return 0.0
    opening, specification = (
        library_module(f"registration.{name}") for name in ("opening", "specification")
    )
    # `register` decides by the images, and its last attempt is the widest search.
    free = {
        "register": specification.ANYWHERE,
        "coregister": specification.COREGISTER.free,
        "match_sar_sar": specification.SAR_SAR.free,
        "match_optical": specification.OPTICAL.free,
    }
    try:
        with rasterio_env():
            return float(opening.usual_radius_m(_grid(reference), _grid(input), free[tool]))
    except errors.GroundTieError:  # The file is gone, which the next run reports.
        return 0.0


def _grid(layer: Any) -> Any:
    """Return the grid of a layer's file; for RPCs, the grid with which QGIS draws it."""
    if not has_rpcs(layer):
        with library_module("rasters.reading").open_raster(file_name(layer)) as raster:
            return raster.grid
    from affine import Affine
    from rasterio.crs import CRS

    extent, width, height = layer.extent(), layer.width(), layer.height()
    across, down = extent.width() / width, extent.height() / height
    place = Affine(across, 0, extent.xMinimum(), 0, -down, extent.yMaximum())
    wkt = layer.crs().toWkt()
    crs = CRS.from_wkt(wkt) if wkt else None
    return library_module("rasters.grid").Grid(place, crs, width, height)
