"""A terrain model as an image of itself: as the sun lights it, or as a radar images it."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..geometry.views import RADAR
from .grid import Grid
from .handles import read_by
from .height_units import in_metres
from .metadata import BandInfo
from .reading import FloatImage, RasterSource, Window

SUN = "sun"
LIGHTS = (SUN, RADAR)

# Light from all the sky, as a share of the sun's on level ground; slopes that face the radar are
# brighter than level ground by so much at most, as what is laid over has no end.
_AMBIENT = 0.3
_BRIGHTEST = 10.0

# A radar image and what is rendered of a terrain model are matched at pixels this many times as
# large: speckle averages out, and relief has larger forms than what it covers. Measured with
# `benchmarks/run.py --only mountains`: of hills at 1, 6 of 16 pairs are accepted, at 2 all 16.
_RADAR_OF_TERRAIN = 2.0


@dataclass(frozen=True)
class Light:
    """Where the sun or a radar stands, seen from the ground: 45° above the horizon.

    This elevation hardly counts: similarity asks where brightness changes, not by how much.

    Parameters
    ----------
    kind
        One of `LIGHTS`.
    azimuth_deg
        Clockwise from north.
    """

    kind: str
    azimuth_deg: float

    @property
    def enlargement(self) -> float:
        """How many times as large as the coarser image's pixels those are that match in it best."""
        return _RADAR_OF_TERRAIN if self.kind == RADAR else 1.0

    def shade(self, east: FloatImage, north: FloatImage) -> FloatImage:
        """Return how bright ground is that rises by so much per metre to the east and north.

        The sun's light is Lambert's cosine over that of level ground. A radar gathers in a pixel,
        which is a step in range, what lies in it of the ground: the more, the more this faces the
        radar. Ground that turns away from it farther than it stands high is in radar shadow.
        """
        azimuth = math.radians(self.azimuth_deg)
        away = -(east * np.float32(math.sin(azimuth)) + north * np.float32(math.cos(azimuth)))
        if self.kind == SUN:
            direct = np.maximum(1 + away, 0) / np.sqrt(1 + east**2 + north**2)
            return np.asarray(_AMBIENT + (1 - _AMBIENT) * direct, np.float32)
        power = 1 / np.maximum(1 - away, np.float32(1 / _BRIGHTEST))
        return np.asarray(np.where(away < -1, 0, np.sqrt(power)), np.float32)


def rendered(source: RasterSource, light: Light, band: int | None = None) -> RasterSource:
    """Return a raster of heights as one of brightness; pixels are rendered as they are read.

    Parameters
    ----------
    source
        Heights; or what was rendered of it, which is rendered anew.
    light
        What lights it.
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
    """Lends itself as handles do, and renders what is read."""

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

        It has one band, of float32, and nothing but these tells what is valid.
        """
        (top, bottom), (left, right) = window.toranges()
        around = Window(int(left) - 1, int(top) - 1, int(right - left) + 2, int(bottom - top) + 2)
        stored, valid = self.heights.read(around, self.band)
        values = in_metres(stored, self.heights, self.band)
        values[~valid] = np.nan
        return self.light.shade(*_slopes(values, self.heights.grid))[None]


def _slopes(heights_m: FloatImage, grid: Grid) -> tuple[FloatImage, FloatImage]:
    """Return how heights, (h + 2, w + 2), rise per metre to the east and to the north, (h, w)."""
    along = (heights_m[1:-1, 2:] - heights_m[1:-1, :-2]) / 2
    down = (heights_m[2:, 1:-1] - heights_m[:-2, 1:-1]) / 2
    t, (east_m, north_m) = grid.transform, grid.metres_per_unit
    determinant = t.a * t.e - t.b * t.d
    x = (along * t.e - down * t.d) / (determinant * east_m)
    y = (down * t.a - along * t.b) / (determinant * north_m)
    return x.astype(np.float32), y.astype(np.float32)
