"""Power over slant range of a side-looking radar: ground, roofs, walls and wall–ground corners.

The radar looks along +columns; each row of the scene is processed independently. All heights are in
pixels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter

from ..rasters.reading import FloatImage

# Sample points per pixel; least height of a wall; width of the Gaussian that smooths heights before
# wall normals are estimated; and tolerance of visibility tests, which allows for rounding.
_SAMPLES_PER_PIXEL = 2
_MIN_WALL_PX = 0.5
_NORMAL_SIGMA_PX = 1.5
LEVEL_PX = 0.05

# Power of a square metre of wall that faces the radar, and of the corner at its foot per pixel of
# wall height. The corner's power falls off within some degrees.
_WALL_BACKSCATTER = 0.3
_DOUBLE_BOUNCE_PER_PX = 1.2
_CORNER_WIDTH_COS = math.cos(math.radians(12))

# Share of a wall's power that comes from window corners, and their relative height in a storey.
_GLITTER_SHARE = 0.7
_SILL = 0.3


@dataclass(frozen=True)
class _RangeLine:
    """Bins of ground-projected slant range: a point at x with height z falls into x − z·cot."""

    rows: int
    origin: float
    bins: int

    def splat(
        self, row: npt.NDArray[np.intp], position: npt.NDArray, weight: npt.NDArray
    ) -> npt.NDArray[np.float64]:
        """Accumulate weights at positions, each shared between the two nearest bins."""
        offset = position - self.origin
        lower = np.floor(offset)
        share = offset - lower
        index = row * self.bins + lower.astype(np.intp)
        count = self.rows * self.bins
        total = np.zeros(count)
        total += np.bincount(index, weight * (1 - share), count)
        total += np.bincount(index + 1, weight * share, count)
        return total.reshape(self.rows, self.bins)


def range_power(
    terrain: FloatImage,
    objects: FloatImage,
    backscatter: FloatImage,
    building: npt.NDArray[np.bool_],
    windows: FloatImage,
    cot: float,
    storey_px: float,
    generator: np.random.Generator,
) -> FloatImage:
    """Accumulate power over slant range and geocode it."""
    top = terrain + objects
    lowest, highest = float(terrain.min()), float(top.max())
    rows, columns = terrain.shape
    reach = (highest - lowest) * cot
    line = _RangeLine(rows, math.floor(-highest * cot) - 2, int(columns + reach) + 8)
    slope = np.gradient(terrain, axis=1)
    skyline = _skyline(top + slope / 2, cot)
    power = _surface_power(line, top, slope, backscatter, skyline, cot)
    power += _wall_power(
        line, terrain + slope / 2, objects, building, windows, skyline, cot, storey_px, generator
    )
    position = np.arange(columns, dtype=np.float32) - terrain * np.float32(cot) - line.origin
    lower = position.astype(np.intp)
    share = position - lower
    flat = power.astype(np.float32).ravel()
    lower += np.arange(rows)[:, None] * line.bins
    return np.asarray(flat[lower] * (1 - share) + flat[lower + 1] * share, np.float32)


def _skyline(far_end: FloatImage, cot: float) -> npt.NDArray[np.float64]:
    """Return the largest height above the ray through x = 0, up to each pixel's far end."""
    over_ray = far_end + (np.arange(far_end.shape[1]) + 0.5) * cot
    return np.maximum.accumulate(over_ray, axis=1)


def _surface_power(
    line: _RangeLine,
    top: FloatImage,
    slope: FloatImage,
    backscatter: FloatImage,
    skyline: npt.NDArray[np.float64],
    cot: float,
) -> npt.NDArray[np.float64]:
    """Return the power of the visible ground, canopies and roofs."""
    row = np.broadcast_to(np.arange(top.shape[0])[:, None], top.shape)
    before = np.concatenate([np.full((len(row), 1), -np.inf), skyline[:, :-1]], axis=1)
    total = np.zeros((line.rows, line.bins))
    for k in range(_SAMPLES_PER_PIXEL):
        offset = (k + 0.5) / _SAMPLES_PER_PIXEL - 0.5
        x = np.arange(top.shape[1]) + offset
        z = top + slope * np.float32(offset)
        seen = np.nonzero(z + x * cot >= before - LEVEL_PX)
        position = (x - z * cot)[seen]
        weight = backscatter[seen] / _SAMPLES_PER_PIXEL
        total += line.splat(row[seen], position, weight)
    return total


def _wall_power(
    line: _RangeLine,
    ground: FloatImage,
    objects: FloatImage,
    building: npt.NDArray[np.bool_],
    windows: FloatImage,
    skyline: npt.NDArray[np.float64],
    cot: float,
    storey_px: float,
    generator: np.random.Generator,
) -> npt.NDArray[np.float64]:
    """Return the power of the walls that face the radar and of the corners at their feet."""
    step = np.diff(objects, axis=1)
    row, left = np.nonzero((step > _MIN_WALL_PX) & building[:, 1:])
    x = left + 0.5
    foot = ground[row, left] + objects[row, left]
    head = ground[row, left] + objects[row, left + 1]
    visible_foot = np.maximum(foot, skyline[row, left] - x * cot)
    visible = np.maximum(head - visible_foot, 0)
    facing = _facing(objects, row, left)
    # Each storey has its own power, constant over its range: windows and balconies differ.
    storeys = np.ceil(visible / storey_px).astype(np.intp)
    wall = np.repeat(np.arange(len(row)), storeys)
    storey = np.arange(len(wall)) - np.repeat(np.cumsum(storeys) - storeys, storeys)
    height = visible[wall] / storeys[wall]
    low = (head - visible)[wall] + storey * height
    drawn = generator.standard_exponential(len(wall))
    gain = windows[row, left + 1][wall]
    plain = np.where(gain < 0, 1, 1 - _GLITTER_SHARE)
    strength = drawn * facing[wall] ** 2 * _WALL_BACKSCATTER * plain
    # The running sum over the edges of these boxes. They lie half a pixel further because a bin
    # extends half a pixel to both sides of its position.
    edges = x[wall] + 0.5 - np.stack([low + height, low]) * cot
    ends = np.stack([strength / cot, -strength / cot])
    total = np.cumsum(line.splat(np.tile(row[wall], 2), edges.ravel(), ends.ravel()), axis=1)
    # The windows of a wall are identical, so that their corners form a regular lattice.
    glitter = (1 + drawn) / 2 * height * np.maximum(gain, 0)
    glitter *= facing[wall] ** 2 * _WALL_BACKSCATTER * _GLITTER_SHARE
    total += line.splat(row[wall], x[wall] - (low + _SILL * height) * cot, glitter)
    grounded = visible_foot <= foot + LEVEL_PX
    corner = np.exp((facing - 1) / (1 - _CORNER_WIDTH_COS)) * visible * grounded
    strength = generator.standard_exponential(len(row)) * _DOUBLE_BOUNCE_PER_PX
    total += line.splat(row, x - foot * cot, corner * strength)
    return np.maximum(total, 0)


def _facing(
    objects: FloatImage, row: npt.NDArray[np.intp], left: npt.NDArray[np.intp]
) -> npt.NDArray[np.float32]:
    """Return the cosine between wall normals, from smoothed heights, and the look direction."""
    smooth = gaussian_filter(objects, _NORMAL_SIGMA_PX)
    down = np.gradient(smooth, axis=0)[row, left] if objects.shape[0] > 1 else np.zeros(len(row))
    along = smooth[row, left + 1] - smooth[row, left]
    return np.abs(along) / np.maximum(np.hypot(along, down), 1e-6)
