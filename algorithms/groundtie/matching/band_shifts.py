"""Bands of one image that are displaced against each other.

Parallax between the detectors of a push-broom sensor, or careless stacking, displaces bands, but
bands are averaged before matching, and registered by one transform. Source: phase correlation
[Kuglin1975] of edge strength, which bands share whatever their contrast.
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

# Windows all over the image: largest side, and most along a side of the image.
_WINDOW_PX, _MOST_ALONG = 192, 3

# Smaller windows hold too few edges.
_LEAST_PX = 32

# The first is the least correlation of two bands' edges at their shift, in robust standard
# deviations. At a shift beyond tolerance it must also be so many times (the second) the magnitude
# of the unshifted correlation. Measured on the unchanged shared images (32, three missions' among
# them): up to 2.4 times and up to 7 for a cirrus band, which shows no ground; 1.0 times for the
# others. Heights beside their shading: 1.2 times and 16. Bands displaced by 6 px and more: from 4.2
# times and 28.
_LEAST_HEIGHT, _CLEAR = 14.0, 3.0

# Shifts up to this count as unshifted.
_UNMOVED_PX = 1


@dataclass(frozen=True)
class BandShift:
    """Displacement of a band against the first band that shows the same ground.

    Parameters
    ----------
    bands
        Numbers of the first band and of this one, from 1.
    apart_px
        Length of the displacement, in pixels.
    """

    bands: tuple[int, int]
    apart_px: float


@dataclass(frozen=True)
class _Band:
    """A band: its spectra, and its displacement against the band `first`."""

    spectra: Spectra
    first: int
    position_px: NDArray[np.float64]


def band_shifts(source: RasterSource) -> Sequence[BandShift]:
    """Return the displacements of an image's bands, except alpha, against earlier bands.

    Each is one shift for the whole image: correlations of windows all over it are added up. A band
    is compared with the last band that matched and the band before it; one that shares edges with
    neither is left out.
    """
    bands = source.image_bands
    side = min(_WINDOW_PX, *source.grid.size)
    if len(bands) < 2 or side < _LEAST_PX:
        return ()
    places = Places.spread(source.grid, side, lambda n: np.clip(-(-n // side), 1, _MOST_ALONG))
    windows = [Window(int(col), int(row), side, side) for col, row in places.corners]
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
    """Return the shift (x, y) between bands from spectra of windows of a side; None: unclear."""
    surface = normalise(phase_surface(phases(one, other).sum(axis=0), side))
    peak = find_peak(surface)
    least = _LEAST_HEIGHT
    if np.hypot(*peak.shift_px) > TOLERANCE_PX:
        least = max(least, _CLEAR * _height_unmoved(surface))
    return np.array(peak.shift_px) if peak.height > least else None


def _height_unmoved(surface: Surface) -> float:
    """Return the largest magnitude of the correlation of unshifted bands.

    The correlation is negative where edges lie beside one another, as with heights and shading.
    """
    middle = surface.shape[0] // 2
    near = slice(middle - _UNMOVED_PX, middle + _UNMOVED_PX + 1)
    return float(np.abs(surface[near, near]).max())
