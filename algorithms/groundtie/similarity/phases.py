"""Phase correlation of windows all over two images, added up: one shift that all of them have.

Source: [Kuglin1975].
"""

from __future__ import annotations

import cv2
import numpy as np
import scipy.fft
from numpy.typing import NDArray

from ..rasters.patch import Patch
from .surface import Surface, normalise

# Phases are the same to so many pixels, by interpolation: without these frequencies, a shift by
# half a pixel has one peak, too.
_BLUR_PX = 0.7

Spectra = NDArray[np.complex64]


def spectra(windows: Patch) -> Spectra:
    """Return the spectra of a stack of square windows, (n, s, s), shape (n, s, s // 2 + 1)."""
    valid = windows.valid
    known = np.maximum(valid.sum(axis=(1, 2), keepdims=True), 1)
    values = np.where(valid, windows.values, 0)
    centred = np.where(valid, values - values.sum(axis=(1, 2), keepdims=True) / known, 0)
    taper = np.outer(*[np.hanning(valid.shape[-1])] * 2)
    return np.asarray(scipy.fft.rfft2((centred * taper).astype(np.float32)))


def phases(one: Spectra, other: Spectra) -> Spectra:
    """Return the phases by which spectra of windows differ, of one shape, 0 where one has none."""
    cross = one.conj() * other
    size = np.abs(cross)
    return np.divide(cross, size, out=np.zeros_like(cross), where=size > 0)


def phase_surface(total: Spectra, side: int) -> Surface:
    """Return how far the other images' content is moved against the ones', by `phases` added up.

    Parameters
    ----------
    total
        Their sum, shape (side, side // 2 + 1).
    side
        Of the windows.

    Returns
    -------
    Correlation in robust standard deviations by shift, of which none is in the middle, shape
    (2 r + 1, 2 r + 1).
    """
    over_shifts = np.fft.fftshift(scipy.fft.irfft2(total, (side, side)))
    whole = over_shifts[1 - side % 2 :, 1 - side % 2 :]
    return normalise(np.asarray(cv2.GaussianBlur(whole, (0, 0), _BLUR_PX), np.float32))
