"""Pairs of any size, made by repeating one simulated square in files of their own.

Every second copy is mirrored: a scene that repeats within a quarter of it is refused.

The square's images are exactly aligned; only the georeferencing of the input is wrong. No pixel is
resampled, and the truth is exact: each pixel of the input shows the ground of the same pixel of the
reference.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rasterio
import rasterio.windows
from affine import Affine
from numpy.typing import NDArray

from groundtie.rasters.grid import compose

from .accuracy import Truth
from .attempt import Pair
from .simulations import Simulation

TILE_PX = 5000
_SEED = 1

# Error of the input's georeferencing: a shift, and a linear part that reaches this at the borders.
_SHIFT_PX = (5.0, -6.0)
_WARP_PX = 3.0

_BLOCK_PX = 512


def tile_pair(cache: Path) -> Pair:
    """Return the square that larger pairs repeat; it takes a minute to make unless in `cache`."""
    exact = (("distortion", "shift"),)
    return Simulation(TILE_PX, "rural", _SEED, 0.0, exact).pair(cache)


def large_pair(tile: Pair, size: int, folder: Path) -> Pair:
    """Write a pair of `size`² pixels into a folder; the square is repeated in mirrors, or cut."""
    reference, input = folder / "reference.tif", folder / "input.tif"
    repeat(tile.reference, reference, size, Affine.identity())
    repeat(tile.input, input, size, wrong(size))
    truth = Truth.on_lattice(lambda px: px, (size, size), np.eye(2))
    return Pair(reference, input, truth, truth)


def wrong(size: int) -> Affine:
    """Return the map from the true corners of the input's pixels to their stated positions.

    Both are in pixels of the reference from its first corner, as in geotransforms.
    """
    centre, rise = size / 2, _WARP_PX / (size / 2)
    around = Affine(1 + rise, -rise, 0, rise, 1 - rise, 0)
    shifted = Affine.translation(centre + _SHIFT_PX[0], centre + _SHIFT_PX[1])
    return compose(shifted, around, Affine.translation(-centre, -centre))


def repeat(source: Path, target: Path, size: int, moved: Affine) -> None:
    """Write a raster of `size`² pixels of another raster and its mirror images, strip by strip.

    Parameters
    ----------
    source, target
        The files.
    size
        Width and height in pixels.
    moved
        Error of its georeferencing; see `wrong`.
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
    columns = _mirrored(np.arange(size), image.shape[2])
    with rasterio.open(target, "w", **profile) as raster:
        for row in range(0, size, _BLOCK_PX):
            rows = _mirrored(np.arange(row, min(row + _BLOCK_PX, size)), image.shape[1])
            window = rasterio.windows.Window(0, row, size, len(rows))
            raster.write(image[:, rows][:, :, columns], window=window)


def _mirrored(positions: NDArray[np.int_], side: int) -> NDArray[np.int_]:
    """Return where positions lie on a side that is followed by its mirror image, and so on."""
    place = positions % (2 * side)
    return np.minimum(place, 2 * side - 1 - place)
