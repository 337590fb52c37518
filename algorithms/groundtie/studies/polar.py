"""What Fourier–Mellin and Radon share: spectra over angles, made alike, and half turns."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..geometry.limits import SearchLimits
from ..pose.pose import Pose
from .spectral_windows import Image, within

# A spectrum is given at these angles over half a turn, from straight up, clockwise; the other
# half is the same.
ANGLES = 360
ANGLE_STEP_DEG = 180 / ANGLES

# Share of the median power that is added before the logarithm.
_LOG_OFFSET = 1e-4

# Frequencies whose log power varies by less than this over the angles hold only rounding.
_FLAT = 1e-6


def log_power(spectrum: NDArray[np.complexfloating]) -> Image:
    """Return the logarithm of the power of a spectrum."""
    power = np.abs(spectrum) ** 2
    offset = _LOG_OFFSET * float(np.median(power)) + np.finfo(np.float32).tiny
    return np.log(power + offset).astype(np.float32)


def evened(spectrum: Image) -> Image:
    """Return a spectrum with mean 0 and variance 1 over the angles, shape (angles, frequencies).

    This takes away how power falls with frequency, which all images have in common, and lets
    all frequencies count alike.
    """
    centred = spectrum - spectrum.mean(axis=0)
    spread = centred.std(axis=0)
    return np.divide(centred, spread, out=np.zeros_like(centred), where=spread > _FLAT)


def half_turns(rotation_deg: float, scale: float, limits: SearchLimits) -> Iterator[Pose]:
    """Yield the poses within limits that a rotation, known up to half a turn, may stand for."""
    for other in (rotation_deg, rotation_deg - float(np.copysign(180, rotation_deg))):
        if abs(other) <= limits.rotation_deg + ANGLE_STEP_DEG:
            yield within(Pose(other, scale), limits)
