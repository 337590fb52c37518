"""Where the input's ground lies that the reference does not explain, by phases all over a pair.

Content that lies over both images, half transparent, is most of each: chips match where it is. The
ground beneath, weak as it is, is moved by one shift all over, which adds up in phases.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..context import Context
from ..geometry.transform import Transform
from ..rasters.pair import ImagePair
from ..rasters.patch import Patch
from ..similarity.phases import Spectra, phase_surface, phases, spectra
from ..similarity.surface import Surface
from ..similarity.unexplained import unexplained
from .chip_windows import ChipWindows, Resampled
from .matcher import Places
from .survey import SURVEY_RADIUS_PX

# Windows of 192 px, as for bands. They overlap by half, as their tapers ask for, also beyond the
# images' borders, until there are so many along a side.
_CHIP_PX, _REACH_PX = 64, 64
_SIDE_PX = _CHIP_PX + 2 * _REACH_PX
_EVERY_PX, _MOST_ALONG = _SIDE_PX // 2, 7


@dataclass(frozen=True)
class PhaseSurvey:
    """How what the reference does not explain of the input correlates with it, by shift.

    Parameters
    ----------
    surface
        Correlation of phases by shift from where a transform has the input, up to the radius of
        surveys, in robust standard deviations of windows' whole surface, shape (2 r + 1, 2 r + 1).
    """

    surface: Surface

    def highest_beyond(self, px: float) -> tuple[float, float]:
        """Return how high the highest shift is that is longer than some pixels, and its length."""
        shift = np.arange(-SURVEY_RADIUS_PX, SURVEY_RADIUS_PX + 1)
        length = np.hypot(*np.meshgrid(shift, shift))
        far = np.where(length > px, self.surface, -np.inf)
        at = int(far.argmax())
        return float(far.flat[at]), float(length.flat[at])


def survey_phases(pair: ImagePair, transform: Transform, context: Context) -> PhaseSurvey:
    """Correlate what the reference does not explain of the input with the reference, all over.

    Parameters
    ----------
    pair
        The images.
    transform
        What was found.
    context
        Threads.
    """
    places = Places.spread(
        pair.grid, _CHIP_PX, lambda side: np.clip(side // _EVERY_PX, 1, _MOST_ALONG)
    )
    images = Resampled.of(pair, transform, places.grid, _REACH_PX + 1, context)
    _, found = ChipWindows(images, places, _REACH_PX, None).map(_phases, context)
    surface = phase_surface(np.sum(found, axis=0), _SIDE_PX)
    near = slice(len(surface) // 2 - SURVEY_RADIUS_PX, len(surface) // 2 + SURVEY_RADIUS_PX + 1)
    return PhaseSurvey(surface[near, near])


def _phases(reference: Patch, input: Patch) -> Sequence[Spectra]:
    return list(phases(spectra(reference), spectra(unexplained(reference, input))))
