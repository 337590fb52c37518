"""Where the input's ground lies that the reference does not explain, by phases all over a pair.

Content that lies over both images, half transparent, is most of each: chips match where it is. The
ground beneath, weak as it is, is moved by one shift all over, on which phases agree.
"""

from __future__ import annotations

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

# Windows of 192 px, as for bands, overlap by two thirds and reach beyond the borders, until there
# are so many along a side.
_CHIP_PX, PHASES_REACH_PX, _MOST_ALONG = 64, 64, 7
_SIDE_PX = _CHIP_PX + 2 * PHASES_REACH_PX


def survey_unexplained(images: Resampled, elsewhere_px: float, context: Context) -> Survey:
    """Correlate what the reference does not explain of the input with the reference, all over.

    Parameters
    ----------
    images
        A pair's, resampled by what was found, with `PHASES_REACH_PX` around them.
    elsewhere_px
        See `Survey`.
    context
        Threads.
    """
    places = Places.spread(
        images.pair.grid, _CHIP_PX, lambda side: np.clip(side // _CHIP_PX, 1, _MOST_ALONG)
    )
    windows = ChipWindows(images, places, PHASES_REACH_PX, None, unexplained)
    _, found = windows.map(_surfaces, context)
    surfaces = np.stack(found)
    return Survey(places.grid, places.centres, peak_shifts(surfaces), surfaces, elsewhere_px)


def _surfaces(reference: Patch, left: Patch) -> Surface:
    """Return normalised surfaces of a stack of windows; 0 where too little is left."""
    agreed = phases(spectra(reference), spectra(left))
    surfaces = normalise(phase_surface(agreed, _SIDE_PX, SURVEY_RADIUS_PX))
    is_seen = left.valid.mean(axis=(1, 2), keepdims=True) >= LEAST_VALID_MASKED
    return np.where(is_seen, surfaces, 0)
