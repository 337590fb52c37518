"""Radon transform: rotation and shift from projections of the windows.

A rotation shifts the Radon transform along its angle axis. The magnitude spectra of the projections
do not depend on the image's shift, so the rotation is found on them. The shift is then found on the
projections onto the row and column directions (equations 3.10–3.12). The source reports errors of
up to 2° and a few pixels. This implementation normalises the spectra at each frequency, finds peaks
between the bins, and repeats the search on the part that both windows show. Source: [Patel2017],
sections 3.3.2–3.3.4.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import cv2
import numpy as np
import scipy.fft
from numpy.typing import NDArray

from ..context import Context
from ..geometry.limits import SearchLimits
from ..pose.pose import Pose, PoseFound
from ..rasters.patch import Patch, reduced
from ..similarity.peaks import highest_peaks
from ..similarity.surface import SimilaritySettings, normalise
from .phase_correlation import BAND, CORRECTION_PX
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
    WORTH_ALIGNING,
    Field,
    Image,
    Shared,
    aligned,
    apodise,
    covering_shape,
    distinct,
    resampled,
    structure,
    texture,
    within,
)

# The rotation is found on images reduced to about this length, in pixels.
_SIDE_PX = 192

# Frequencies of the projections that are compared, in cycles per pixel.
_RANGE = (0.02, 0.4)

# Low-pass filter of the correlation over angles: standard deviation, in cycles per bin.
_ANGLE_BAND = 0.15

# Number of rotations that are tried, and the angle bins that count as one peak.
CANDIDATES = 5
_SAME = np.ones(2 * round(SAME_DEG / ANGLE_STEP_DEG) + 1, bool)

# Limits for correcting the rotation on the part that both windows show.
_CORRECTION = SearchLimits(0.0, 2.0)


def radon_transform(image: Image) -> Image:
    """Return the projections of an image at all angles, shape (angles, n).

    Parameters
    ----------
    image
        Shape (h, w). Projections cover a square of side n, the longer side, that rotates with the
        angle about the centre.

    Returns
    -------
    Row k holds sums along parallel lines. Their distance from the centre grows in the direction
    that is k steps of `ANGLE_STEP_DEG` clockwise from straight up.
    """
    side = max(image.shape)
    size = (side, side)
    to_middle = np.array([(n - 1) / 2 for n in image.shape[::-1]])
    projections = np.empty((ANGLES, side), np.float32)
    for step in range(ANGLES):
        angle = np.pi * step / ANGLES
        along = np.array([np.sin(angle), -np.cos(angle)])
        across = np.array([np.cos(angle), np.sin(angle)])
        # Each row of the rotated image is one projection line.
        matrix = np.column_stack([across, along, np.zeros(2)])
        matrix[:, 2] = to_middle - matrix[:, :2] @ np.full(2, (side - 1) / 2)
        flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
        projections[step] = cv2.warpAffine(image, matrix, size, flags=flags).sum(axis=1)
    return projections


def projection_spectra(
    reference: Patch, input: Patch, settings: SimilaritySettings, disc: bool
) -> list[Image]:
    """Return the log power of two windows' projections, shape (angles, frequencies)."""
    factor = max(round(max(reference.values.shape) / _SIDE_PX), 1)
    images = [
        reduced(apodise(texture(window, settings), window.valid, disc), factor)
        for window in (reference, input)
    ]
    count = scipy.fft.next_fast_len(max(max(image.shape) for image in images), real=True)
    first, last = (round(count * frequency) for frequency in _RANGE)
    found = []
    for image in images:
        spectrum = scipy.fft.rfft(radon_transform(image), count, axis=1)
        found.append(evened(log_power(spectrum[:, first:last])))
    return found


def rotations(spectra: list[Image], limits: SearchLimits, count: int) -> Iterator[Pose]:
    """Yield the most likely rotations within limits, best first, with half turns.

    Parameters
    ----------
    spectra
        The log power of the reference's and the input's projections.
    limits
        Limits of the rotation; the poses' scale is the one within limits that is nearest to 1.
    count
        Number of rotations, not counting half turns.
    """
    # As in Fourier–Mellin, the reference's spectrum at a larger angle matches the input's.
    first, second = (scipy.fft.fft(spectrum, axis=0) for spectrum in spectra)
    values = correlation((first * second.conj()).sum(axis=1), _ANGLE_BAND, WHITENING)
    rotation = (np.arange(ANGLES) - ANGLES // 2) * ANGLE_STEP_DEG
    allowed = np.abs(rotation) <= limits.rotation_deg + ANGLE_STEP_DEG / 2
    searched = np.where(allowed, values, 0)
    for (best,) in highest_peaks(searched, count, _SAME, circular=(0,)):
        if searched[best] <= 0:
            return
        degrees = rotation[best] + ANGLE_STEP_DEG * gaussian_peak(values, best)
        yield from half_turns(float(degrees), 1.0, limits)


def shift_along(
    reference: NDArray, input: NDArray, reach_px: float, wrap: bool = False
) -> tuple[float, float]:
    """Return the shift of one projection relative to another, and the peak's robust height.

    Parameters
    ----------
    reference, input
        Real or complex, shapes (m,) and (n,); the shift is that between their centres.
    reach_px
        Largest shift.
    wrap
        Whether shifts are known to be small; projections of equal length are then not padded.
    """
    sizes = len(reference), len(input)
    count = scipy.fft.next_fast_len(max(sizes) if wrap else sum(sizes))
    cross = scipy.fft.fft(reference, count).conj() * scipy.fft.fft(input, count)
    values = normalise(correlation(cross, BAND)[None])[0]
    shifts = np.arange(count) - count // 2 - (sizes[1] - sizes[0]) / 2
    best = int(np.where(np.abs(shifts) <= reach_px + 0.5, values, -np.inf).argmax())
    return float(shifts[best] + gaussian_peak(values, best)), float(values[best])


def shift_by_projections(
    reference: Image | Field, input: Image | Field, reach_px: float, wrap: bool = False
) -> PoseFound:
    """Return the shift of an image, estimated from its projections at 0° and 90°.

    Source: [Patel2017], equations 3.11 and 3.12.
    """
    right, height = shift_along(reference.sum(axis=0), input.sum(axis=0), reach_px, wrap)
    down, other = shift_along(reference.sum(axis=1), input.sum(axis=1), reach_px, wrap)
    return PoseFound(Pose(shift_px=(right, down)), min(height, other))


def radon(
    reference: Patch,
    input: Patch,
    limits: SearchLimits,
    settings: SimilaritySettings,
    context: Context,
) -> list[PoseFound]:
    """Search for rotation and shift by projections; a `PoseSearch`.

    Parameters
    ----------
    reference, input
        The windows.
    limits
        Limits of rotation and shift. The scale is not searched: it is the one nearest to 1 within
        the limits.
    settings
        "ncc" compares grey values; any other similarity finds the rotation on their logarithms
        and the shift on orientation fields.
    context
        Provides threads to align the candidates.
    """
    scale = float(np.clip(1.0, *limits.scale))
    if scale != 1:
        pose = Pose(scale=scale)
        shape = covering_shape(input.values.shape, pose, reference.values.shape)
        input = resampled(input, pose, shape, "cubic")
    if reference.is_flat or input.is_flat:
        return []
    own = SearchLimits(limits.radius / scale, limits.rotation_deg)
    spectra = projection_spectra(reference, input, settings, disc=True)
    tried = [
        _shifted(structure(reference, settings), input, pose, own, settings)
        for pose in rotations(spectra, own, CANDIDATES)
    ]

    def align(one: PoseFound) -> PoseFound:
        steps = remaining_pose, remaining_pose, remaining_shift
        one = aligned(reference, input, one, own, settings, *steps)
        right, down = (scale * shift for shift in one.pose.shift_px)
        return replace(one, pose=Pose(one.pose.rotation_deg, scale, (right, down)))

    return distinct(context.quiet().map(align, distinct(tried, WORTH_ALIGNING)[:RETURNED]))


def _shifted(
    reference: Image | Field,
    input: Patch,
    pose: Pose,
    limits: SearchLimits,
    settings: SimilaritySettings,
) -> PoseFound:
    """Return the best shift of an input at a rotation; `reference` is a `structure`."""
    shape = covering_shape(input.values.shape, pose, reference.shape)
    back = structure(resampled(input, pose, shape, "bilinear"), settings)
    found = shift_by_projections(reference, back, float(np.sqrt(2)) * limits.radius)
    right, down = pose.linear @ found.pose.shift_px
    moved = replace(pose, shift_px=(float(right), float(down)))
    return replace(found, pose=within(moved, limits))


def remaining_shift(both: Shared, settings: SimilaritySettings) -> PoseFound:
    """Return the residual shift between the parts that two windows share."""
    first, second = (structure(window, settings) for window in (both.reference, both.input))
    return shift_by_projections(first, second, CORRECTION_PX, wrap=True)


def remaining_pose(both: Shared, settings: SimilaritySettings) -> PoseFound:
    """Return the residual rotation and shift between the parts that two windows share."""
    spectra = projection_spectra(both.reference, both.input, settings, disc=False)
    rotation = next(rotations(spectra, _CORRECTION, 1), Pose())
    shift = remaining_shift(both, settings)
    return replace(shift, pose=replace(rotation, shift_px=shift.pose.shift_px))
