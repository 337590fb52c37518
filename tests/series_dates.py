"""Small simulated series with known displacements, and networks of links between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from affine import Affine
from numpy.typing import NDArray
from raster_files import UTM, utm_grid, write_raster
from scipy.ndimage import gaussian_filter, map_coordinates
from speckled_pairs import speckled
from textured_pairs import texture

from groundtie.rasters.grid import Grid
from groundtie.series.frame import SeriesFrame
from groundtie.series.network import Link

FloatArray = NDArray[np.float64]

_MARGIN_PX = 30
GRID = Grid(Affine(10, 0, 500_000, 0, -10, 5_000_000), UTM, 400, 300)
FRAME = SeriesFrame.around(GRID, [GRID, GRID])


def shifted(x: float, y: float) -> FloatArray:
    """Return the displacement of a shift."""
    return np.array([x, y, 0.0, 0.0, 0.0, 0.0])


def link(
    first: int,
    second: int,
    truth: FloatArray,
    sigma_px: float | FloatArray,
    error: FloatArray | None = None,
) -> Link:
    """Return the link of two dates by their true displacements (n, 6), and an error of it.

    Its standard deviation is that of all six parameters, or of each.
    """
    matrices = [FRAME.matrix(truth[date]) for date in (first, second)]
    between = FRAME.of_matrix(matrices[1] @ np.linalg.inv(matrices[0]))
    wrong = np.zeros(6) if error is None else error
    return Link(first, second, between + wrong, np.square(sigma_px) * np.eye(6))


def star_and_chain(count: int) -> list[tuple[int, int]]:
    """Return the pairs of a network: each date with date 0, and with the next."""
    return [(0, date) for date in range(1, count)] + [
        (date, date + 1) for date in range(1, count - 1)
    ]


@dataclass(frozen=True)
class Dates:
    """Files of a series, and where the georeferencing of each has the ground, in pixels."""

    folder: Path
    files: tuple[Path, ...]
    displacement_px: FloatArray

    @property
    def names(self) -> list[str]:
        return [path.stem for path in self.files]


def write_dates(
    folder: Path,
    count: int,
    size: int = 200,
    *,
    elsewhere: Sequence[int] = (),
    cloudy: Sequence[int] = (),
    looks: float | None = None,
    seed: int = 0,
) -> Dates:
    """Write dates of one texture with random shifts; some show another place, or clouds.

    With a number of looks they are amplitudes of a radar, each with its own speckle.
    """
    folder.mkdir(parents=True, exist_ok=True)
    rng = np.random.default_rng(seed)
    grid = utm_grid(size, size)
    ground = texture(size + 2 * _MARGIN_PX, size + 2 * _MARGIN_PX, seed)
    shifts = rng.uniform(-4, 4, (count, 2))
    rows, cols = np.mgrid[:size, :size] + float(_MARGIN_PX)
    files = []
    for date in range(count):
        canvas = texture(*ground.shape, 900 + date) if date in elsewhere else ground
        place = [rows - shifts[date, 1], cols - shifts[date, 0]]
        seen = map_coordinates(canvas, place, mode="mirror")
        if looks is None:
            values = 1000 + 200 * (seen + 0.3 * rng.normal(size=seen.shape))
        else:
            values = speckled(300 * np.exp(0.6 * seen), looks, 100 * seed + date)
        if date in cloudy:
            deck = gaussian_filter(rng.normal(size=seen.shape), 20)
            cloud = deck > np.quantile(deck, 0.1)
            values[cloud] = 3000 + 50 * rng.normal(size=int(cloud.sum()))
        path = folder / f"place_2021{date + 1:02d}10.tif"
        files.append(write_raster(path, np.clip(values, 1, 65_535).astype(np.uint16), grid))
    return Dates(folder, tuple(files), shifts)
