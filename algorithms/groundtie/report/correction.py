"""The correction by a transform: shift, direction, rotation and scale of the input."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..geometry.transform import Transform
from ..rasters.grid import Grid


@dataclass(frozen=True)
class Correction:
    """The correction of the input's nominal position by a transform, in matching pixels.

    Parameters
    ----------
    centre_px, least_px, most_px
        Lengths at the centre of the matching grid, and over it.
    direction
        The move at the centre, in words.
    rotation_deg
        Rotation of the input, anticlockwise as displayed.
    scale
        Enlargement of the input.
    centre_m
        Length at the centre on the ground; None without georeferencing.
    """

    centre_px: float
    least_px: float
    most_px: float
    direction: str
    rotation_deg: float
    scale: float
    centre_m: float | None

    @classmethod
    def of(cls, transform: Transform, grid: Grid) -> Correction:
        """Measure a transform over the matching grid."""
        px = grid.places()
        xy = grid.pixel_to_map(px)
        nominal = transform.model(xy)
        lengths = np.hypot(*(grid.map_to_pixel(nominal) - px).T)
        centre = len(px) // 2
        move = xy[centre] - nominal[centre]
        return cls(
            float(lengths[centre]),
            float(lengths.min()),
            float(lengths.max()),
            move_in_words(move, grid),
            *_turn(nominal, xy, grid),
            float(np.hypot(*(move * grid.metres_per_unit))) if grid.is_georeferenced else None,
        )

    def text(self) -> str:
        """Return the correction in words, the values that readers look for first in front."""
        size, in_metres = f"{self.centre_px:.1f} px", ""
        if self.centre_m is not None:
            in_metres = f" ({self.centre_m:.1f} m)"
        direction = f": {self.direction}" if self.direction else ""
        turn = turn_in_words(self.rotation_deg)
        rotated = f"rotated by {turn}" if turn else "not rotated"
        least, most = f"{self.least_px:.1f}", f"{self.most_px:.1f}"
        over = "the same" if least == most else f"by {least} to {most} px"
        return (
            f"{size}{in_metres} at the centre{direction}; {over} over the grid; "
            f"{rotated}, scaled by {self.scale:.4f}"
        )

    def summary(self) -> dict[str, Any]:
        """Return the correction as JSON values."""
        return {name: value for name, value in vars(self).items() if name != "centre_m"}


def turn_in_words(rotation_deg: float) -> str:
    """Return a rotation (positive: anticlockwise) as "0.09° clockwise"; "" below 0.005°."""
    if abs(rotation_deg) < 0.005:
        return ""
    return f"{abs(rotation_deg):.2f}° {'anticlockwise' if rotation_deg > 0 else 'clockwise'}"


def _turn(nominal: NDArray[np.float64], xy: NDArray[np.float64], grid: Grid) -> tuple[float, float]:
    """Return rotation (degrees) and scale of the affine map that fits a move best."""
    # Metres, with y upwards as displayed.
    seen = np.array(grid.metres_per_unit) * ([1, 1] if grid.is_georeferenced else [1, -1])
    before, after = ((places - places.mean(axis=0)) * seen for places in (nominal, xy))
    (a, b), (c, d) = np.linalg.lstsq(before, after, rcond=None)[0].T
    return float(np.rad2deg(np.arctan2(c - b, a + d))), float(np.sqrt(abs(a * d - b * c)))


def move_in_words(move: NDArray[np.float64], grid: Grid) -> str:
    """Return a move in map units as "3.0 m east, 1.5 m north".

    Without georeferencing it is in matching pixels, as lengths are.
    """
    # Without georeferencing, map positions are pixels, y downwards.
    on_map = grid.is_georeferenced
    ways = (("west", "east"), ("south", "north")) if on_map else (("left", "right"), ("up", "down"))
    moved = move @ np.linalg.inv(grid.east_north)
    moved, unit = (moved, "m") if on_map else (moved / grid.pixel_sides_m, "px")
    lengths = [f"{abs(length):.1f}" for length in moved]
    parts = [
        f"{text} {unit} {way[int(length > 0)]}"
        for text, length, way in zip(lengths, moved, ways, strict=True)
        if text != "0.0"
    ]
    return ", ".join(parts)
