"""Land cover classes with their radar backscatter and optical reflectance.

Backscatter is that of X-band at medium incidence (order of magnitude of [Ulaby1989]). Reflectances
are rounded values of common spectral libraries. Both are drawn independently, so that they are
related only through the class, and not monotonically.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
import numpy.typing as npt

BANDS = ("blue", "green", "red", "nir")


class Cover(IntEnum):
    """Land cover class of a pixel."""

    ROAD = 0
    FIELD = 1
    GRASS = 2
    FOREST = 3
    WATER = 4
    BUILDING = 5
    PAVEMENT = 6
    CAR = 7
    RAIL = 8
    ASPHALT = 9


PLAIN_WALL = 0.22

OPEN_GROUND = (Cover.ROAD, Cover.FIELD, Cover.GRASS, Cover.PAVEMENT, Cover.ASPHALT)

Reflectance = tuple[float, float, float, float]


@dataclass(frozen=True)
class _Surface:
    """Backscatter range (dB) and possible spectra of one class."""

    backscatter_db: tuple[float, float]
    spectra: tuple[Reflectance, ...]
    spread: float


_SURFACES = {
    Cover.ROAD: _Surface((-20, -17), ((0.08, 0.09, 0.10, 0.12), (0.24, 0.28, 0.31, 0.34)), 0.08),
    Cover.FIELD: _Surface(
        (-16, -7),
        (
            (0.09, 0.13, 0.18, 0.25),  # bare soil
            (0.15, 0.21, 0.28, 0.36),  # stubble, dry soil
            (0.04, 0.09, 0.05, 0.45),  # dense crop
            (0.06, 0.12, 0.09, 0.38),  # young crop
            (0.07, 0.17, 0.20, 0.42),  # ripening crop
        ),
        0.15,
    ),
    Cover.GRASS: _Surface((-14, -11), ((0.05, 0.10, 0.07, 0.40), (0.08, 0.13, 0.11, 0.33)), 0.1),
    Cover.FOREST: _Surface((-9.5, -7.5), ((0.02, 0.045, 0.025, 0.30),), 0.15),
    Cover.WATER: _Surface((-24, -21), ((0.055, 0.05, 0.03, 0.01), (0.07, 0.08, 0.05, 0.02)), 0.1),
    Cover.BUILDING: _Surface(
        (-15, -6),
        (
            (0.09, 0.12, 0.24, 0.30),  # tiles
            (0.10, 0.11, 0.12, 0.14),  # bitumen
            (0.22, 0.24, 0.25, 0.26),  # gravel, concrete
            (0.42, 0.45, 0.47, 0.48),  # metal, white membrane
        ),
        0.15,
    ),
    Cover.PAVEMENT: _Surface((-16, -12), ((0.16, 0.18, 0.20, 0.23),), 0.2),
    Cover.CAR: _Surface(
        (-14, -1),
        (
            (0.45, 0.46, 0.46, 0.46),  # white
            (0.26, 0.27, 0.28, 0.29),  # silver
            (0.03, 0.03, 0.03, 0.03),  # black
            (0.05, 0.06, 0.25, 0.30),  # red
            (0.20, 0.10, 0.05, 0.12),  # blue
        ),
        0.2,
    ),
    Cover.ASPHALT: _Surface((-21, -18), ((0.08, 0.09, 0.10, 0.12),), 0.25),
    Cover.RAIL: _Surface((-13, -10), ((0.11, 0.13, 0.16, 0.19),), 0.15),
}


@dataclass(frozen=True)
class ParcelTable:
    """Properties of every parcel of a scene, indexed by the parcel number.

    Attributes
    ----------
    cover : uint8 array (n,)
        Class, a `Cover`.
    height_m : float32 array (n,)
        Height of roof or canopy above ground.
    backscatter_db : float32 array (n,)
        Radar backscatter coefficient.
    reflectance : float32 array (n, 4)
        Reflectance in `BANDS`.
    rows_rad : float32 array (n,)
        Direction across the plough rows of a field or the tracks of a railway.
    window_m : float32 array (n,)
        Spacing of the windows in a building's walls, whose corners are bright radar targets; 0
        for plain walls.
    wall_reflectance : float32 array (n,)
        Reflectance of the walls, in all bands.
    """

    cover: npt.NDArray[np.uint8]
    height_m: npt.NDArray[np.float32]
    backscatter_db: npt.NDArray[np.float32]
    reflectance: npt.NDArray[np.float32]
    rows_rad: npt.NDArray[np.float32]
    window_m: npt.NDArray[np.float32]
    wall_reflectance: npt.NDArray[np.float32]


class ParcelBook:
    """Collects parcels while a scene is laid out."""

    def __init__(self, generator: np.random.Generator) -> None:
        self._generator = generator
        # In the order of the table's columns.
        self._rows: list[tuple[int, float, float, Reflectance, float, float, float]] = []

    def add(
        self, cover: Cover, height_m: float = 0.0, rows_rad: float = 0.0, window_m: float = 0.0
    ) -> int:
        """Draw a parcel's radiometry and return its number."""
        surface = _SURFACES[cover]
        low, high = surface.backscatter_db
        radar, choice, *shades = self._generator.random(6).tolist()
        spectrum = surface.spectra[int(choice * len(surface.spectra))]
        brightness = 1 + surface.spread * (2 * shades[0] - 1)
        blue, green, red, nir = (
            value * brightness * (1 + 0.08 * (2 * shades[1 + band // 2] - 1) * (-1) ** band)
            for band, value in enumerate(spectrum)
        )
        decibels, spectrum = low + (high - low) * radar, (blue, green, red, nir)
        wall = PLAIN_WALL if window_m == 0 else 0.12 + 0.22 * shades[3]
        self._rows.append((int(cover), height_m, decibels, spectrum, rows_rad, window_m, wall))
        return len(self._rows) - 1

    def cover(self, number: int) -> Cover:
        """Return the class of a parcel."""
        return Cover(self._rows[number][0])

    def table(self) -> ParcelTable:
        """Return all parcels added so far."""
        cover, *numbers = zip(*self._rows, strict=True)
        return ParcelTable(np.array(cover, np.uint8), *(np.array(n, np.float32) for n in numbers))
