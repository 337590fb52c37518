"""Speckle filters for intensity images with nodata.

Filters and their assumptions on the scene beneath the speckle: `lee` and `kuan` the best linear
estimate, `enhanced-frost` an exponential correlation, `gamma-map` a gamma distribution, `isef`
none.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..rasters.reading import FloatImage, Mask
from .frost import enhanced_frost
from .isef import decay_for_window, isef
from .statistics import LocalStatistics, local_statistics

# Side of tiles that fit, with all intermediates of filters, into the processor's cache.
_TILE_PX = 256

# Distance, in windows, beyond which an exponential filter's weight is less than a ten thousandth.
_ISEF_REACH = 3


@dataclass(frozen=True)
class SpeckleFilter:
    """A filter and its parameters.

    Parameters
    ----------
    name
        One of `FILTERS`.
    window_px
        Side of the window, odd; for "isef", that of the mean filter that smooths as much.
    looks
        Equivalent number of looks of the images.
    damping
        Damping of "enhanced-frost"; larger values keep more of edges and of speckle.
    """

    name: str
    window_px: int
    looks: float
    damping: float = 1.0

    @property
    def reach_px(self) -> int:
        """Largest distance at which a pixel influences another."""
        return _ISEF_REACH * self.window_px if self.name == "isef" else self.window_px // 2

    def __call__(self, intensity: FloatImage, valid: Mask) -> FloatImage:
        """Return the filtered intensity, float32 of shape (h, w); 0 where invalid.

        Parameters
        ----------
        intensity
            Power of the signal, float32 of shape (h, w).
        valid
            Which pixels count, shape (h, w); the others are left out.
        """
        intensity = np.where(valid, intensity, np.float32(0))
        reach = self.reach_px
        padded, counted = np.pad(intensity, reach), np.pad(valid, reach)
        out = np.empty_like(intensity)
        for row in range(0, intensity.shape[0], _TILE_PX):
            for col in range(0, intensity.shape[1], _TILE_PX):
                around = np.s_[row : row + _TILE_PX + 2 * reach, col : col + _TILE_PX + 2 * reach]
                tile = _Tile(padded[around], counted[around], reach)
                out[row : row + _TILE_PX, col : col + _TILE_PX] = FILTERS[self.name](self, tile)
        out[~valid] = 0
        # Running sums leave values slightly below 0 behind strong scatterers.
        return np.maximum(out, np.float32(0), out=out)


@dataclass(frozen=True)
class _Tile:
    """Pixels with a margin as wide as a filter's reach on each side, and which of them count."""

    padded: FloatImage
    counted: Mask
    reach_px: int

    @property
    def inside(self) -> tuple[slice, slice]:
        """The tile without its margin."""
        return np.s_[self.reach_px : -self.reach_px, self.reach_px : -self.reach_px]

    @property
    def intensity(self) -> FloatImage:
        return self.padded[self.inside]

    @cached_property
    def local(self) -> LocalStatistics:
        """Statistics in windows that reach as far as the margin."""
        local = local_statistics(self.padded, self.counted, 2 * self.reach_px + 1)
        return LocalStatistics(local.mean[self.inside], local.variation2[self.inside])


def _lee(by: SpeckleFilter, tile: _Tile) -> FloatImage:
    """Return Lee's estimate for multiplicative noise [Lee1980]."""
    return _linear(tile, _signal_share(tile.local, by.looks))


def _kuan(by: SpeckleFilter, tile: _Tile) -> FloatImage:
    """Return Kuan's estimate [Kuan1985]."""
    return _linear(tile, _signal_share(tile.local, by.looks) / np.float32(1 + 1 / by.looks))


def _frost(by: SpeckleFilter, tile: _Tile) -> FloatImage:
    return enhanced_frost(tile.padded, tile.counted, tile.local, by.looks, by.damping)


def _gamma_map(by: SpeckleFilter, tile: _Tile) -> FloatImage:
    """Return the gamma MAP estimate [Lopes1990b]."""
    mean, variation2 = tile.local.mean, tile.local.variation2
    looks, speckle2 = np.float32(by.looks), np.float32(1 / by.looks)
    alpha = (1 + speckle2) / np.maximum(variation2 - speckle2, np.float32(1e-6))
    centre = (alpha - looks - 1) * mean
    root = np.sqrt(centre * centre + 4 * alpha * looks * tile.intensity * mean)
    likeliest = (centre + root) / (2 * alpha)
    smooth = np.where(variation2 > speckle2, likeliest, mean)
    # Beyond this the scene has no gamma distribution: the pixel is a single strong target.
    return np.where(variation2 < 2 * speckle2, smooth, tile.intensity)


def _exponential(by: SpeckleFilter, tile: _Tile) -> FloatImage:
    decay = decay_for_window(by.window_px)
    smooth = isef(tile.padded, decay)[tile.inside]
    if tile.counted.all():
        return smooth
    weight = isef(tile.counted.astype(np.float32), decay)[tile.inside]
    return np.asarray(smooth / np.maximum(weight, np.float32(1e-6)))


def _signal_share(local: LocalStatistics, looks: float) -> FloatImage:
    """Return the share of the local variance that is not due to speckle, 0 to 1."""
    share = 1 - np.float32(1 / looks) / np.maximum(local.variation2, np.float32(1e-6))
    return np.maximum(share, 0)


def _linear(tile: _Tile, weight: FloatImage) -> FloatImage:
    return tile.local.mean + weight * (tile.intensity - tile.local.mean)


FILTERS: dict[str, Callable[[SpeckleFilter, _Tile], FloatImage]] = {
    "enhanced-frost": _frost,
    "lee": _lee,
    "kuan": _kuan,
    "gamma-map": _gamma_map,
    "isef": _exponential,
}
