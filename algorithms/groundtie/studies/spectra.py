"""Spectral tools: correlation by spectra, subsample peaks, and spectra over angles."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from ..geometry.limits import SearchLimits
from ..pose.pose import Pose
from ..rasters.grid import FloatArray
from .spectral_windows import Field, Image, within

# Magnitudes below this share of their mean, and their phases, are dominated by rounding.
_ROUNDING = 0.05

# For rotation, cross-power spectra are divided by this power of their magnitude: 1 is phase
# correlation, which is precise; 0 is plain correlation, which tolerates larger differences.
WHITENING = 0.5

# Number and spacing of a spectrum's angles, clockwise from straight up over half a turn; the other
# half is identical.
ANGLES = 360
ANGLE_STEP_DEG = 180 / ANGLES

# Share of the median power that is added before taking the logarithm.
_LOG_OFFSET = 1e-4

# Frequencies whose log power varies by less than this over the angles hold only rounding errors.
_FLAT = 1e-6


def whitened(spectrum: Field, exponent: float = 1.0) -> Field:
    """Return a cross-power spectrum divided by a power of its magnitude; 0 stays 0."""
    size = np.abs(spectrum)
    divisor = (size + _ROUNDING * size.mean()) ** exponent
    return np.divide(spectrum, divisor, out=np.zeros_like(spectrum), where=divisor > 0)


def low_pass(count: int, band: float) -> FloatArray:
    """Return Gaussian weights for the frequencies of an FFT; `band` is in cycles per sample."""
    return np.asarray(np.exp(-(scipy.fft.fftfreq(count) ** 2) / (2 * band**2)))


def correlation(cross: Field, band: float, exponent: float = 1.0) -> NDArray[np.floating]:
    """Return the correlation over all shifts from a cross-power spectrum; its centre is shift 0.

    Parameters
    ----------
    cross
        Spectrum of one or two axes, frequency 0 first.
    band
        Standard deviation of the low-pass filter, in cycles per sample.
    exponent
        Power of the magnitude that the spectrum is divided by.
    """
    weights = low_pass(cross.shape[0], band)
    if cross.ndim == 2:
        weights = np.outer(weights, low_pass(cross.shape[1], band)).astype(np.float32)
    found = scipy.fft.ifftn(whitened(cross, exponent) * weights).real
    return np.asarray(scipy.fft.fftshift(found))


def gaussian_peak(values: NDArray[np.floating], index: int) -> float:
    """Return the offset of a sampled Gaussian's peak from its highest sample, -0.5 to 0.5.

    The samples are taken as periodic, as FFT-based surfaces are.
    """
    around = np.array([values[index - 1], values[index], values[(index + 1) % len(values)]])
    top = float(around[1])
    before, middle, after = np.log(np.maximum(around / top, 1e-3)) if top > 0 else (0.0, 0.0, 0.0)
    bend = before - 2 * middle + after
    if bend >= 0:
        return 0.0
    return float(np.clip(0.5 * (before - after) / bend, -0.5, 0.5))


def log_power(spectrum: NDArray[np.complexfloating]) -> Image:
    """Return the logarithm of the power of a spectrum."""
    power = np.abs(spectrum) ** 2
    offset = _LOG_OFFSET * float(np.median(power)) + np.finfo(np.float32).tiny
    return np.log(power + offset).astype(np.float32)


def evened(spectrum: Image) -> Image:
    """Return a spectrum with mean 0 and variance 1 over the angles, shape (angles, frequencies).

    This removes the decrease of power with frequency, which all images have in common, and gives
    all frequencies equal weight.
    """
    centred = spectrum - spectrum.mean(axis=0)
    spread = centred.std(axis=0)
    return np.divide(centred, spread, out=np.zeros_like(centred), where=spread > _FLAT)


def half_turns(rotation_deg: float, scale: float, limits: SearchLimits) -> Iterator[Pose]:
    """Yield the poses within limits for a rotation that is ambiguous by half a turn."""
    for other in (rotation_deg, rotation_deg - float(np.copysign(180, rotation_deg))):
        if abs(other) <= limits.rotation_deg + ANGLE_STEP_DEG:
            yield within(Pose(other, scale), limits)
