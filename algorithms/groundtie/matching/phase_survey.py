"""Phase correlation, all over a pair, of the part of the input that the reference does not explain.

A semi-transparent overlay in both images dominates them, so chips match where the overlay
coincides. The ground beneath is weak, but has one shift everywhere, on which phases agree.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..context import Context
from ..rasters.patch import Patch
from ..similarity.peak import peak_shifts
from ..similarity.phases import phase_surface, phases, spectra
from ..similarity.surface import Surface, normalise
from ..similarity.unexplained import unexplained
from .chip_windows import ChipWindows, Resampled
from .chips import LEAST_VALID_MASKED
from .matcher import Places
from .survey import SURVEY_RADIUS_PX, Survey

# Windows of 192 px, as for bands, overlap by two thirds and reach beyond the borders. Where the
# largest number along a side is reached, they overlap less.
_CHIP_PX, PHASES_REACH_PX, _MOST_ALONG = 64, 64, 7
_SIDE_PX = _CHIP_PX + 2 * PHASES_REACH_PX


def survey_unexplained(images: Resampled, elsewhere_px: float, context: Context) -> Survey:
    """Correlate the part of the input that the reference does not explain with the reference.

    Parameters
    ----------
    images
        A pair's, resampled by the transform that was found, with a margin of `PHASES_REACH_PX`.
    elsewhere_px
        See `Survey`.
    context
        Threads.
    """
    places = Places.spread(
        images.pair.grid, _CHIP_PX, lambda side: np.clip(side // _CHIP_PX, 1, _MOST_ALONG)
    )
    windows = ChipWindows(replace(images, part_of=_left), places, PHASES_REACH_PX, None)
    _, found = windows.map(_surfaces, context)
    surfaces = np.stack(found)
    return Survey(places.grid, places.centres, peak_shifts(surfaces), surfaces, elsewhere_px)


def _left(reference: Patch, input: Patch) -> tuple[Patch, Patch]:
    return reference, unexplained(reference, input)


def _surfaces(reference: Patch, left: Patch) -> Surface:
    """Return normalised surfaces of a stack of windows; 0 where too few pixels are valid."""
    agreed = phases(spectra(reference), spectra(left))
    surfaces = normalise(phase_surface(agreed, _SIDE_PX, SURVEY_RADIUS_PX))
    is_seen = left.valid.mean(axis=(1, 2), keepdims=True) >= LEAST_VALID_MASKED
    return np.where(is_seen, surfaces, 0)
