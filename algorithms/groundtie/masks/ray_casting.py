"""Visibility of the ground between buildings and trees, by rays cast over a surface model.

A surface model is sampled along rays that run away from the sensor. One running maximum along each
ray gives the height of the line of sight that grazes the objects nearer to the sensor.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from ..rasters.reading import FloatImage, Mask

_Lines = NDArray[np.float64]
_T = TypeVar("_T", bound=np.generic)

# Smaller differences of height are ignored: single precision resolves 0.001 m at 10 km.
_LEVEL_M = 0.05


@dataclass(frozen=True)
class Heights:
    """Heights of a piece of a map, all of them finite.

    Parameters
    ----------
    surface_m
        Height of the surface seen from above: roofs, canopies, ground, shape (h, w).
    ground_m
        Height of the bare ground, nowhere above the surface, shape (h, w).
    first_px
        Column and row of the first pixel on the whole map. Rays are laid out on the whole map, so
        that pieces of it join.
    """

    surface_m: FloatImage
    ground_m: FloatImage
    first_px: tuple[int, int] = (0, 0)


@dataclass(frozen=True)
class LineOfSight:
    """The line of sight from the ground to a far sensor, or to the sun.

    Parameters
    ----------
    towards_px
        Columns and rows for a metre of ground towards the sensor.
    angle_deg
        Angle between the line of sight and the vertical, 0 to below 90.
    """

    towards_px: tuple[float, float]
    angle_deg: float

    @property
    def tangent(self) -> float:
        """Tangent of the angle: the ground that a metre of height hides, in metres."""
        return math.tan(math.radians(self.angle_deg))

    @property
    def pixel_m(self) -> float:
        """Length on the ground of a pixel's width along the line."""
        return 1 / math.hypot(*self.towards_px)

    @property
    def rise_m(self) -> float:
        """Rise of the line towards the sensor over a pixel."""
        return self.pixel_m / self.tangent


def hidden_ground(heights: Heights, sight: LineOfSight) -> Mask:
    """Return the ground that is hidden from a camera, a radar or the sun, shape (h, w).

    An object of height h hides h · tan(angle from the vertical) of the level ground behind it.
    """
    if sight.tangent <= 0:
        return np.zeros(heights.surface_m.shape, bool)

    def hidden(surface: _Lines, ground: _Lines) -> Mask:
        return np.asarray(ground < _lowest_sight_m(surface, ground, sight.rise_m) - _LEVEL_M)

    return _along_rays(heights, sight, hidden)


def radar_echoes(heights: Heights, sight: LineOfSight) -> NDArray[np.int32]:
    """Return the number of echoes of elevated objects over each pixel's ground (layover), (h, w).

    Roofs and walls are imaged nearer to the radar than their feet, over the ground at the same
    range: nearer by h / tan(incidence) on level ground. Each visible pixel of a roof is one echo,
    and so is each pixel of the wall before it, down to the lowest visible one.
    """
    # Layover of a metre of height, in pixels of level ground.
    layover_px = 1 / (sight.pixel_m * sight.tangent)

    def echoes(surface: _Lines, ground: _Lines) -> NDArray[np.int32]:
        lowest = np.maximum(_lowest_sight_m(surface, ground, sight.rise_m), ground)
        row, col = np.nonzero(surface > lowest + _LEVEL_M)
        before = surface[row, np.maximum(col - 1, 0)]
        roof = surface[row, col]
        foot = np.clip(before, lowest[row, col], roof)
        # Ranges, in pixels of level ground and increasing away from the radar. A wall stands at the
        # near side of its pixel; the roof is one pixel long.
        own = np.arange(ground.shape[1]) - ground * layover_px
        far, near = (col - 0.5 - height * layover_px for height in (foot, roof))
        first = math.floor(min(float(own.min()), float(near.min(initial=0)))) - 1
        last = math.ceil(max(float(own.max()), float(far.max(initial=0)))) + 1
        # Pixels with centres in between.
        start, stop = (np.ceil(edge - first).astype(np.intp) for edge in (near, far))
        changes = np.zeros((len(ground), last - first + 2), np.int32)
        for at, step in ((start, 2), (start + 1, -1), (stop, -1)):
            np.add.at(changes, (row, at), step)
        place = _nearest(own) - first
        return np.take_along_axis(np.cumsum(changes, axis=1, dtype=np.int32), place, axis=1)

    return _along_rays(heights, sight, echoes)


def double_bounce(heights: Heights, sight: LineOfSight) -> NDArray[np.int32]:
    """Return the height, in pixels, of the wall facing the radar behind each pixel's ground.

    Double bounce between wall and ground has the range of the wall's foot, at any height on the
    wall. If the radar sees the foot, the whole wall is one bright line there. Shape (h, w); 0: no
    such wall. Source: [Suri2010].
    """

    def lines(surface: _Lines, ground: _Lines) -> NDArray[np.int32]:
        foot, lowest = surface[:, :-1], _lowest_sight_m(surface, ground, sight.rise_m)[:, :-1]
        is_foot = (foot <= ground[:, :-1]) & (foot >= lowest - _LEVEL_M)
        # Rising ground is no wall.
        is_foot &= surface[:, 1:] > ground[:, 1:]
        found = np.zeros(surface.shape, np.int32)
        high_px = _nearest(np.diff(surface) / sight.pixel_m)
        found[:, :-1] = np.where(is_foot, np.maximum(high_px, 0), 0)
        return found

    return _along_rays(heights, sight, lines)


def _lowest_sight_m(surface: _Lines, ground: _Lines, rise_m: float) -> _Lines:
    """Return the height of the lowest free line of sight over each pixel of rays; -inf: all free.

    Rays run away from the sensor along the columns; towards it, a line of sight rises by `rise_m`
    for each pixel. It grazes the far ends of pixels, where the ground lies halfway to the next one.
    """
    rise = np.arange(surface.shape[1]) * rise_m
    far_ends = surface[:, :-1] + np.diff(ground, axis=1) / 2 + rise[:-1] + rise_m / 2
    lowest = np.full_like(surface, -np.inf)
    lowest[:, 1:] = np.maximum.accumulate(far_ends, axis=1) - rise[1:]
    return lowest


def _along_rays(
    heights: Heights, sight: LineOfSight, function: Callable[[_Lines, _Lines], NDArray[_T]]
) -> NDArray[_T]:
    """Return a function's result on rays, shape (rays, length), that run away from the sensor.

    Rays lie a pixel apart, and so do their points, which take the value of the nearest pixel.
    """
    rows, cols = heights.surface_m.shape
    away = -np.array(sight.towards_px) * sight.pixel_m
    across = np.array([-away[1], away[0]])
    x, y = (np.arange(n) + first for n, first in zip((cols, rows), heights.first_px, strict=True))
    # The nearest of the map's rays, and the nearest point of that ray, for each pixel.
    ray, place = (_nearest(np.add.outer(y * axis[1], x * axis[0])) for axis in (across, away))
    aside, along = (np.arange(at.min(), at.max() + 1) for at in (ray, place))
    col, row = (
        np.clip(_nearest(np.add.outer(aside * across[k], along * away[k])) - at[0], 0, len(at) - 1)
        for k, at in enumerate((x, y))
    )
    at = row * cols + col
    surface, ground = (
        part.ravel()[at].astype(np.float64) for part in (heights.surface_m, heights.ground_m)
    )
    return function(surface, ground)[ray - aside[0], place - along[0]]


def _nearest(values: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the nearest whole numbers; halves are rounded up, independent of the origin."""
    return np.floor(values + 0.5).astype(np.intp)
