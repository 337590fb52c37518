"""Fourier–Mellin: rotation and scale from magnitude spectra, then the shift.

The magnitude spectrum is invariant to shifts, rotates with the image, and shrinks as the image
grows. On axes of angle and log frequency, rotation and scale are shifts. This implementation
differs from the source's 22 steps: spectra are normalised at each frequency, peaks are found
between the bins, several peaks are tried, and rotation, scale and shift are found again on the part
that both windows show. Source: [Patel2017] 3.3.1, [Chen1994], [Reddy1996].
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np
import scipy.fft

from ..context import Context
from ..geometry.limits import SearchLimits
from ..pose.pose import Pose, PoseFound
from ..rasters.kernels import interpolate
from ..rasters.patch import Patch, reduced_patch
from ..similarity.peaks import highest_peaks
from ..similarity.surface import SimilaritySettings, Surface, normalise
from .phase_correlation import remaining_shift, shifts_at
from .spectra import (
    ANGLE_STEP_DEG,
    ANGLES,
    WHITENING,
    correlation,
    evened,
    gaussian_peak,
    half_turns,
    log_power,
)
from .spectral_windows import (
    RETURNED,
    SAME_DEG,
    SAME_LOG_SCALE,
    WORTH_ALIGNING,
    Image,
    Shared,
    aligned,
    apodise,
    distinct,
    structure,
    texture,
)

# Number of log frequencies of a spectrum, and their range in cycles per pixel.
_FREQUENCIES = 256
_RANGE = (0.015, 0.4)
_LOG_STEP = float(np.log(_RANGE[1] / _RANGE[0]) / (_FREQUENCIES - 1))

# Low-pass filter of the correlation: standard deviation, in cycles per bin.
_BAND = 0.1

# Number of candidate rotations and scales that are tried.
CANDIDATES = 20

# Candidates are tried on windows reduced to about this side length, in pixels.
_TRIAL_SIDE_PX = 128
# A candidate of this height ends the trials. Wrong candidates stayed below 33.
_SURE_HEIGHT = 60.0

# Peaks within this neighbourhood, in bins of rotation and scale, count as one.
_SAME = np.ones(
    [2 * round(n) + 1 for n in (SAME_DEG / ANGLE_STEP_DEG, SAME_LOG_SCALE / _LOG_STEP)], bool
)

# Limits for correcting rotation and scale on the part that both windows show.
_CORRECTION = SearchLimits(0.0, 2.0, (0.95, 1.05))


def spectrum(image: Image, side: int) -> Image:
    """Return the log power of an apodised image's spectrum on angles and log frequencies.

    Parameters
    ----------
    image
        Shape (h, w).
    side
        Side of the square that the image is padded to.

    Returns
    -------
    Shape (angles, frequencies).
    """
    power = log_power(scipy.fft.fftshift(scipy.fft.rfft2(image, (side, side)), axes=0))
    angle = np.pi * np.arange(ANGLES)[:, None] / ANGLES
    frequency = side * np.geomspace(*_RANGE, _FREQUENCIES)
    px = np.stack([np.sin(angle) * frequency, side // 2 - np.cos(angle) * frequency])
    return evened(interpolate(power, px, "bilinear"))


def spectra(
    reference: Patch, input: Patch, settings: SimilaritySettings, disc: bool
) -> tuple[Image, Image]:
    """Return the spectra of two windows at the same frequencies."""
    windows = (reference, input)
    side = scipy.fft.next_fast_len(max(max(w.values.shape) for w in windows), real=True)
    first, second = (
        spectrum(apodise(texture(window, settings), window.valid, disc), side) for window in windows
    )
    return first, second


def correlate_spectra(reference: Image, input: Image) -> Surface:
    """Return the correlation of two spectra over all rotations and scales, normalised.

    Rows are rotations, columns logarithms of the scale; the centre is no rotation at scale 1.
    """
    fading = np.sqrt(np.hanning(_FREQUENCIES + 2)[1:-1]).astype(np.float32)
    shape = (ANGLES, scipy.fft.next_fast_len(2 * _FREQUENCIES))
    # The reference's spectrum matches the input's at a higher bin: a counter-clockwise rotation
    # moves the input's spectrum to smaller angles, an enlargement to lower frequencies.
    first, second = (scipy.fft.fft2(s * fading, shape) for s in (reference, input))
    return normalise(correlation(first * second.conj(), _BAND, WHITENING).astype(np.float32))


def rotations(surface: Surface, limits: SearchLimits, count: int) -> Iterator[Pose]:
    """Yield the most likely rotations and scales within limits, best first.

    Rotations come in pairs that are half a turn apart, if both are within the limits.
    """
    rows, cols = surface.shape
    rotation = (np.arange(rows) - rows // 2) * ANGLE_STEP_DEG
    log_scale = (np.arange(cols) - cols // 2) * _LOG_STEP
    low, high = np.log(limits.scale)
    allowed = (np.abs(rotation) <= limits.rotation_deg + ANGLE_STEP_DEG / 2)[:, None] & (
        (log_scale >= low - _LOG_STEP / 2) & (log_scale <= high + _LOG_STEP / 2)
    )
    searched = np.where(allowed, surface, 0)
    for row, col in highest_peaks(searched, count, _SAME, circular=(0,)):
        if searched[row, col] <= 0:
            return
        degrees = rotation[row] + ANGLE_STEP_DEG * gaussian_peak(surface[:, col], row)
        scale = np.exp(log_scale[col] + _LOG_STEP * gaussian_peak(surface[row], col))
        yield from half_turns(float(degrees), float(scale), limits)


def remaining_pose(both: Shared, settings: SimilaritySettings) -> PoseFound | None:
    """Return the residual rotation, scale and shift between the parts that two windows share."""
    surface = correlate_spectra(*spectra(both.reference, both.input, settings, disc=False))
    shift = remaining_shift(both, settings)
    if shift is None:
        return None
    rotation = next(rotations(surface, _CORRECTION, 1), Pose())
    return replace(shift, pose=replace(rotation, shift_px=shift.pose.shift_px))


def try_poses(
    reference: Patch,
    input: Patch,
    poses: Iterable[Pose],
    limits: SearchLimits,
    settings: SimilaritySettings,
) -> list[PoseFound]:
    """Return the best shift at each of the given rotations and scales, best first.

    The trials use reduced windows and stop at the first pose of at least `_SURE_HEIGHT`.
    """
    factor = max(round(min(reference.values.shape) / _TRIAL_SIDE_PX), 1)
    fixed = structure(reduced_patch(reference, factor), settings)
    small = reduced_patch(input, factor)
    found: list[PoseFound] = []
    for pose in poses:
        trials = shifts_at(fixed, small, pose, limits.radius / factor, settings, 1)
        for trial in trials:
            right, down = (factor * shift for shift in trial.pose.shift_px)
            found.append(replace(trial, pose=replace(pose, shift_px=(right, down))))
        if found and found[-1].height >= _SURE_HEIGHT:
            break
    return distinct(found, WORTH_ALIGNING)


def fourier_mellin(
    reference: Patch,
    input: Patch,
    limits: SearchLimits,
    settings: SimilaritySettings,
    context: Context,
) -> list[PoseFound]:
    """Search for rotation, scale and shift by Fourier–Mellin; a `PoseSearch`.

    Parameters
    ----------
    reference, input
        The windows.
    limits
        Limits of rotation, scale and shift.
    settings
        "ncc" compares grey values; any other similarity takes spectra of their logarithms and
        finds the shift on orientation fields.
    context
        Provides threads to align the candidates.
    """
    if reference.is_flat or input.is_flat:
        return []
    surface = correlate_spectra(*spectra(reference, input, settings, disc=True))
    tried = rotations(surface, limits, CANDIDATES)
    found = try_poses(reference, input, tried, limits, settings)[:RETURNED]

    def align(one: PoseFound) -> PoseFound:
        steps = remaining_pose, remaining_pose, remaining_shift
        return aligned(reference, input, one, limits, settings, *steps)

    return distinct(context.quiet().map(align, found))
