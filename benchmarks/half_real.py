"""Half-real sensor images: a real optical image as a real sensor model would have seen it.

The optical image of a real SAR–optical pair is projected into a sensor image over synthetic
terrain, by the RPCs of a real Pléiades image; the SAR image stays on the map. The radiometry is
thus real, and the geometry is known.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import rasterio
from affine import Affine
from numpy.typing import NDArray
from rasterio.crs import CRS

from groundtie.rasters.grid import LON_LAT, FloatArray, Grid, mesh, reproject
from groundtie.rasters.kernels import interpolate
from groundtie.rasters.reading import open_raster
from groundtie.sensor.bias import Bias, fold
from groundtie.sensor.heights import terrain_heights
from groundtie.sensor.orientation import Orientation
from groundtie.sensor.rpc import RPC
from groundtie.sensor.rpc_files import read_rpc
from groundtie.sensor.rpc_tags import rpc_from_tags, rpc_to_tags

from .cases import RealCase, read_cases, write_image

PLACES = ("so-rosenheim", "so-dense-urban", "so-interchange", "so-fields")
TRIPLET = "rpc-triplet/img_02.tif"
VENTOUX = "rpc-ventoux/RPC_PHR1B_P_201308051042194_SEN_690908101-001.XML"
SENSORS = {"triplet": TRIPLET, "ventoux": VENTOUX}

LARGEST_SHIFT_PX = 50.0
LARGEST_DRIFT_PX = 4.0
BIASES = 5

_DEM_PIXEL_M = 10.0
_RELIEF_M = 60.0
_MARGIN_PX = 60


@dataclass(frozen=True)
class SensorScene:
    """Files of a sensor image with biased RPCs, and the truth.

    Parameters
    ----------
    image, reference, dem
        The files; heights are ellipsoidal.
    truth
        The RPCs by which the image was made.
    delivered
        The biased RPCs that are delivered with it.
    size
        Width and height of the image.
    sigma_px
        Uncertainty of the truth, in image pixels.
    """

    image: Path
    reference: Path
    dem: Path
    truth: RPC
    delivered: RPC
    size: tuple[int, int]
    sigma_px: float

    def error_px(self, rpc: RPC) -> float:
        """Return the RMSE of RPCs over the whole image, in image pixels."""
        px = mesh(*(np.linspace(0, side - 1, 15) for side in self.size))
        height = self.truth.offset[2]
        found = rpc.project(self.truth.localise(px, height), height)
        return float(np.sqrt(np.mean(((found - px) ** 2).sum(axis=1))))


def bias_of(number: int, size: tuple[int, int]) -> Bias:
    """Return one of the biases: shifts in all directions to 50 px, every second with a drift."""
    random = np.random.default_rng(100 + number)
    angle = 2 * np.pi * (number + random.random()) / BIASES
    length = LARGEST_SHIFT_PX * (number + 1) / BIASES
    shift = length * np.array([np.cos(angle), np.sin(angle)])
    if number % 2 == 0:
        return Bias("shift", size, shift[None], np.zeros((2, 2)))
    drift = random.uniform(-LARGEST_DRIFT_PX, LARGEST_DRIFT_PX, 2)
    return Bias("shift_drift", size, np.stack([shift, drift]), np.zeros((4, 4)))


def place_case(data: Path, name: str) -> RealCase:
    """Return a real pair by its name."""
    return next(case for case in read_cases(data) if case.name == name)


def sensor_of(place: str, number: int) -> str:
    """Return the source of the RPCs of a scene; sources alternate."""
    return tuple(SENSORS)[(PLACES.index(place) + number) % len(SENSORS)]


def sensor_rpc(data: Path, name: str) -> RPC:
    """Return the RPCs of a real image."""
    path = data / SENSORS[name]
    if path.suffix == ".XML":
        return read_rpc(path)
    with rasterio.open(path) as dataset:
        return rpc_from_tags(dataset.tags(ns="RPC"), str(path))


def make_scene(case: RealCase, sensor: RPC, number: int, folder: Path) -> SensorScene:
    """Make the files of one scene.

    Parameters
    ----------
    case
        The real pair.
    sensor
        RPCs of a real image, in whose middle the scene lies.
    number
        Number of the bias.
    folder
        Where the files are written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with rasterio.open(case.reference) as dataset:
        sar = dataset.read()
    with rasterio.open(case.input) as dataset:
        optical = dataset.read()
    longitude, latitude, height = sensor.offset
    crs = CRS.from_epsg(32600 + int((longitude + 180) // 6) + 1)
    centre = reproject(np.array([[longitude, latitude]]), LON_LAT, crs)[0]
    pixel_m = _pixel_size_m(sensor)
    rows, cols = sar.shape[1:]
    corner = np.round(centre + [-cols / 2 * pixel_m, rows / 2 * pixel_m])
    grid = Grid(Affine(pixel_m, 0, corner[0], 0, -pixel_m, corner[1]), crs, cols, rows)
    reference = write_image(sar, grid.transform, folder / "reference.tif", crs)
    dem = _write_terrain(folder / "dem.tif", grid, height)
    with open_raster(dem) as source:
        lon_lat = reproject(grid.pixel_to_map(grid.outline()), crs, LON_LAT)
        heights = terrain_heights(source, None, lon_lat)

        def exact(xy: FloatArray) -> FloatArray:
            return reproject(xy, crs, LON_LAT)

        seen = Orientation(sensor, heights, crs, exact).to_px(grid.pixel_to_map(grid.outline()))
        truth = sensor.shifted(-np.floor(seen.min(axis=0)) + 0.0)
        size = tuple(np.ceil(np.ptp(seen, axis=0)).astype(int).tolist())
        orientation = Orientation(truth, heights, crs, exact)
        bands = _sensor_image(optical, case, grid, orientation, size)
    delivered = fold(truth, bias_of(number, size)).rpc
    image = write_image(bands, None, folder / "image.tif", None, nodata=0)
    with rasterio.open(image, "r+") as dataset:
        dataset.rpcs = rasterio.rpc.RPC.from_gdal(rpc_to_tags(delivered))
    return SensorScene(image, reference, dem, truth, delivered, size, case.sigma_px)


def _pixel_size_m(rpc: RPC) -> float:
    """Return the side of an image pixel on the ground, at the centre of the RPCs."""
    centre, right, below = rpc.localise(rpc.image_offset + np.eye(3, 2, -1), rpc.offset[2])
    metres = 111_195.0 * np.array([np.cos(np.deg2rad(rpc.offset[1])), 1.0])
    return float(np.sqrt(abs(np.linalg.det(np.array([right - centre, below - centre]) * metres))))


def _write_terrain(path: Path, grid: Grid, height_m: float) -> Path:
    """Write hills around a height, over a grid with a margin."""
    reach = 3 * _RELIEF_M + 200.0
    left, top = grid.transform.c, grid.transform.f
    cols = int((grid.width * grid.transform.a + 2 * reach) / _DEM_PIXEL_M) + 2
    rows = int((grid.height * grid.transform.a + 2 * reach) / _DEM_PIXEL_M) + 2
    transform = Affine(_DEM_PIXEL_M, 0, left - reach, 0, -_DEM_PIXEL_M, top + reach)
    noise = np.random.default_rng(5).normal(size=(rows, cols))
    hills = cv2.GaussianBlur(noise, (0, 0), 8.0)
    hills = _RELIEF_M / 2 * hills / np.abs(hills).max()
    heights = (height_m + hills).astype(np.float32)
    return write_image(heights[None], transform, path, grid.crs)


def _sensor_image(
    optical: NDArray[np.uint8],
    case: RealCase,
    grid: Grid,
    orientation: Orientation,
    size: tuple[int, int],
) -> NDArray[np.uint8]:
    width, height = size
    bands = np.zeros((len(optical), height, width), np.uint8)
    cols = np.arange(width, dtype=float)
    for top in range(0, height, 64):
        rows = np.arange(top, min(top + 64, height), dtype=float)
        px = mesh(cols, rows)
        place = case.reference_to_input(grid.map_to_pixel(orientation.to_map(px)))
        inside = np.isfinite(place).all(axis=1)
        inside &= (place >= 0).all(axis=1) & (place <= np.array(optical.shape[:0:-1]) - 1).all(
            axis=1
        )
        at = np.where(inside[:, None], place, 0.0).T.reshape(2, len(rows), width)
        for band, values in zip(bands, optical, strict=True):
            found = interpolate(values.astype(np.float32), at, "cubic")
            found = np.clip(np.rint(found), 1, 255)
            band[top : top + 64] = np.where(inside.reshape(found.shape), found, 0)
    return bands
