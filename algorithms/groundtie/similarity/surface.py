"""The similarity surface of a template over shifts in its search window.

Surfaces are normalised to robust standard deviations of their own background, so that those of
different measures can be added and peaks of different places be compared.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..context import Context
from ..rasters.patch import Patch
from .correlation import MINIMUM_OVERLAP, overlap_share
from .description import Description
from .measures import MEASURES
from .order_statistics import upper_median

Surface = NDArray[np.float32]

# The measures that are summed up under this name, and their weights, chosen on 14 real SAR pairs;
# docs/measurements.md has the figures of these and of others.
_FUSED = "fused"
_WEIGHTS = {"nmi": 0.75, "orientation": 1.0, "edge-strength": 0.75}

SIMILARITIES = (_FUSED, *MEASURES)

# A surface's slow trend, which is no evidence of a peak, is its Gaussian mean of this width.
TREND_PX = 5.0

# A surface that varies by less than this holds nothing but rounding.
_FLAT = 1e-9


@dataclass(frozen=True)
class SimilaritySettings:
    """How similarity is measured.

    Parameters
    ----------
    similarity
        One of `SIMILARITIES`: one of `measures.MEASURES`, or "fused", the weighted sum of NMI,
        orientation and edge strength.
    bins
        Number of equally frequent bins of joint histograms; None: chosen by the window's size.
    """

    similarity: str = _FUSED
    bins: int | None = None

    @property
    def measures(self) -> tuple[str, ...]:
        """Names of the measures that are summed up."""
        return tuple(_WEIGHTS) if self.similarity == _FUSED else (self.similarity,)

    def bins_for(self, pixels: int) -> int:
        """Return the number of bins for a template of so many pixels."""
        # Measured on real SAR–optical pairs: 8 to 10 bins for 61 px chips, up to 32 for scenes.
        return self.bins or int(np.clip(np.sqrt(pixels) / 7.5, 8, 32))


def normalise(surface: Surface) -> Surface:
    """Return a surface in robust standard deviations from its median (median and MAD)."""
    centred = surface - upper_median(surface)
    spread = 1.4826 * upper_median(np.abs(centred))
    if spread <= _FLAT:
        return np.zeros_like(surface)
    return (centred / np.float32(spread)).astype(np.float32)


def detrend(surface: Surface, width_px: float = TREND_PX) -> Surface:
    """Return a surface without its slow trend, normalised."""
    return normalise(surface - cv2.GaussianBlur(surface, (0, 0), width_px))


def describe(window: Patch, chip_pixels: int, settings: SimilaritySettings) -> Description:
    """Return what similarity is measured on.

    Parameters
    ----------
    window
        The window, with `description.BORDER_PX` on each side.
    chip_pixels
        Number of pixels of the template that will be matched.
    settings
        How similarity is measured.
    """
    return Description.of(window, settings.bins_for(chip_pixels))


def similarity_surface(
    template: Description,
    search: Description,
    radius: int,
    settings: SimilaritySettings,
    context: Context | None = None,
    least_overlap: float = MINIMUM_OVERLAP,
) -> Surface:
    """Return similarity over shifts -radius … radius in robust standard deviations.

    Parameters
    ----------
    template
        Description of the chip, shape (h, w).
    search
        Description of a window with the same centre, larger by `radius` on each side.
    radius
        Largest shift, in pixels.
    settings
        How similarity is measured.
    context
        Threads to count histograms in; by default the calling one alone.
    least_overlap
        Share of the template's valid pixels that must lie on valid ones.

    Returns
    -------
    Surface, shape (2 radius + 1, 2 radius + 1), float32: rows and columns by which the search
    window's content lies further down and right than the template's. Shifts with too little
    overlap get 0, the background's value.
    """
    parts = [
        _standardised(MEASURES[name](template, search, radius, context)) * _WEIGHTS.get(name, 1.0)
        for name in settings.measures
    ]
    surface = normalise(np.sum(parts, axis=0))
    if template.patch.all_valid and search.patch.all_valid:
        return surface
    overlap = overlap_share(template.patch, search.patch)
    return np.where(overlap >= least_overlap, surface, 0).astype(np.float32)


def _standardised(values: NDArray[np.floating]) -> Surface:
    """Return the detrended sum of one or several surfaces of a measure, each normalised."""
    parts = [detrend(surface) for surface in values.reshape(-1, *values.shape[-2:])]
    return parts[0] if len(parts) == 1 else normalise(np.sum(parts, axis=0))
