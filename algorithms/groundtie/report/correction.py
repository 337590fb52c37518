"""How far, and in which direction, a transform moves the input."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..geometry.transform import Transform
from ..rasters.grid import Grid

# The correction is looked at on a lattice of so many points a side.
_LATTICE = 9


@dataclass(frozen=True)
class Correction:
    """How far a transform moves the input from its nominal place, in matching pixels.

    Parameters
    ----------
    centre_px, least_px, most_px
        Lengths at the centre of the matching grid, and over it.
    direction
        The move at the centre along the axes of the map, in words.
    """

    centre_px: float
    least_px: float
    most_px: float
    direction: str

    @classmethod
    def of(cls, transform: Transform, grid: Grid) -> Correction:
        """Measure a transform over the matching grid."""
        axes = [np.linspace(0, side - 1, _LATTICE) for side in (grid.width, grid.height)]
        px = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
        xy = grid.pixel_to_map(px)
        nominal = transform.model(xy)
        lengths = np.hypot(*(grid.map_to_pixel(nominal) - px).T)
        centre = len(px) // 2
        move = xy[centre] - nominal[centre]
        return cls(
            float(lengths[centre]), float(lengths.min()), float(lengths.max()), _words(move, grid)
        )


def _words(move: NDArray[np.float64], grid: Grid) -> str:
    """Return a move in map units along both axes, as "3.0 m east, 1.5 m north"."""
    # A map without georeferencing is the pixel lattice, y downwards.
    on_map = grid.is_georeferenced
    ways = (("west", "east"), ("south", "north")) if on_map else (("left", "right"), ("up", "down"))
    scale, unit = (grid.metres_per_unit, "m") if on_map else ((1.0, 1.0), "px")
    lengths = [f"{abs(length):.1f}" for length in move * scale]
    parts = [
        f"{text} {unit} {way[int(length > 0)]}"
        for text, length, way in zip(lengths, move, ways, strict=True)
        if text != "0.0"
    ]
    return ", ".join(parts)
