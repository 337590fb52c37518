"""Terrain models rendered as images: lit by the sun, or imaged by a radar."""

from __future__ import annotations

import contextlib
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..geometry.views import RADAR, direction
from .grid import Grid
from .handles import read_by
from .height_surfaces import read_heights
from .metadata import BandInfo
from .reading import FloatImage, RasterSource, Window

SUN = "sun"
LIGHTS = (SUN, RADAR)

# Share of diffuse light from the sky in the brightness of level ground.
_AMBIENT = 0.3

# Largest radar power of slopes relative to level ground: in layover it would be unlimited.
_BRIGHTEST = 10.0

# A radar image and a rendered terrain model are matched at pixels this many times as large: speckle
# averages out, and relief has larger forms than the land cover. Measured with `benchmarks/run.py
# --only mountains`: in hills, 6 of 16 pairs are accepted at 1, and all 16 at 2.
_RADAR_OF_TERRAIN = 2.0


@dataclass(frozen=True)
class Light:
    """Direction of the sun or of a radar, seen from the ground, 45° above the horizon.

    The elevation hardly matters: similarity depends on where brightness changes, not by how much.

    Parameters
    ----------
    kind
        One of `LIGHTS`.
    azimuth_deg
        Azimuth, clockwise from north.
    """

    kind: str
    azimuth_deg: float

    @property
    def enlargement(self) -> float:
        """Best size of matching pixels, as a multiple of the coarser image's pixel size."""
        return _RADAR_OF_TERRAIN if self.kind == RADAR else 1.0

    def shade(self, east: FloatImage, north: FloatImage) -> FloatImage:
        """Return the brightness of ground with slopes, per metre, to the east and north.

        Sunlight follows Lambert's cosine law, relative to level ground. A radar pixel is a step in
        slant range and collects the echoes of all ground within it: the more, the more the slope
        faces the radar. Slopes facing away by more than the radar's elevation are in radar shadow.
        """
        to_east, to_north = map(np.float32, direction(self.azimuth_deg))
        away = -(east * to_east + north * to_north)
        if self.kind == SUN:
            direct = np.maximum(1 + away, 0) / np.sqrt(1 + east**2 + north**2)
            return np.asarray(_AMBIENT + (1 - _AMBIENT) * direct, np.float32)
        power = 1 / np.maximum(1 - away, np.float32(1 / _BRIGHTEST))
        return np.asarray(np.where(away < -1, 0, np.sqrt(power)), np.float32)


def rendered(source: RasterSource, light: Light, band: int | None = None) -> RasterSource:
    """Return a raster of heights as a raster of brightness, rendered as it is read.

    Parameters
    ----------
    source
        Heights; a rendered raster is rendered anew from its heights.
    light
        Direction and kind of the illumination.
    band
        Number of the band of heights; None: the first.
    """
    before = source._handles
    heights = source
    if isinstance(before, _Rendering):
        heights, band = before.heights, before.band
    brightness = BandInfo.plain("float32", float("nan"))
    return replace(read_by(heights, _Rendering(heights, light, band or 1), brightness), tags={})


@dataclass(frozen=True)
class _Rendering:
    """Handles that lend themselves, and render heights as they are read."""

    heights: RasterSource
    light: Light
    band: int

    @property
    def identity(self) -> Hashable:
        return (self.heights._handles.identity, self.light)

    @contextlib.contextmanager
    def borrow(self) -> Iterator[_Rendering]:
        yield self

    def close(self) -> None:
        self.heights.close()

    def read(self, indexes: Sequence[int], *, window: Any, out_dtype: Any) -> FloatImage:
        """Return the brightness of a window, shape (1, h, w); NaN if unknown.

        The only band is of float32; nothing but NaN marks invalid pixels.
        """
        (top, bottom), (left, right) = window.toranges()
        around = Window(int(left) - 1, int(top) - 1, int(right - left) + 2, int(bottom - top) + 2)
        values, valid = read_heights(self.heights, around, band=self.band)
        values[~valid] = np.nan
        return self.light.shade(*_slopes(values, self.heights.grid))[None]


def _slopes(heights_m: FloatImage, grid: Grid) -> tuple[FloatImage, FloatImage]:
    """Return slopes per metre to the east and to the north, (h, w), of heights (h + 2, w + 2)."""
    along = (heights_m[1:-1, 2:] - heights_m[1:-1, :-2]) / 2
    down = (heights_m[2:, 1:-1] - heights_m[:-2, 1:-1]) / 2
    t = grid.transform
    determinant = t.determinant
    x, y = (along * t.e - down * t.d) / determinant, (down * t.a - along * t.b) / determinant
    east, north = (x * step[0] + y * step[1] for step in grid.east_north)
    return east.astype(np.float32), north.astype(np.float32)
