"""RPCs for tests: made-up ones, those of real images, and rasterio's view of them."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import rasterio.rpc
from affine import Affine
from numpy.typing import NDArray
from raster_files import write_raster
from rasterio.crs import CRS
from rasterio.transform import RPCTransformer

from groundtie.rasters.grid import LON_LAT, Grid, reproject
from groundtie.sensor.rpc import RPC
from groundtie.sensor.rpc_fit import fit_rpc
from groundtie.sensor.rpc_tags import rpc_to_tags

FloatArray = NDArray[np.float64]

REAL = tuple(f"rpc-triplet/img_0{i}.tif" for i in (1, 2, 3))
DIMAP = "rpc-ventoux/RPC_PHR1B_P_201308051042194_SEN_690908101-001.XML"


def camera(
    lon_lat: FloatArray,
    height_m: FloatArray,
    size: tuple[int, int] = (600, 500),
    centre: tuple[float, float] = (9.0, 45.15),
    pixel_m: float = 1.0,
    off_nadir: tuple[float, float] = (0.25, -0.1),
    turn_deg: float = 8.0,
) -> FloatArray:
    """Return the image positions, (n, 2), that a push-broom camera in 680 km sees positions at.

    Lines are parallel, along the flight; each is a perspective. `off_nadir` are metres across and
    along the track that a metre of height moves a point by.
    """
    metres = 111_195.0 * np.array([np.cos(np.deg2rad(centre[1])), 1.0])
    east, north = ((lon_lat - centre) * metres).T
    cosine, sine = np.cos(np.deg2rad(turn_deg)), np.sin(np.deg2rad(turn_deg))
    across, along = cosine * east + sine * north, -sine * east + cosine * north
    distance = 680_000.0
    across = (across + off_nadir[0] * height_m) * distance / (distance - height_m)
    along = along + off_nadir[1] * height_m
    middle = (np.array(size) - 1) / 2
    return np.column_stack([across / pixel_m + middle[0], middle[1] - along / pixel_m])


def camera_rpc(size: tuple[int, int] = (600, 500), **of_camera: object) -> RPC:
    """Return the RPCs of `camera`, for heights from 0 to 800 m."""
    pixel_m = float(of_camera.get("pixel_m", 1.0))  # type: ignore[arg-type]
    centre = of_camera.get("centre", (9.0, 45.15))
    half_deg = 0.8 * max(size) * pixel_m / 111_195.0
    axes = [np.linspace(-half_deg * 1.4, half_deg * 1.4, 15), np.linspace(-half_deg, half_deg, 15)]
    lon, lat, height = (g.ravel() for g in np.meshgrid(*axes, np.linspace(0, 800, 7)))
    lon_lat = np.column_stack([lon, lat]) + centre
    return fit_rpc(lon_lat, height, camera(lon_lat, height, size, **of_camera)).rpc  # type: ignore[arg-type]


def to_rasterio(rpc: RPC) -> rasterio.rpc.RPC:
    return rasterio.rpc.RPC.from_gdal(rpc_to_tags(rpc))


def rasterio_project(
    rpcs: rasterio.rpc.RPC, lon_lat: FloatArray, height_m: FloatArray
) -> FloatArray:
    """Return GDAL's image positions, with the first pixel's centre at 0."""
    with RPCTransformer(rpcs) as transformer:
        rows, cols = transformer.rowcol(*lon_lat.T, zs=height_m, op=lambda value: value)
    return np.column_stack([cols, rows]) - 0.5


def real_tags(path: Path) -> dict[str, str]:
    with rasterio.open(path) as dataset:
        return dict(dataset.tags(ns="RPC"))


def relief(lon_lat: FloatArray) -> FloatArray:
    """Return smooth heights, (n,), between 100 and 500 m."""
    x, y = (np.asarray(lon_lat) - [9.0, 45.15]).T * 111_195.0
    return 300 + 120 * np.sin(x / 110) * np.cos(y / 90) + 80 * np.sin((x + y) / 230)


def write_dem(
    path: Path,
    crs: str = "EPSG:4326",
    size: int = 60,
    pixel_m: float = 25.0,
    offset_m: float = 0.0,
    steepness: float = 1.0,
    **more: object,
) -> Path:
    """Write `relief` around the camera's image as a raster of any CRS."""
    crs_of = CRS.from_user_input(crs)
    centre = reproject(np.array([[9.0, 45.15]]), LON_LAT, crs_of)[0]
    step = pixel_m / (111_195.0 if crs_of.is_geographic else 1.0)
    corner = centre + [-size / 2 * step, size / 2 * step]
    transform = Affine(step, 0, corner[0], 0, -step, corner[1])
    grid = Grid(transform, crs_of, size, size)
    cols, rows = np.meshgrid(np.arange(size), np.arange(size))
    xy = grid.pixel_to_map(np.column_stack([cols.ravel(), rows.ravel()]))
    heights = relief(reproject(xy, crs_of, LON_LAT)).reshape(size, size)
    heights = 300 + steepness * (heights - 300) + offset_m
    holes = more.pop("holes", None)
    if holes is not None:
        heights[holes] = -32768
        more["nodata"] = -32768
    return write_raster(path, heights.astype(np.float32), grid, **more)


def write_positions(path: Path, rpc: RPC, size: tuple[int, int] = (600, 500)) -> Path:
    """Write an image whose two bands hold the column and row of each pixel."""
    bands = np.stack(np.meshgrid(np.arange(size[0]), np.arange(size[1]))).astype(np.float32)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        write_raster(path, bands, rpcs=to_rasterio(rpc))
    return path
