"""Bands of one image that show the ground at other pixels than the next band does.

Parallax between the detectors of a push-broom sensor, or careless stacking, displaces bands. They
are averaged before they are matched, and registered by one transform. Source: phase correlation
[Kuglin1975], of the strength of edges, which bands share whatever their contrast.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
import scipy.fft
from numpy.typing import NDArray

from ..rasters.patch import Patch
from ..rasters.reading import RasterSource
from ..rasters.windows import Window
from ..similarity.orientation import SCALES_PX, compress, edge_strength, squared_gradients
from ..similarity.peak import find_peak
from ..similarity.surface import Surface, normalise
from .matcher import Places
from .parts import SAME_PX

# Windows all over the image: at most so large, and so many along a side.
_WINDOW_PX, _MOST_ALONG = 192, 3

# Smaller windows hold too few edges.
_LEAST_PX = 32

# Phases are the same to so many pixels, by interpolation: without these frequencies, a shift by
# half a pixel has one peak, too.
_BLUR_PX = 0.7

# Bands are displaced if they correlate so many times better there than where they are, and by so
# many robust standard deviations. Measured on the shared images as they are (32, three missions'
# among them): up to 2.4 times and by up to 7, of a cirrus band, which shows no ground; of the
# others 1.0 times. Of bands displaced by 6 px and more: from 4.2 times and by 28 on.
_CLEAR, _LEAST_HEIGHT = 3.0, 14.0


@dataclass(frozen=True)
class BandShift:
    """A band that shows the ground elsewhere than the band before it.

    Parameters
    ----------
    bands
        Numbers of both, from 1.
    apart_px
        How far elsewhere, in pixels.
    """

    bands: tuple[int, int]
    apart_px: float


def band_shifts(source: RasterSource) -> Sequence[BandShift]:
    """Return the bands of an image, but alpha, that clearly are displaced against the one before.

    By whole images: windows all over it are compared, and their correlations added up.
    """
    bands = source.image_bands
    side = min(_WINDOW_PX, *source.grid.size)
    if len(bands) < 2 or side < _LEAST_PX:
        return ()
    places = Places.spread(source.grid, side, lambda n: np.clip(n // side, 1, _MOST_ALONG))
    corners = places.centres - side // 2
    windows = [Window(int(col), int(row), side, side) for col, row in corners]
    spectra = _spectra(source, windows, bands)
    found = []
    for one, other in pairwise(range(len(bands))):
        apart_px = _apart_px(spectra[:, one], spectra[:, other], side)
        if apart_px is not None:
            found.append(BandShift((bands[one], bands[other]), apart_px))
    return found


def _spectra(
    source: RasterSource, windows: Sequence[Window], bands: Sequence[int]
) -> NDArray[np.complex64]:
    """Return the spectra of edges in windows of bands, shape (windows, bands, h, w / 2 + 1)."""
    spectra = []
    for window in windows:
        values, valid = source.read_bands(window, bands)
        grey = np.abs(values) if source.is_complex else values
        patch = Patch(np.where(valid, grey, 0).astype(np.float32), valid)
        (finest,) = squared_gradients(compress(patch), patch.valid, SCALES_PX[:1])
        edges = edge_strength(finest, patch.valid)
        counts = edges.valid.sum(axis=(-2, -1), keepdims=True)
        sums = np.where(edges.valid, edges.values, 0).sum(axis=(-2, -1), keepdims=True)
        centred = np.where(edges.valid, edges.values - sums / np.maximum(counts, 1), 0)
        taper = np.outer(np.hanning(window.height), np.hanning(window.width))
        spectra.append(scipy.fft.rfft2((centred * taper).astype(np.float32)))
    return np.array(spectra)


def _apart_px(one: NDArray[np.complex64], other: NDArray[np.complex64], side: int) -> float | None:
    """Return how far apart two bands are by spectra of windows of a side, (windows, …); None: not.

    Also if nothing is clear.
    """
    cross = one.conj() * other
    size = np.abs(cross)
    phases = np.divide(cross, size, out=np.zeros_like(cross), where=size > 0).sum(axis=0)
    over_shifts = np.fft.fftshift(scipy.fft.irfft2(phases, (side, side)))
    # So that no shift is in the middle.
    whole = over_shifts[1 - side % 2 :, 1 - side % 2 :]
    surface = normalise(np.asarray(cv2.GaussianBlur(whole, (0, 0), _BLUR_PX), np.float32))
    peak = find_peak(surface)
    is_clear = peak.height > max(_LEAST_HEIGHT, _CLEAR * _height_unmoved(surface))
    return math.hypot(*peak.shift_px) if is_clear else None


def _height_unmoved(surface: Surface) -> float:
    """Return the largest value where bands count as not displaced."""
    middle, reach = surface.shape[0] // 2, int(SAME_PX)
    near = slice(middle - reach, middle + reach + 1)
    return float(surface[near, near].max())
