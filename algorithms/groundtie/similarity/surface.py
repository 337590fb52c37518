"""The similarity surface of a template over shifts in its search window.

Surfaces are normalised to robust standard deviations of their own background, so that those of
different measures can be added and peaks of different places be compared.
"""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..rasters.patch import Patch
from .binning import to_bins
from .correlation import MINIMUM_OVERLAP, correlate_fields, correlate_grey, overlap_share
from .joint_histogram import JointHistogramVolume, count_joint_histograms
from .measures import normalized_mutual_information
from .orientation import orientation_fields

Surface = NDArray[np.float32]
SIMILARITIES = ("fused", "nmi", "orientation", "ncc")

# Pixels that windows have beyond the chip on each side: what the widest gradient filter and the
# widest histogram kernel reach.
BORDER_PX = 8

# A surface's slow trend, which says nothing of a peak, is its Gaussian mean of this width.
TREND_PX = 5.0


@dataclass(frozen=True)
class SimilaritySettings:
    """How similarity is measured.

    Parameters
    ----------
    similarity
        One of `SIMILARITIES`; "fused" adds up orientation and NMI.
    bins
        Number of bins; None: chosen by the window's size.
    binning
        "equal-frequency" or "linear".
    gpve_order
        Order of the B-spline of the histogram, 2 (PVI) to 7.
    """

    similarity: str = "fused"
    bins: int | None = None
    binning: str = "equal-frequency"
    gpve_order: int = 4

    def bins_for(self, pixels: int) -> int:
        """Return the number of bins for a template of so many pixels."""
        # Measured on real SAR–optical pairs: about 10 bins for 61 px chips, up to 32 for scenes.
        return self.bins or int(np.clip(np.sqrt(pixels) / 6, 8, 32))


def normalise(surface: Surface) -> Surface:
    """Return a surface in robust standard deviations from its median (median and MAD)."""
    median = np.median(surface)
    spread = 1.4826 * np.median(np.abs(surface - median))
    if spread <= 1e-9:
        return np.zeros_like(surface)
    return ((surface - median) / spread).astype(np.float32)


def detrend(surface: Surface, width_px: float = TREND_PX) -> Surface:
    """Return a surface without its slow trend, normalised."""
    return normalise(surface - cv2.GaussianBlur(surface, (0, 0), width_px))


def joint_histograms(
    template: Patch,
    search: Patch,
    radius: int,
    settings: SimilaritySettings,
    executor: Executor | None = None,
) -> JointHistogramVolume:
    """Return the joint-histogram volume of two windows that have `BORDER_PX` around the chip."""
    margin = settings.gpve_order // 2 + 1
    chip = template.inner(BORDER_PX)
    around = search.inner(BORDER_PX - margin)
    bins = settings.bins_for(chip.values.size)
    return count_joint_histograms(
        to_bins(chip.values, chip.valid, bins, settings.binning),
        to_bins(around.values, around.valid, bins, settings.binning),
        (bins, bins),
        radius,
        executor,
    )


def nmi_surface(
    template: Patch,
    search: Patch,
    radius: int,
    settings: SimilaritySettings,
    executor: Executor | None = None,
) -> Surface:
    """Return normalised mutual information over shifts, shape (2 radius + 1, 2 radius + 1)."""
    volume = joint_histograms(template, search, radius, settings, executor)
    histograms = volume.histograms(settings.gpve_order)
    return normalized_mutual_information(histograms).astype(np.float32)


def orientation_surface(template: Patch, search: Patch) -> Surface:
    """Return the sum of the normalised orientation correlations of all scales over shifts."""
    inner = slice(BORDER_PX, -BORDER_PX)
    valid = template.valid[inner, inner], search.valid[inner, inner]
    surfaces = [
        detrend(correlate_fields(t[inner, inner], s[inner, inner], *valid))
        for t, s in zip(orientation_fields(template), orientation_fields(search), strict=True)
    ]
    return normalise(np.sum(surfaces, axis=0))


def similarity_surface(
    template: Patch,
    search: Patch,
    radius: int,
    settings: SimilaritySettings,
    executor: Executor | None = None,
) -> Surface:
    """Return similarity over shifts -radius … radius in robust standard deviations.

    Parameters
    ----------
    template
        Chip with `BORDER_PX` around it, shape (h + 2 border, w + 2 border).
    search
        Patch with the same centre, larger by `radius` on each side.
    radius
        Largest shift, in pixels.
    settings
        How similarity is measured.
    executor
        Threads to count histograms in; by default the calling one alone.

    Returns
    -------
    Surface, shape (2 radius + 1, 2 radius + 1), float32: rows and columns by which the search
    window's content lies further down and right than the template's. Shifts with too little
    overlap get 0, the background's value.
    """
    parts = []
    if settings.similarity in ("fused", "nmi"):
        parts.append(detrend(nmi_surface(template, search, radius, settings, executor)))
    if settings.similarity in ("fused", "orientation"):
        parts.append(orientation_surface(template, search))
    if settings.similarity == "ncc":
        grey = correlate_grey(template.inner(BORDER_PX), search.inner(BORDER_PX))
        parts.append(detrend(grey))
    surface = normalise(np.sum(parts, axis=0))
    overlap = overlap_share(template.inner(BORDER_PX), search.inner(BORDER_PX))
    return np.where(overlap >= MINIMUM_OVERLAP, surface, 0).astype(np.float32)
