"""Coherence of two superimposed arrays in coarse and in fine structure.

Source: [Carter1973]. Ground varies more in coarse structure than in fine; speckle and a sensor's
noise do so as much in both. Two radar images of one ground are therefore no less coherent in coarse
structure than in fine. If they share a pattern of noise over other ground, they are.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..rasters.patch import Patch
from .phases import spectra

# Wavelengths in pixels: coarse ones are longer than the first, fine ones lie between the others.
# Interpolation leaves little of shorter ones.
_COARSE_PX, _FINE_PX = 20.0, (4.0, 10.0)

# Windows of which less is valid show the outline of what is not, in both patches.
_LEAST_VALID = 0.98


def spectral_products(reference: Patch, input: Patch) -> NDArray[np.float64]:
    """Return the power of both patches and their real cross power, of windows of equal energy.

    Returns
    -------
    Coarse structure first, then fine; shape (2, 3). 0 if a patch is constant, or has a mask.
    """
    side = min(reference.values.shape)
    both = (reference.valid & input.valid)[:side, :side]
    if both.mean() < _LEAST_VALID:
        return np.zeros((2, 3))
    windows = [
        spectra(Patch(patch.values[:side, :side][None], both[None]))[0]
        for patch in (reference, input)
    ]
    energies = [float(np.square(np.abs(one)).sum()) for one in windows]
    if not min(energies) > 0:
        return np.zeros((2, 3))
    one, other = (
        window / np.sqrt(energy) for window, energy in zip(windows, energies, strict=True)
    )
    products = np.stack([np.abs(one) ** 2, np.abs(other) ** 2, (one * other.conj()).real])
    frequency = np.hypot(np.fft.fftfreq(side)[:, None], np.fft.rfftfreq(side))
    coarse = frequency < 1 / _COARSE_PX
    fine = (frequency >= 1 / _FINE_PX[1]) & (frequency < 1 / _FINE_PX[0])
    return np.array([products[:, band].sum(axis=1) for band in (coarse, fine)])


def coherence(products: Sequence[NDArray[np.float64]]) -> tuple[float, float]:
    """Return the coherence, -1 to 1, of coarse and of fine structure by `spectral_products`."""
    one, other, both = np.sum(products, axis=0).T
    power = np.sqrt(one * other)
    coarse, fine = np.divide(both, power, out=np.zeros(2), where=power > 0)
    return float(coarse), float(fine)
