"""Bands of one image that show the ground at other pixels than others do.

Parallax between the detectors of a push-broom sensor, or careless stacking, displaces bands. They
are averaged before they are matched, and registered by one transform. Source: phase correlation
[Kuglin1975], of the strength of edges, which bands share whatever their contrast.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..geometry.judging import TOLERANCE_PX
from ..rasters.patch import Patch
from ..rasters.reading import RasterSource
from ..rasters.windows import Window
from ..similarity.orientation import SCALES_PX, compress, edge_strength, squared_gradients
from ..similarity.peak import find_peak
from ..similarity.phases import Spectra, phase_surface, phases, spectra
from ..similarity.surface import Surface, normalise
from .matcher import Places

# Windows all over the image: at most so large, and so many along a side.
_WINDOW_PX, _MOST_ALONG = 192, 3

# Smaller windows hold too few edges.
_LEAST_PX = 32

# Edges of two bands have one shift if they correlate by so many robust standard deviations there;
# one that moves them, if so many times more than they correlate, or do the opposite, unmoved.
# Measured on the shared images as they are (32, three missions' among them): up to 2.4 times and
# by up to 7, of a cirrus band, which shows no ground; of the others 1.0 times. Of heights beside
# their shading: 1.2 times and by 16. Of bands displaced by 6 px and more: from 4.2 times and by 28.
_LEAST_HEIGHT, _CLEAR = 14.0, 3.0

# So far, unmoved edges correlate.
_UNMOVED_PX = 1


@dataclass(frozen=True)
class BandShift:
    """Where a band shows the ground, against the first of those that show the same.

    Parameters
    ----------
    bands
        Numbers of both, from 1.
    apart_px
        How far elsewhere, in pixels.
    """

    bands: tuple[int, int]
    apart_px: float


@dataclass(frozen=True)
class _Band:
    """A band: its spectra, and where it shows the ground against the band `first`."""

    spectra: Spectra
    first: int
    position_px: NDArray[np.float64]


def band_shifts(source: RasterSource) -> Sequence[BandShift]:
    """Return where the bands of an image, but alpha, show the ground that a band before shows.

    By whole images: windows all over it are compared, and their correlations added up. A band
    that has no edges in common with the last one that had, or with the one before it, is left out.
    """
    bands = source.image_bands
    side = min(_WINDOW_PX, *source.grid.size)
    if len(bands) < 2 or side < _LEAST_PX:
        return ()
    places = Places.spread(source.grid, side, lambda n: np.clip(n // side, 1, _MOST_ALONG))
    corners = places.centres - side // 2
    windows = [Window(int(col), int(row), side, side) for col, row in corners]
    known = before = _Band(_spectra(source, windows, bands[0]), bands[0], np.zeros(2))
    found = []
    for number in bands[1:]:
        band = _Band(_spectra(source, windows, number), number, np.zeros(2))
        for other in (known,) if before is known else (known, before):
            shift = _shift_px(other.spectra, band.spectra, side)
            if shift is not None:
                band = replace(band, first=other.first, position_px=other.position_px + shift)
                known = band
                found.append(BandShift((band.first, number), float(np.hypot(*band.position_px))))
                break
        before = band
    return found


def _spectra(source: RasterSource, windows: Sequence[Window], band: int) -> Spectra:
    """Return the spectra of edges in square windows of a band, shape (windows, h, h / 2 + 1)."""
    found = []
    for window in windows:
        values, valid = source.read(window, band)
        (finest,) = squared_gradients(compress(Patch(values, valid)), valid, SCALES_PX[:1])
        edges = edge_strength(finest, valid)
        found.append(spectra(Patch(edges.values[None], edges.valid[None]))[0])
    return np.array(found)


def _shift_px(one: Spectra, other: Spectra, side: int) -> NDArray[np.float64] | None:
    """Return how far bands are apart, (x, y), by spectra of windows of a side; None: unclear."""
    surface = normalise(phase_surface(phases(one, other).sum(axis=0), side))
    peak = find_peak(surface)
    least = _LEAST_HEIGHT
    if np.hypot(*peak.shift_px) > TOLERANCE_PX:
        least = max(least, _CLEAR * _height_unmoved(surface))
    return np.array(peak.shift_px) if peak.height > least else None


def _height_unmoved(surface: Surface) -> float:
    """Return the largest magnitude where bands count as unmoved.

    It is negative where edges lie beside one another, as those of heights and of their shading.
    """
    middle = surface.shape[0] // 2
    near = slice(middle - _UNMOVED_PX, middle + _UNMOVED_PX + 1)
    return float(np.abs(surface[near, near]).max())
