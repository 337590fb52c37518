"""Pairs of small images that are easy to register, with a shift that is known exactly."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rasterio
import rasterio.transform
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

SIZE = 384
# How far the input's georeferencing is off, in metres, which are pixels.
SHIFT = (4.0, -3.0)
ORIGIN = (500_000.0, 5_000_000.0)


def write_pair(folder: Path, seed: int, size: int = SIZE) -> None:
    """Write reference.tif and input.tif: smooth noise, and its noisy negative, moved."""
    random = np.random.Generator(np.random.PCG64(seed))
    ground = gaussian_filter(random.normal(size=(size, size)), 3)
    ground = np.clip(128 + 40 * ground / ground.std(), 1, 254)
    noise = random.normal(0, 5, (2, size, size))
    right = rasterio.transform.from_origin(*ORIGIN, 1, 1)
    write_raster(folder / "reference.tif", ground[None], right)
    moved = rasterio.transform.from_origin(ORIGIN[0] + SHIFT[0], ORIGIN[1] + SHIFT[1], 1, 1)
    write_raster(folder / "input.tif", 255 - ground + noise, moved)


def write_raster(path: Path, bands: NDArray[np.float64], transform: rasterio.Affine | None) -> None:
    """Write bands, shape (n, height, width); without a transform there is no CRS either."""
    count, height, width = bands.shape
    profile = {"driver": "GTiff", "dtype": "uint8", "count": count}
    if transform is not None:
        profile |= {"crs": "EPSG:32633", "transform": transform}
    with rasterio.open(path, "w", height=height, width=width, **profile) as raster:
        raster.write(np.clip(bands, 1, 254).astype("uint8"))


def true_input_px(reference_xy: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the input pixels (col, row) of reference map positions, both shape (n, 2)."""
    return (reference_xy - ORIGIN) * [1, -1] - 0.5


# Tie points without error, as the Georeferencer of QGIS writes them.
POINTS = "#CRS: EPSG:32633\nmapX,mapY,sourceX,sourceY,enable,dX,dY,residual\n" + "".join(
    f"{x},{y},{x + SHIFT[0]},{y + SHIFT[1]},1,0,0,0\n"
    for x, y in ((500_050, 4_999_950), (500_300, 4_999_900), (500_200, 4_999_700))
)
