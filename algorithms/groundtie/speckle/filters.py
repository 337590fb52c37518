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
from numpy.polynomial.polynomial import polyval
from numpy.typing import NDArray

from ..rasters.reading import FloatImage, Mask
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


def _enhanced_frost(by: SpeckleFilter, tile: _Tile) -> FloatImage:
    """Return the enhanced Frost filter's estimate [Lopes1990a].

    C is the coefficient of variation, Cu² = 1 / looks and Cmax² = 1 + 2 / looks. Where C is at most
    Cu, as of speckle alone, the result is the local mean. Where it is at least Cmax, more than
    speckle on any texture, the result is the pixel itself. Between the two, it is the mean with
    weights exp(-damping (C - Cu) / (Cmax - C) d) at the city-block distance d.

    For each damping, the weighted sum is a polynomial in exp(-damping), whose coefficients are the
    sums over all pixels at each distance. They need no more additions than a plain convolution with
    equal dampings.
    """
    speckle, most = np.float32(np.sqrt(1 / by.looks)), np.float32(np.sqrt(1 + 2 / by.looks))
    variation = np.sqrt(tile.local.variation2)
    # As the variation nears Cmax, the weight of a neighbour becomes 0.
    share = np.maximum(variation - speckle, 0) / np.maximum(most - variation, np.float32(1e-3))
    step = np.exp(np.float32(-by.damping) * share)
    step[variation >= most] = 0
    total = _sum_by_distance(tile.padded, step, tile.reach_px)
    if tile.counted.all():
        weight = polyval(step, _pixels_at(tile.reach_px))
    else:
        weight = _sum_by_distance(tile.counted.astype(np.float32), step, tile.reach_px)
        weight = np.maximum(weight, np.float32(1e-6))
    return np.asarray(total / weight)


def _sum_by_distance(padded: FloatImage, step: FloatImage, half: int) -> FloatImage:
    """Return the sum over the window of pixels times step^distance, shape of `step`."""
    height, width = step.shape
    # Sums of the pixels k to the left and k to the right.
    pairs = [padded[:, half : half + width]]
    pairs += [
        padded[:, half - k : half - k + width] + padded[:, half + k : half + k + width]
        for k in range(1, half + 1)
    ]
    total = np.zeros_like(step)
    for distance in range(2 * half, -1, -1):
        total *= step
        for down in range(max(0, distance - half), min(distance, half) + 1):
            lines = pairs[distance - down]
            total += lines[half + down : half + down + height]
            if down:
                total += lines[half - down : half - down + height]
    return total


def _pixels_at(half: int) -> NDArray[np.float32]:
    """Return the number of pixels of a window at each city-block distance from its centre."""
    offset = np.abs(np.arange(-half, half + 1))
    return np.bincount(np.add.outer(offset, offset).ravel()).astype(np.float32)


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
    "enhanced-frost": _enhanced_frost,
    "lee": _lee,
    "kuan": _kuan,
    "gamma-map": _gamma_map,
    "isef": _exponential,
}
