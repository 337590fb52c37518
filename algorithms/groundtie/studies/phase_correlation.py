"""Phase correlation: the shift between two windows from the phases of their spectra.

Dividing the cross-power spectrum by its magnitude turns the broad maximum of a plain correlation
into a sharp peak. Source: [Kuglin1975]; [Patel2017], section 3.3.1, steps 16–21.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from ..context import Context
from ..geometry.limits import SearchLimits
from ..pose.pose import Pose, PoseFound
from ..rasters.patch import Patch
from ..similarity.peaks import highest_peaks
from ..similarity.surface import SimilaritySettings, Surface, normalise
from .spectra import correlation, gaussian_peak
from .spectral_windows import (
    SAME_PX,
    Field,
    Image,
    Shared,
    aligned,
    covering_shape,
    distinct,
    resampled,
    structure,
)

# Largest number of shifts that are returned.
CANDIDATES = 4

# Peaks of one surface within this neighbourhood count as one.
_SAME = np.ones((2 * int(SAME_PX) + 1,) * 2, bool)

# Low-pass filter (standard deviation, in cycles per pixel): higher frequencies hold noise and
# resampling artefacts. With it, the peak is a Gaussian of 0.8 px.
BAND = 0.2

# Largest correction of a shift once the windows have been cropped to the part they share.
CORRECTION_PX = 8.0


@dataclass(frozen=True)
class PhaseSurface:
    """Phase correlation over all shifts, in robust standard deviations of its background.

    Parameters
    ----------
    values
        Shape (h, w), float32.
    right_px, down_px
        Shift of the input's centre to the right of and below the reference's centre, for each
        column and each row of `values`.
    """

    values: Surface
    right_px: NDArray[np.float64]
    down_px: NDArray[np.float64]

    def peaks(
        self, linear: NDArray[np.float64], radius_px: float, count: int
    ) -> list[tuple[tuple[float, float], float]]:
        """Return shifts (right, down) in pixels and heights of the highest peaks, best first.

        Parameters
        ----------
        linear
            Matrix that rotates and scales shifts of the surface into input shifts, shape (2, 2).
        radius_px
            Largest shift along rows and columns, in input pixels.
        count
            Number of peaks.
        """
        searched = np.where(self.within(linear, radius_px), self.values, 0)
        found = []
        for row, col in highest_peaks(searched, count, _SAME):
            if searched[row, col] > 0:
                right = self.right_px[col] + gaussian_peak(self.values[row], col)
                down = self.down_px[row] + gaussian_peak(self.values[:, col], row)
                found.append(((float(right), float(down)), float(searched[row, col])))
        return found

    def within(self, linear: NDArray[np.float64], radius_px: float) -> NDArray[np.bool_]:
        """Return a mask of the surface's shifts that shift the input by no more than a radius.

        Parameters
        ----------
        linear, radius_px
            As in `peaks`.
        """
        right, down = self.right_px[None, :], self.down_px[:, None]
        return np.logical_and.reduce(
            [np.abs(a * right + b * down) <= radius_px + 0.5 for a, b in linear]
        )


def phase_surface(
    reference: Image | Field, input: Image | Field, wrap: bool = False
) -> PhaseSurface:
    """Return the phase correlation of two apodised images.

    Parameters
    ----------
    reference, input
        Real or complex, shapes (h, w) and (m, n); shifts are those between their centres.
    wrap
        Whether shifts are known to be small; images of equal shape are then not padded.
    """
    pairs = list(zip(reference.shape, input.shape, strict=True))
    sides = [max(pair) if wrap else sum(pair) for pair in pairs]
    shape = [scipy.fft.next_fast_len(side) for side in sides]
    cross = scipy.fft.fft2(reference, shape).conj() * scipy.fft.fft2(input, shape)
    values = correlation(cross, BAND)
    shifts = [np.arange(n) - n // 2 - (b - a) / 2 for n, (a, b) in zip(shape, pairs, strict=True)]
    return PhaseSurface(normalise(values.astype(np.float32)), shifts[1], shifts[0])


def shifts_at(
    reference: Image | Field,
    input: Patch,
    pose: Pose,
    radius_px: float,
    settings: SimilaritySettings,
    count: int,
) -> list[PoseFound]:
    """Return the best shifts for the rotation and scale of a pose, best first.

    Parameters
    ----------
    reference
        The reference's `structure`, shape (h, w).
    input
        The window.
    pose
        Rotation and scale; its shift must be 0.
    radius_px
        Largest shift along rows and columns, in input pixels.
    settings
        How similarity is measured.
    count
        Number of shifts.
    """
    shape = covering_shape(input.values.shape, pose, reference.shape)
    back = input if pose == Pose() else resampled(input, pose, shape, "bilinear")
    if back.is_flat:
        return []
    surface = phase_surface(reference, structure(back, settings))
    found = []
    for shift, height in surface.peaks(pose.linear, radius_px, count):
        right, down = pose.linear @ shift
        moved = Pose(pose.rotation_deg, pose.scale, (float(right), float(down)))
        found.append(PoseFound(moved, height))
    return found


def remaining_shift(both: Shared, settings: SimilaritySettings) -> PoseFound | None:
    """Return the residual shift between the parts that two windows share."""
    first, second = (structure(window, settings) for window in (both.reference, both.input))
    surface = phase_surface(first, second, wrap=True)
    peaks = surface.peaks(np.eye(2), CORRECTION_PX, 1)
    return PoseFound(Pose(shift_px=peaks[0][0]), peaks[0][1]) if peaks else None


def phase_correlation(
    reference: Patch,
    input: Patch,
    limits: SearchLimits,
    settings: SimilaritySettings,
    context: Context,
) -> list[PoseFound]:
    """Search for the shift of an input that is not rotated; a `PoseSearch`.

    Parameters
    ----------
    reference, input
        The windows.
    limits
        Only the shift is searched; the scale is the one nearest to 1 within the limits.
    settings
        "ncc" compares grey values, any other similarity orientation fields.
    context
        Provides threads to align the candidates.
    """
    if reference.is_flat or input.is_flat:
        return []
    pose = Pose(scale=float(np.clip(1.0, *limits.scale)))
    fixed = structure(reference, settings)
    found = shifts_at(fixed, input, pose, limits.radius, settings, CANDIDATES)

    def align(one: PoseFound) -> PoseFound:
        return aligned(reference, input, one, limits, settings, remaining_shift)

    return distinct(context.quiet().map(align, found))
