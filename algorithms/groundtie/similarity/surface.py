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
from .joint_histogram import count_joint_histograms, reach
from .measures import MEASURES
from .orientation import edge_strength, orientation_fields

Surface = NDArray[np.float32]
SIMILARITIES = (
    "fused",
    "nmi",
    "orientation",
    "edge-strength",
    "ncc",
    *(m for m in MEASURES if m != "nmi"),
)

# Pixels that windows have beyond the chip on each side: what the widest gradient filter and the
# widest histogram kernel reach.
BORDER_PX = 8

# A surface's slow trend, which says nothing of a peak, is its Gaussian mean of this width.
TREND_PX = 5.0

# Weights of mutual information and edge strength in the fused similarity, that of orientation is
# 1: chosen on 14 real SAR pairs; docs/measurements.md has others.
_HISTOGRAM_WEIGHT = np.float32(0.75)
_STRENGTH_WEIGHT = np.float32(0.75)

# A surface that varies by less than this holds nothing but rounding.
_FLAT = 1e-9


@dataclass(frozen=True)
class SimilaritySettings:
    """How similarity is measured.

    Parameters
    ----------
    similarity
        One of `SIMILARITIES`: "fused" adds up orientation, NMI and edge strength, "orientation"
        correlates squared gradients, "edge-strength" their size, "ncc" grey values; the others
        are measures on joint histograms.
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

    @property
    def measure(self) -> str | None:
        """Name of the measure on joint histograms, None if there is no need of one."""
        if self.similarity == "fused":
            return "nmi"
        return self.similarity if self.similarity in MEASURES else None

    def counts(self, part: str) -> bool:
        """Tell whether "orientation" or "edge-strength" enters the similarity."""
        return self.similarity in ("fused", part)

    def bins_for(self, pixels: int) -> int:
        """Return the number of bins for a template of so many pixels."""
        # Measured on real SAR–optical pairs: 8 to 10 bins for 61 px chips, up to 32 for scenes.
        return self.bins or int(np.clip(np.sqrt(pixels) / 7.5, 8, 32))


def normalise(surface: Surface) -> Surface:
    """Return a surface in robust standard deviations from its median (median and MAD)."""
    centred = surface - _median(surface)
    spread = 1.4826 * _median(np.abs(centred))
    if spread <= _FLAT:
        return np.zeros_like(surface)
    return (centred / np.float32(spread)).astype(np.float32)


def _median(values: Surface) -> np.float32:
    # Surfaces have an odd number of values; numpy's own median takes ten times as long for them.
    middle = values.size // 2
    return np.float32(np.partition(values, middle, axis=None)[middle])


def detrend(surface: Surface, width_px: float = TREND_PX) -> Surface:
    """Return a surface without its slow trend, normalised."""
    return normalise(surface - cv2.GaussianBlur(surface, (0, 0), width_px))


@dataclass(frozen=True)
class Features:
    """What similarity is measured on, made once for an image window.

    Parameters
    ----------
    patch
        The window without `BORDER_PX` on each side.
    bins
        Bins, with `margin` pixels around the patch; None if not needed.
    bin_count
        Number of bins.
    margin
        Pixels that `bins` has on each side beyond the patch, for the histogram's kernel.
    fields
        Orientation fields at all scales, shape (scales, h, w); None if not needed.
    strength
        How strong edges are; None if not needed.
    """

    patch: Patch
    bins: NDArray[np.uint8] | None
    bin_count: int
    margin: int
    fields: NDArray[np.complex64] | None
    strength: Patch | None

    def inner(self, border: int) -> Features:
        """Return the features of the window without a border on each side."""
        inside = slice(border, -border or None)
        return Features(
            self.patch.inner(border),
            None if self.bins is None else self.bins[inside, inside],
            self.bin_count,
            self.margin,
            None if self.fields is None else self.fields[:, inside, inside],
            None if self.strength is None else self.strength.inner(border),
        )

    @property
    def own_bins(self) -> NDArray[np.uint8]:
        """The bins of the patch alone."""
        assert self.bins is not None
        inside = slice(self.margin, -self.margin or None)
        return self.bins[inside, inside]


def describe(window: Patch, chip_pixels: int, settings: SimilaritySettings) -> Features:
    """Make what similarity needs of an image window.

    Parameters
    ----------
    window
        The window, with `BORDER_PX` on each side.
    chip_pixels
        Number of pixels of the template that will be matched.
    settings
        How similarity is measured.
    """
    inner = slice(BORDER_PX, -BORDER_PX)
    bin_count = settings.bins_for(chip_pixels)
    margin = reach(settings.gpve_order)
    bins: NDArray[np.uint8] | None = None
    fields: NDArray[np.complex64] | None = None
    strength: Patch | None = None
    if settings.measure is not None:
        around = window.inner(BORDER_PX - margin)
        bins = to_bins(around.values, around.valid, bin_count, settings.binning)
    if settings.counts("orientation") or settings.counts("edge-strength"):
        fields = orientation_fields(window)
        if settings.counts("edge-strength"):
            strength = edge_strength(fields[0], window.valid).inner(BORDER_PX)
        fields = fields[:, inner, inner]
    return Features(window.inner(BORDER_PX), bins, bin_count, margin, fields, strength)


def histogram_surface(
    template: Features,
    search: Features,
    radius: int,
    settings: SimilaritySettings,
    executor: Executor | None = None,
) -> Surface:
    """Return the measure on joint histograms over shifts, shape (2 radius + 1, 2 radius + 1)."""
    assert search.bins is not None and settings.measure is not None
    counts = (template.bin_count, search.bin_count)
    volume = count_joint_histograms(template.own_bins, search.bins, counts, radius, executor)
    return MEASURES[settings.measure](volume.histograms(settings.gpve_order)).astype(np.float32)


def orientation_surface(template: Features, search: Features) -> Surface:
    """Return the sum of the normalised orientation correlations of all scales over shifts."""
    assert template.fields is not None and search.fields is not None
    valid = template.patch.valid, search.patch.valid
    surfaces = correlate_fields(template.fields, search.fields, *valid)
    return normalise(np.sum([detrend(surface) for surface in surfaces], axis=0))


def strength_surface(template: Features, search: Features) -> Surface:
    """Return the correlation of edge strength over shifts."""
    assert template.strength is not None and search.strength is not None
    return correlate_grey(template.strength, search.strength)


def similarity_surface(
    template: Features,
    search: Features,
    radius: int,
    settings: SimilaritySettings,
    executor: Executor | None = None,
    least_overlap: float = MINIMUM_OVERLAP,
) -> Surface:
    """Return similarity over shifts -radius … radius in robust standard deviations.

    Parameters
    ----------
    template
        Features of the chip, shape (h, w).
    search
        Features of a window with the same centre, larger by `radius` on each side.
    radius
        Largest shift, in pixels.
    settings
        How similarity is measured.
    executor
        Threads to count histograms in; by default the calling one alone.
    least_overlap
        Share of the template's valid pixels that must lie on valid ones.

    Returns
    -------
    Surface, shape (2 radius + 1, 2 radius + 1), float32: rows and columns by which the search
    window's content lies further down and right than the template's. Shifts with too little
    overlap get 0, the background's value.
    """
    parts = []
    if settings.measure is not None:
        measured = histogram_surface(template, search, radius, settings, executor)
        parts.append(detrend(measured) * _HISTOGRAM_WEIGHT)
    if settings.counts("orientation"):
        parts.append(orientation_surface(template, search))
    if settings.counts("edge-strength"):
        parts.append(detrend(strength_surface(template, search)) * _STRENGTH_WEIGHT)
    if settings.similarity == "ncc":
        parts.append(detrend(correlate_grey(template.patch, search.patch)))
    surface = normalise(np.sum(parts, axis=0))
    if template.patch.all_valid and search.patch.all_valid:
        return surface
    overlap = overlap_share(template.patch, search.patch)
    return np.where(overlap >= least_overlap, surface, 0).astype(np.float32)
