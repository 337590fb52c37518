"""Phase correlation: the shift between windows by the phases of their spectra, at any contrast.

Source: [Kuglin1975].
"""

from __future__ import annotations

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from ..rasters.patch import Patch
from .surface import Surface

# Because of interpolation, phases agree only down to detail of this size. Without the higher
# frequencies, a shift by half a pixel has a single peak, too.
_BLUR_PX = 0.7

Spectra = NDArray[np.complex64]


def spectra(windows: Patch) -> Spectra:
    """Return the spectra, (n, s, s // 2 + 1), of tapered square windows, (n, s, s)."""
    valid = windows.valid
    values = np.where(valid, windows.values, 0)
    known = np.maximum(valid.sum(axis=(1, 2), keepdims=True), 1)
    mean = (values.sum(axis=(1, 2), keepdims=True) / known).astype(np.float32)
    taper = np.hanning(valid.shape[-1]).astype(np.float32)
    return np.asarray(scipy.fft.rfft2(np.where(valid, values - mean, 0) * np.outer(taper, taper)))


def phases(one: Spectra, other: Spectra) -> Spectra:
    """Return the phase differences of spectra of one shape; 0 where either spectrum is 0."""
    cross = one.conj() * other
    size = np.abs(cross)
    return np.divide(cross, size, out=np.zeros_like(cross), where=size > 0)


def phase_surface(phases: Spectra, side: int, radius_px: int | None = None) -> Surface:
    """Return the correlation of windows by shift of the other ones' content, from their phases.

    Parameters
    ----------
    phases
        Phase differences of windows, or sums of them, shape (…, s, s // 2 + 1).
    side
        The windows' side s.
    radius_px
        Largest shift r in pixels; None: as large as fits into a window.

    Returns
    -------
    Correlation by shift, with shift 0 in the middle, shape (…, 2 r + 1, 2 r + 1).
    """
    radius = (side - 1) // 2 if radius_px is None else radius_px
    rows, columns = np.fft.fftfreq(side), np.fft.rfftfreq(side)
    squared = np.square(rows)[:, None] + np.square(columns)
    blur = np.exp(-2 * np.square(np.pi * _BLUR_PX) * squared).astype(np.float32)
    over_shifts = scipy.fft.irfft2(phases * blur, (side, side))
    shifts = np.arange(-radius, radius + 1)
    return np.asarray(over_shifts[..., shifts[:, None], shifts])
