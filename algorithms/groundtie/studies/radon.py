"""Radon: rotation and shift from projections of the windows.

A rotation is a shift of the Radon transform along its angle; the spectra of the projections do
not change with the image's shift, so the rotation is found on them. The shift is then that of the
projections onto the rows' and columns' directions (equations 3.10–3.12). The source's errors are
up to 2° and a few pixels; here the spectra are normalised at each frequency, peaks are found
between the bins, and all is found again on what both windows show. Source: [Patel2017], sections
3.3.2–3.3.4.
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

# Detail of the angles' correlation that is kept: standard deviation, in cycles per bin.
_ANGLE_BAND = 0.15

# How many rotations are tried, and which bins of the angle are the same peak.
CANDIDATES = 5
_SAME = np.ones(2 * round(SAME_DEG / ANGLE_STEP_DEG) + 1, bool)

# How far the rotation is corrected on what both windows show.
_CORRECTION = SearchLimits(0.0, 2.0)


def radon_transform(image: Image) -> Image:
    """Return the projections of an image at all angles, shape (angles, n).

    Parameters
    ----------
    image
        Shape (h, w); the sum of what lies within the disc of diameter n, the longer side.

    Returns
    -------
    Row k holds the sums along lines whose distances from the centre grow in the direction that
    lies k steps of `ANGLE_STEP_DEG` clockwise from straight up.
    """
    side = max(image.shape)
    size = (side, side)
    to_middle = np.array([(n - 1) / 2 for n in image.shape[::-1]])
    projections = np.empty((ANGLES, side), np.float32)
    for step in range(ANGLES):
        angle = np.pi * step / ANGLES
        along = np.array([np.sin(angle), -np.cos(angle)])
        across = np.array([np.cos(angle), np.sin(angle)])
        # Rows of the rotated image are the lines: it runs along them by columns.
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
        Within which rotations lie; the poses' scale is the one nearest to 1.
    count
        How many are wanted, not counting half turns.
    """
    # As with Fourier–Mellin, the reference further on along the angle is the input.
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
    """Return by how much a projection is shifted against another, and the peak's robust height.

    Parameters
    ----------
    reference, input
        Real or complex, shapes (m,) and (n,); their centres are compared.
    reach_px
        Largest shift.
    wrap
        Whether shifts are known to be small: projections of one length are then not padded.
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
    """Return the shift of an image by its projections at 0° and 90°.

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
        Within which rotation and shift are searched for; the scale is not: it is the one nearest
        to 1 within the limits.
    settings
        "ncc" compares grey values; all else finds the rotation on their logarithms, and the
        shift on orientation fields.
    context
        Threads to align the candidates in.
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
    """Return the shift that is left between the parts that two windows share."""
    first, second = (structure(window, settings) for window in (both.reference, both.input))
    return shift_by_projections(first, second, CORRECTION_PX, wrap=True)


def remaining_pose(both: Shared, settings: SimilaritySettings) -> PoseFound:
    """Return what rotation and shift are left between the parts that two windows share."""
    spectra = projection_spectra(both.reference, both.input, settings, disc=False)
    rotation = next(rotations(spectra, _CORRECTION, 1), Pose())
    shift = remaining_shift(both, settings)
    return replace(shift, pose=replace(rotation, shift_px=shift.pose.shift_px))
