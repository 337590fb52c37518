"""Speckle filters, of intensity images with nodata.

Their names, and what they take for granted of the scene beneath the speckle: `lee` and `kuan` the
best linear estimate, `enhanced-frost` an exponential correlation, `gamma-map` a gamma distribution,
`isef` nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .frost import enhanced_frost
from .isef import decay_for_window, isef
from .statistics import FloatImage, LocalStatistics, Mask, local_statistics

# Side of tiles that stay, with all that filters need, in the processor's cache.
_TILE_PX = 256

# Beyond so many windows an exponential filter weighs less than a ten thousandth.
_ISEF_REACH = 3


@dataclass(frozen=True)
class SpeckleFilter:
    """A filter and its parameters.

    Parameters
    ----------
    name
        One of `FILTERS`.
    window_px
        Side of the window, odd; that of the mean that smooths as much for "isef".
    looks
        Equivalent number of looks of the images.
    damping
        Of "enhanced-frost"; larger values keep more of edges and of speckle.
    """

    name: str
    window_px: int
    looks: float
    damping: float = 1.0

    @property
    def reach_px(self) -> int:
        """How far off a pixel influences another."""
        return _ISEF_REACH * self.window_px if self.name == "isef" else self.window_px // 2

    def __call__(self, intensity: FloatImage, valid: Mask) -> FloatImage:
        """Return the filtered intensity, float32 of shape (h, w); 0 where invalid.

        Parameters
        ----------
        intensity
            Power of the signal, float32 of shape (h, w).
        valid
            Which pixels count, shape (h, w); the others weigh nothing.
        """
        intensity = np.where(valid, intensity, np.float32(0))
        by_window = FILTERS[self.name]
        if by_window is None:
            return np.where(valid, _exponential(self, intensity, valid), np.float32(0))
        half = self.reach_px
        padded, counted = np.pad(intensity, half), np.pad(valid, half)
        out = np.empty_like(intensity)
        for row in range(0, intensity.shape[0], _TILE_PX):
            for col in range(0, intensity.shape[1], _TILE_PX):
                around = np.s_[row : row + _TILE_PX + 2 * half, col : col + _TILE_PX + 2 * half]
                tile = _Window.of(padded[around], counted[around], self.window_px)
                out[row : row + _TILE_PX, col : col + _TILE_PX] = by_window(self, tile)
        out[~valid] = 0
        return out


@dataclass(frozen=True)
class _Window:
    """A tile with margins of half a window, and what lies within: pixels and their statistics."""

    padded: FloatImage
    counted: Mask
    intensity: FloatImage
    local: LocalStatistics

    @classmethod
    def of(cls, padded: FloatImage, counted: Mask, window_px: int) -> _Window:
        half = window_px // 2
        inside = np.s_[half:-half, half:-half]
        local = local_statistics(padded, counted, window_px)
        local = LocalStatistics(local.mean[inside], local.variation2[inside])
        return cls(padded, counted, padded[inside], local)


def _lee(by: SpeckleFilter, window: _Window) -> FloatImage:
    """Lee 1980, doi:10.1109/TPAMI.1980.4766994, for multiplicative noise."""
    return _linear(window, _signal_share(window.local, by.looks))


def _kuan(by: SpeckleFilter, window: _Window) -> FloatImage:
    """Kuan et al. 1985, doi:10.1109/TPAMI.1985.4767641."""
    return _linear(window, _signal_share(window.local, by.looks) / np.float32(1 + 1 / by.looks))


def _frost(by: SpeckleFilter, window: _Window) -> FloatImage:
    return enhanced_frost(window.padded, window.counted, window.local, by.looks, by.damping)


def _gamma_map(by: SpeckleFilter, window: _Window) -> FloatImage:
    """Lopes, Nezry, Touzi and Laur 1990, doi:10.1109/IGARSS.1990.689026."""
    mean, variation2 = window.local.mean, window.local.variation2
    looks, speckle2 = np.float32(by.looks), np.float32(1 / by.looks)
    alpha = (1 + speckle2) / np.maximum(variation2 - speckle2, np.float32(1e-6))
    centre = (alpha - looks - 1) * mean
    root = np.sqrt(centre * centre + 4 * alpha * looks * window.intensity * mean)
    likeliest = (centre + root) / (2 * alpha)
    smooth = np.where(variation2 > speckle2, likeliest, mean)
    # Beyond this there is no gamma distribution left: a single strong target.
    return np.where(variation2 < 2 * speckle2, smooth, window.intensity)


def _exponential(by: SpeckleFilter, intensity: FloatImage, valid: Mask) -> FloatImage:
    decay, reach = decay_for_window(by.window_px), by.reach_px
    inside = np.s_[reach:-reach, reach:-reach]
    smooth = isef(np.pad(intensity, reach), decay)[inside]
    if valid.all():
        # A product of what is inside along either axis, at a fraction of the cost.
        height, width = valid.shape
        rows = isef(np.pad(np.ones((height, 1), np.float32), ((reach, reach), (0, 0))), decay)
        cols = isef(np.pad(np.ones((1, width), np.float32), ((0, 0), (reach, reach))), decay)
        return np.asarray(smooth / (rows[reach:-reach] * cols[:, reach:-reach]))
    weight = isef(np.pad(valid.astype(np.float32), reach), decay)[inside]
    return np.asarray(smooth / np.maximum(weight, np.float32(1e-6)))


def _signal_share(local: LocalStatistics, looks: float) -> FloatImage:
    """Return the share of the local variance that is not speckle's, 0 to 1."""
    share = 1 - np.float32(1 / looks) / np.maximum(local.variation2, np.float32(1e-6))
    return np.maximum(share, 0)


def _linear(window: _Window, weight: FloatImage) -> FloatImage:
    return window.local.mean + weight * (window.intensity - window.local.mean)


# "isef" is recursive: it has no window.
FILTERS: dict[str, Callable[[SpeckleFilter, _Window], FloatImage] | None] = {
    "enhanced-frost": _frost,
    "lee": _lee,
    "kuan": _kuan,
    "gamma-map": _gamma_map,
    "isef": None,
}
