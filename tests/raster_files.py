"""Small raster files with known content, and a disk that is full."""

from __future__ import annotations

import contextlib
import resource
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from affine import Affine
from numpy.typing import NDArray
from rasterio.crs import CRS

from groundtie.rasters.grid import Grid

UTM = CRS.from_epsg(32632)


def utm_grid(width: int, height: int, size: float = 10.0) -> Grid:
    """Return a grid in UTM with pixels of `size` metres."""
    return Grid(Affine(size, 0, 500_000, 0, -size, 5_000_000), UTM, width, height)


def write_raster(path: Path, values: NDArray[Any], grid: Grid | None = None, **more: Any) -> Path:
    """Write bands, shape (bands, h, w) or (h, w), into a GeoTIFF; `mask` becomes internal."""
    values = values if values.ndim == 3 else values[None]
    mask, colors = more.pop("mask", None), more.pop("colorinterp", None)
    place = {} if grid is None else {"crs": grid.crs, "transform": grid.transform}
    profile: dict[str, Any] = {
        "driver": "GTiff",
        "count": values.shape[0],
        "height": values.shape[1],
        "width": values.shape[2],
        "dtype": values.dtype,
    }
    with (
        rasterio.Env(GDAL_TIFF_INTERNAL_MASK=True),
        rasterio.open(path, "w", **profile | place | more) as dataset,
    ):
        if colors is not None:
            dataset.colorinterp = colors
        dataset.write(values.astype(values.dtype))
        if mask is not None:
            dataset.write_mask(mask)
    return path


def waves(xy: NDArray[np.float64], length: float) -> NDArray[np.float64]:
    """Return a smooth function of the position, between 50 and 150, of the given wavelength."""
    u = 2 * np.pi * np.asarray(xy) / length
    return 100 + 30 * np.sin(u[..., 0] + 0.3) * np.cos(u[..., 1]) + 20 * np.sin(0.6 * u[..., 1])


def wave_image(grid: Grid, length: float) -> NDArray[np.float64]:
    """Return `waves` at the pixels of a grid, shape (h, w)."""
    cols, rows = np.meshgrid(np.arange(grid.width), np.arange(grid.height))
    xy = grid.pixel_to_map(np.column_stack([cols.ravel(), rows.ravel()]))
    return waves(xy, length).reshape(grid.height, grid.width)


@contextlib.contextmanager
def full_disk(free_bytes: int) -> Iterator[None]:
    """Let no file of this process grow beyond some bytes, as if the disk was full."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (free_bytes, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
