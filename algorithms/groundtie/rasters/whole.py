"""Rasters that are in memory anyway, written at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from numpy.typing import NDArray
from rasterio.io import MemoryFile

from ..runs import RUN_TAG, run_tags
from .atomic import writing
from .grid import Grid


def write_raster(
    path: Path,
    image: NDArray[Any],
    grid: Grid,
    band_names: Sequence[str],
    nodata: float | None = None,
    rpc_tags: Mapping[str, str] | None = None,
) -> None:
    """Write bands, shape (bands, rows, columns), as GeoTIFF, with RPCs if there are any.

    Raises
    ------
    OutputError
        The file cannot be written completely.
    """
    profile = {
        "driver": "GTiff",
        "count": len(image),
        "height": grid.height,
        "width": grid.width,
        "dtype": image.dtype,
        "nodata": nodata,
        "crs": grid.crs,
        "transform": grid.geotransform,
        "tiled": True,
        "blockxsize": 256,
        "blockysize": 256,
        "compress": "deflate",
        "predictor": 3 if image.dtype.kind == "f" else 2,
        "bigtiff": "if_safer",
    }
    # In memory: within GDAL, a full disk may not raise an exception (see `tiff_directories`).
    with MemoryFile() as memory:
        with memory.open(**profile) as raster:
            raster.write(image)
            raster.update_tags(**run_tags(RUN_TAG))
            for band, name in enumerate(band_names, start=1):
                raster.set_band_description(band, name)
            if rpc_tags is not None:
                raster.update_tags(ns="RPC", **rpc_tags)
        with writing(path, len(memory.getbuffer())):
            path.write_bytes(memory.getbuffer())
