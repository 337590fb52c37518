"""Fourier–Mellin: rotation and scale from magnitude spectra, then the shift.

The magnitude of a spectrum does not change with a shift, rotates with the image, and shrinks as
the image grows; on axes of angle and log frequency, both are shifts. Unlike the source's 22
steps: spectra are normalised at each frequency, peaks are found between the bins, several are
tried, and rotation, scale and shift are found again on what both windows show. Source:
[Patel2017] 3.3.1, [Chen1994], [Reddy1996].
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

# A spectrum is given at so many log frequencies between two frequencies in cycles per pixel.
_FREQUENCIES = 256
_RANGE = (0.015, 0.4)
_LOG_STEP = float(np.log(_RANGE[1] / _RANGE[0]) / (_FREQUENCIES - 1))

# Detail of the correlation that is kept: standard deviation, in cycles per bin.
_BAND = 0.1

# Candidates of rotation and scale: how many are tried.
CANDIDATES = 20

# Candidates are tried on windows reduced to about this length, in pixels, …
_TRIAL_SIDE_PX = 128
# … until one is so high that the others need no trial. Wrong ones were below 33.
_SURE_HEIGHT = 60.0

# Peaks that are nearer than this, in bins of rotation and scale, are the same.
_SAME = np.ones(
    [2 * round(n) + 1 for n in (SAME_DEG / ANGLE_STEP_DEG, SAME_LOG_SCALE / _LOG_STEP)], bool
)

# How far rotation and scale are corrected on what both windows show.
_CORRECTION = SearchLimits(0.0, 2.0, (0.95, 1.05))


def spectrum(image: Image, side: int) -> Image:
    """Return the log power of an apodised image's spectrum on angles and log frequencies.

    Parameters
    ----------
    image
        Shape (h, w).
    side
        Sides of the square that it is padded to.

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

    Rows are rotations, columns logarithms of the scale; the middle is none.
    """
    fading = np.sqrt(np.hanning(_FREQUENCIES + 2)[1:-1]).astype(np.float32)
    shape = (ANGLES, scipy.fft.next_fast_len(2 * _FREQUENCIES))
    # The reference at a bin further on looks like the input: an input that is rotated
    # counter-clockwise has its spectrum at smaller angles, a larger one at lower frequencies.
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
    """Return what rotation, scale and shift are left between the parts that two windows share."""
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
    """Return the best shift at each of some rotations and scales, best first.

    Windows are reduced. No more poses are tried after one of `_SURE_HEIGHT`, but for its other
    half turn.
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
        Within which rotation, scale and shift are searched for.
    settings
        "ncc" compares grey values; all else has its spectra made of their logarithms, and its
        shift found on orientation fields.
    context
        Threads to align the candidates in.
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
