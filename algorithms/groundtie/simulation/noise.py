"""Seeded random streams and smooth random fields, both available strip by strip."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
import numpy.typing as npt

from ..rasters.kernels import bspline_weights

STRIP_ROWS = 256


class Stream(IntEnum):
    """Purposes of random streams; no two purposes share random numbers."""

    TERRAIN = 1
    LAYOUT = 2
    SURFACES = 3
    CROWNS = 4
    SAR_TEXTURE = 5
    SAR_PATCHES = 6
    SAR_WALLS = 7
    SPECKLE = 8
    OPTICAL_TEXTURE = 9
    OPTICAL_PATCHES = 10
    OPTICAL_NOISE = 11
    DISTORTION = 12
    CHECK_POINTS = 13
    CHANGES = 14
    TRAFFIC = 15
    ROOF_POINTS = 16
    ATTITUDE = 17
    TERRAIN_ERROR = 18


def random_stream(seed: int, stream: Stream, part: int = 0) -> np.random.Generator:
    """Return the generator for one purpose and one part of it (a strip, an octave, a band)."""
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence([seed, stream, part])))


def strips(rows: int) -> Iterator[tuple[int, int, int]]:
    """Yield (index, first row, row after the last) of strips that cover `rows` rows."""
    for index, start in enumerate(range(0, rows, STRIP_ROWS)):
        yield index, start, min(start + STRIP_ROWS, rows)


@dataclass(frozen=True)
class SmoothNoise:
    """A smooth random field: a cubic B-spline over a lattice of normal numbers.

    Parameters
    ----------
    lattice : float32 array
        Spline coefficients, one every `cell_px` pixels in both directions.
    cell_px : float
        Lattice spacing, about half the wavelength of the field.
    width : int
        Number of columns of the field.
    """

    lattice: npt.NDArray[np.float32]
    cell_px: float
    width: int

    @classmethod
    def draw(
        cls, shape: tuple[int, int], cell_px: float, generator: np.random.Generator
    ) -> SmoothNoise:
        """Draw a field of (rows, columns) with approximately zero mean and unit deviation."""
        nodes = [int(np.ceil(size / cell_px)) + 4 for size in shape]
        lattice = generator.standard_normal(tuple(nodes), dtype=np.float32)
        # The sum of squared weights of a cubic B-spline has mean 151/315 in each direction.
        return cls(lattice * np.float32(315 / 151), cell_px, shape[1])

    def rows(self, start: int, stop: int) -> npt.NDArray[np.float32]:
        """Return rows `start` to `stop` (exclusive) as float32 array (stop − start, width)."""
        nodes, weights = _spline_taps(np.arange(start, stop) / self.cell_px)
        by_row = sum(w[:, None] * self.lattice[nodes + k] for k, w in enumerate(weights))
        nodes, weights = _spline_taps(np.arange(self.width) / self.cell_px)
        field = np.zeros((stop - start, self.width), np.float32)
        for k, weight in enumerate(weights):
            field += np.take(by_row, nodes + k, axis=1) * weight
        return field


def _spline_taps(
    position: npt.NDArray[np.float64],
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.float32]]:
    """Return the first lattice node and the four cubic B-spline weights of each position."""
    node = np.floor(position).astype(np.intp)
    return node, bspline_weights(4, position - node).astype(np.float32)
