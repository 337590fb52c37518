"""Small scenes with a sensor image, its terrain and a reference of the same ground."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from affine import Affine
from numpy.typing import NDArray
from raster_files import write_raster
from rasterio.crs import CRS
from rpc_models import camera_rpc, to_rasterio, write_dem
from scipy.spatial import cKDTree

from groundtie.rasters.grid import Grid
from groundtie.rasters.kernels import interpolate
from groundtie.rasters.reading import open_raster
from groundtie.sensor.bias import Bias, fold
from groundtie.sensor.orientation import orient
from groundtie.sensor.rpc import RPC

UTM = CRS.from_epsg(32632)
SIZE = (420, 400)
_REFERENCE_PX = 460


@dataclass(frozen=True)
class Scene:
    """Files of a scene; the image has `delivered` RPCs, of which `truth` are the right ones."""

    image: Path
    reference: Path
    dem: Path
    truth: RPC
    delivered: RPC

    def error_px(self, rpc: RPC) -> float:
        """Return the largest error of RPCs over the image."""
        px = np.stack(np.meshgrid(*(np.linspace(0, side - 1, 8) for side in SIZE)), -1)
        ground = self.truth.localise(px.reshape(-1, 2), 300.0)
        return float(np.abs(rpc.project(ground, 300.0) - px.reshape(-1, 2)).max())


def ground_texture(size: int, seed: int = 0) -> NDArray[np.float32]:
    """Return fields of one grey value each, (size, size), 20 to 235."""
    random = np.random.default_rng(seed)
    count = size * size // 900
    pixels = np.stack(np.meshgrid(np.arange(size), np.arange(size)), -1).reshape(-1, 2)
    field = cKDTree(random.uniform(0, size, (count, 2))).query(pixels)[1].reshape(size, size)
    image = random.uniform(20, 235, count).astype(np.float32)[field]
    return np.asarray(cv2.GaussianBlur(image, (0, 0), 0.8))


def make_scene(folder: Path, bias: Bias | None, seed: int = 0) -> Scene:
    """Make a scene of 1 m pixels, with hills of 100 m and RPCs that a bias makes wrong."""
    truth = camera_rpc(SIZE)
    dem = write_dem(folder / "dem.tif", size=90, steepness=0.25)
    image = folder / "image.tif"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        write_raster(image, np.zeros(SIZE[::-1], np.uint8), rpcs=to_rasterio(truth))
    texture = ground_texture(_REFERENCE_PX, seed)
    with open_raster(image, allow_sensor_geometry=True) as source, open_raster(dem) as terrain:
        orientation = orient(source, truth, UTM, terrain)
        centre = np.round(orientation.to_map([[SIZE[0] / 2, SIZE[1] / 2]])[0])
        corner = centre + [-_REFERENCE_PX / 2, _REFERENCE_PX / 2]
        grid = Grid(Affine(1, 0, corner[0], 0, -1, corner[1]), UTM, _REFERENCE_PX, _REFERENCE_PX)
        px = np.stack(np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1])), -1).reshape(-1, 2)
        place = grid.map_to_pixel(orientation.to_map(px)).T.reshape(2, SIZE[1], SIZE[0])
    inside = np.all((place > 0) & (place < _REFERENCE_PX - 1), axis=0)
    seen = interpolate(texture, np.where(inside, place, 0.0), "cubic")
    delivered = truth if bias is None else fold(truth, bias).rpc
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        write_raster(
            image,
            np.where(inside, np.clip(seen, 1, 255), 0).astype(np.uint8),
            nodata=0,
            rpcs=to_rasterio(delivered),
        )
    # Another radiometry, and speckle.
    speckle = np.random.default_rng(seed + 1).gamma(6.0, 1 / 6.0, texture.shape)
    shown = np.clip((255 - texture) * speckle, 1, 255).astype(np.uint8)
    reference = write_raster(folder / "reference.tif", shown, grid)
    return Scene(image, reference, dem, truth, delivered)
