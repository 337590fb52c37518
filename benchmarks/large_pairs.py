"""Pairs of any size out of one simulated square, laid side by side in files of their own.

The square's images lie exactly on each other. What is wrong is the georeferencing of the input, so
that no pixel is resampled and the truth is exact: each pixel of the input shows the ground of the
same pixel of the reference.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rasterio
import rasterio.windows
from affine import Affine

from groundtie.rasters.grid import compose

from .accuracy import Truth
from .attempt import Pair
from .simulations import Simulation

TILE_PX = 5000
_SEED = 1

# What the georeferencing of the input is wrong by: a shift, and as much more at the borders.
_SHIFT_PX = (5.0, -6.0)
_WARP_PX = 3.0

_BLOCK_PX = 512


def tile_pair(cache: Path) -> Pair:
    """Return the square that larger pairs are made of; it takes a minute unless `cache` has it."""
    exact = (("distortion", "shift"),)
    return Simulation(TILE_PX, "rural", _SEED, 0.0, exact).pair(cache)


def large_pair(tile: Pair, size: int, folder: Path) -> Pair:
    """Write a pair of `size`² pixels into a folder; the square is repeated, or cut."""
    reference, input = folder / "reference.tif", folder / "input.tif"
    repeat(tile.reference, reference, size, Affine.identity())
    repeat(tile.input, input, size, wrong(size))
    truth = Truth.on_lattice(lambda px: px, (size, size), np.eye(2))
    return Pair(reference, input, truth, truth)


def wrong(size: int) -> Affine:
    """Return what takes corners of the input's pixels to where it claims them to be.

    Both count pixels of the reference from its first corner, as geotransforms do.
    """
    centre, rise = size / 2, _WARP_PX / (size / 2)
    around = Affine(1 + rise, -rise, 0, rise, 1 - rise, 0)
    shifted = Affine.translation(centre + _SHIFT_PX[0], centre + _SHIFT_PX[1])
    return compose(shifted, around, Affine.translation(-centre, -centre))


def repeat(source: Path, target: Path, size: int, moved: Affine) -> None:
    """Write a raster of `size`² pixels that repeats another one, strip by strip.

    Parameters
    ----------
    source, target
        The files.
    size
        Width and height in pixels.
    moved
        What its georeferencing is wrong by; see `wrong`.
    """
    with rasterio.open(source) as raster:
        image, profile = raster.read(), raster.profile
        transform = compose(raster.transform, moved)
    profile |= {
        "width": size,
        "height": size,
        "transform": transform,
        "blockxsize": _BLOCK_PX,
        "blockysize": _BLOCK_PX,
        "predictor": 2,
        "zlevel": 1,
        "num_threads": "all_cpus",
        "bigtiff": "if_safer",
    }
    columns = np.arange(size) % image.shape[2]
    with rasterio.open(target, "w", **profile) as raster:
        for row in range(0, size, _BLOCK_PX):
            rows = np.arange(row, min(row + _BLOCK_PX, size)) % image.shape[1]
            window = rasterio.windows.Window(0, row, size, len(rows))
            raster.write(image[:, rows][:, :, columns], window=window)
