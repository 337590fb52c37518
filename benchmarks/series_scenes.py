"""Series of dates with exact truth: one simulated ground, imaged anew on each date."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rasterio
from affine import Affine
from scipy.ndimage import map_coordinates

from groundtie.rasters.grid import compose

from .accuracy import FloatArray
from .cases import REFERENCE_TRANSFORM, read_image, write_image
from .clouds import clouds_over, fractal
from .simulations import Simulation

# Error of each date's georeferencing: shift, and linear part at the borders.
_SHIFT_PX, _LINEAR_PX = 12.0, 0.5

# Seasonal change: share of the ground's range by which patches change; and noise.
_SEASON, _NOISE = 0.25, 0.04
_CLOUD_SHARE = 0.9

# Side of a date, and margin of the ground beyond it.
_SIZE_PX, _MARGIN_PX = 560, 40


@dataclass(frozen=True)
class SimulatedSeries:
    """A series and its truth.

    Parameters
    ----------
    files
        The dates.
    displacement_px
        Displacement of the ground by the georeferencing of each date: shift at the centre, and its
        increase to the right and to the lower border, (x, y) each, shape (n, 6).
    elsewhere, cloudy
        Dates that show another place, and dates that show clouds.
    """

    files: tuple[Path, ...]
    displacement_px: FloatArray
    elsewhere: tuple[int, ...]
    cloudy: tuple[int, ...]

    @property
    def good(self) -> list[int]:
        """The dates that belong to the series."""
        return [k for k in range(len(self.files)) if k not in self.elsewhere + self.cloudy]


def simulate_series(
    folder: Path, cache: Path, seed: int, count: int, bad: Sequence[int]
) -> SimulatedSeries:
    """Write a series; the first half of the `bad` dates show another place, the others clouds.

    Date 0 has the right georeferencing.
    """
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(seed)
    ground, other = (_ground(cache, one) for one in (seed, seed + 50))
    half = (len(bad) + 1) // 2
    elsewhere, cloudy = tuple(bad[:half]), tuple(bad[half:])
    moved = np.column_stack(
        [
            rng.uniform(-_SHIFT_PX, _SHIFT_PX, (count, 2)),
            rng.uniform(-_LINEAR_PX, _LINEAR_PX, (count, 4)),
        ]
    )
    moved[0] = 0.0
    files = []
    for date in range(count):
        seen = _seen(other if date in elsewhere else ground, moved[date])
        image = aged(seen, rng)
        if date in cloudy:
            image = clouds_over(image, _CLOUD_SHARE, seed + date).over(image)
        values = np.clip(image * 200 + 20, 1, 255).astype(np.uint8)
        path = folder / f"date_{2001 + date}.tif"
        files.append(write_image(values[None], REFERENCE_TRANSFORM, path))
    return SimulatedSeries(tuple(files), moved, elsewhere, cloudy)


def pairwise_px(displacements: FloatArray) -> FloatArray:
    """Return the pairwise differences of several errors (n, 6), rms over a date, (n, n)."""
    apart = displacements[:, None] - displacements[None]
    squared = (apart.reshape(*apart.shape[:2], 3, 2) ** 2).sum(axis=-1)
    return np.asarray(np.sqrt(squared @ [1, 1 / 3, 1 / 3]))


def write_moved(source: Path, target: Path, shift_px: tuple[float, float]) -> Path:
    """Write a raster whose geotransform is shifted by some pixels to the right and down."""
    with rasterio.open(source) as raster:
        profile, values, transform = raster.profile, raster.read(), raster.transform
    profile["transform"] = compose(transform, Affine.translation(*shift_px))
    with rasterio.open(target, "w", **profile) as raster:
        raster.write(values)
    return target


def aged(image: FloatArray, rng: np.random.Generator) -> np.ndarray:
    """Return an image, 0 to 1, in another season: patches of other brightness, gain, noise."""
    patches = np.round(fractal(image.shape, 3.0, rng))
    gain, gamma = rng.uniform(0.7, 1.0), rng.uniform(0.8, 1.25)
    seasonal = gain * np.clip(image, 0, 1) ** gamma + _SEASON * 0.5 * patches
    return np.asarray(seasonal + rng.normal(0, _NOISE, image.shape), np.float32)


def _ground(cache: Path, seed: int) -> FloatArray:
    """Return a simulated optical scene, 0 to 1, larger than the dates."""
    pair = Simulation(_SIZE_PX + 2 * _MARGIN_PX, "suburban", seed).pair(cache)
    grey = read_image(pair.input).mean(axis=0)
    low, high = np.quantile(grey, (0.01, 0.99))
    return np.asarray(np.clip((grey - low) / (high - low), 0, 1), np.float64)


def _seen(ground: FloatArray, displacement: FloatArray) -> FloatArray:
    """Return the image of a date whose georeferencing is wrong by a displacement."""
    half = _SIZE_PX / 2
    rows, cols = np.mgrid[:_SIZE_PX, :_SIZE_PX].astype(float)
    nominal = np.stack([cols, rows], axis=-1)
    centre = (_SIZE_PX - 1) / 2
    shift, linear = displacement[:2], displacement[2:].reshape(2, 2)
    # nominal = ground + shift + (ground − centre) / half · linear, solved for the ground.
    matrix = np.eye(2) + linear / half
    place = (nominal - centre - shift) @ np.linalg.inv(matrix) + centre + _MARGIN_PX
    return np.asarray(map_coordinates(ground, [place[..., 1], place[..., 0]], order=3))
