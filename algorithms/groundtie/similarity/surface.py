"""The similarity surface of a template over shifts in its search window.

Surfaces are normalised to robust standard deviations of their own background, so that surfaces of
different measures can be added and peaks of different places compared.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..context import Context
from ..memo import Memo
from ..rasters.patch import Patch
from ..rasters.reading import Mask
from .correlation import MINIMUM_OVERLAP, overlap_share
from .description import BYTES_A_PIXEL, Description
from .measures import MEASURES
from .order_statistics import DEVIATION_PER_MAD, upper_median
from .stacks import each, flat

Surface = NDArray[np.float32]

# Measures that are summed up under this name, and their weights, chosen on 14 real SAR pairs;
# docs/measurements.md has the figures of these and of other choices.
_FUSED = "fused"
_WEIGHTS = {"nmi": 0.75, "orientation": 1.0, "edge-strength": 0.75}

SIMILARITIES = (_FUSED, *MEASURES)

# Width of the Gaussian mean that is a surface's slow trend, which is no evidence of a peak.
TREND_PX = 5.0

# A surface that varies by less than this holds nothing but rounding.
_FLAT = 1e-9


@dataclass(frozen=True)
class SimilaritySettings:
    """Settings of the similarity measurement.

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
        """Return the number of bins for a template with this number of pixels."""
        # Measured on real SAR–optical pairs: 8 to 10 bins for 61 px chips, up to 32 for scenes.
        return self.bins or int(np.clip(np.sqrt(pixels) / 7.5, 8, 32))


def normalise(surface: Surface, known: Mask | None = None) -> Surface:
    """Return surfaces, (…, ny, nx), in robust standard deviations from their medians (by MAD).

    Parameters
    ----------
    surface
        The surfaces.
    known
        Shifts that have a value, same shape; others get 0, the background's. None: all shifts.
    """
    if known is None or known.all():
        return _normalised(surface)
    return each(_normalised_where, surface, known)


def detrend(surface: Surface, known: Mask | None = None) -> Surface:
    """Return surfaces, (…, ny, nx), without their slow trend, normalised; see `normalise`."""
    trend = each(_smooth, surface) if known is None else each(_mean_of_known, surface, known)
    return normalise(surface - trend, known)


def _normalised(surface: Surface) -> Surface:
    centred = surface - upper_median(flat(surface))[..., None, None]
    spread = np.float32(DEVIATION_PER_MAD) * upper_median(flat(np.abs(centred)))[..., None, None]
    return (centred / np.where(spread > _FLAT, spread, np.inf)).astype(np.float32)


def _normalised_where(surface: Surface, known: Mask) -> Surface:
    found = np.zeros(surface.shape, np.float32)
    if known.any():
        # The known values are normalised as an image of one row.
        found[known] = _normalised(surface[known][None])[0]
    return found


def _mean_of_known(surface: Surface, known: Mask) -> Surface:
    if known.all():
        return _smooth(surface)
    weight = known.astype(np.float32)
    return np.asarray(_smooth(surface * weight) / np.maximum(_smooth(weight), np.float32(_FLAT)))


def _smooth(surface: Surface) -> Surface:
    return np.asarray(cv2.GaussianBlur(surface, (0, 0), TREND_PX), np.float32)


def describe(
    window: Patch, chip_pixels: int, settings: SimilaritySettings, memo: Memo | None = None
) -> Description:
    """Return the description of a window for the similarity measures.

    Parameters
    ----------
    window
        The window, or a stack of them, with `description.BORDER_PX` on each side.
    chip_pixels
        Number of pixels of the template that will be matched.
    settings
        Settings of the measurement.
    memo
        Keeps descriptions; None: the description is not needed again.
    """
    bins = settings.bins_for(chip_pixels)
    if memo is None:
        return Description.of(window, bins)
    made = window.values, window.valid, np.array([bins])
    size_bytes = BYTES_A_PIXEL * window.values.size
    return memo.recall(lambda: Description.of(window, bins), size_bytes, *made)


def similarity_surface(
    template: Description,
    search: Description,
    radius: int,
    settings: SimilaritySettings,
    context: Context | None = None,
    searched_share: float | NDArray[np.floating] = 1.0,
) -> Surface:
    """Return similarity over shifts -radius … radius in robust standard deviations.

    Parameters
    ----------
    template
        Description of the chip, shape (h, w), or of a stack of them, (…, h, w).
    search
        Description of a window with the same centre, larger by `radius` on each side.
    radius
        Largest shift, in pixels.
    settings
        Settings of the measurement.
    context
        Threads for whole scenes; by default the calling thread alone.
    searched_share
        Share of the search window that a mask leaves, for all or for each of a stack, shape
        (…, 1, 1): a template can lie on no more valid pixels. Without a mask, 1.

    Returns
    -------
    Surface, shape (…, 2 radius + 1, 2 radius + 1), float32. A shift is the rows and columns by
    which the search window's content lies further down and right than the template's. Shifts with
    too little overlap get 0, the background's value.
    """
    shape = *template.patch.values.shape[:-2], 2 * radius + 1, 2 * radius + 1
    total, known = np.zeros(shape, np.float32), None
    if not (template.patch.all_valid and search.patch.all_valid):
        known = overlap_share(template.patch, search.patch) >= MINIMUM_OVERLAP * searched_share
    for name in settings.measures:
        values = MEASURES[name](template, search, context)
        weight = np.float32(_WEIGHTS.get(name, 1.0))
        total += _standardised(values.reshape(-1, *shape), known) * weight
    return normalise(total, known)


def _standardised(values: NDArray[np.floating], known: Mask | None) -> Surface:
    """Return the detrended sum of one or several surfaces of a measure, each normalised."""
    # A scale without valid pixels to compare has the value 0.
    parts = detrend(values, None if known is None else known & (values != 0))
    return parts[0] if len(parts) == 1 else normalise(parts.sum(axis=0), known)
