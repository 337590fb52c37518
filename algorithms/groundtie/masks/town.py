"""Whether a radar image shows a town, by its strong scatterers."""

from __future__ import annotations

import numpy as np

from ..rasters.patch import is_logarithmic
from . import threshold
from .scene import Scene

# Block means above this many times their median are strong scatterers. Scenes with at least that
# share of them are towns (simulated dense cities have 12–27 %, real towns up to 10 %), or may be:
# simulated suburbs have 8.3 % and more, fields up to 3.5 % (20 seeds each of the suite simulated),
# the least of the cities 9.5 % where a speckle filter has dimmed what is small and bright.
_STRONG = 4.0
TOWN_SHARE, PERHAPS_TOWN_SHARE = 0.11, 0.08

# So many means give a share, if they were independent a tenth to 0.03 %: scenes of more than
# 4000 × 4000 px are sampled.
_MEANS = 1_000_000


def share_of_strong_scatterers(scene: Scene) -> float:
    """Return the share of an image, 0 to 1, that is brighter than usual by 6 dB or more.

    Grey values are amplitudes; means over 4 × 4 pixels are compared with their median. Decibels
    are none: such an image has no share.
    """
    amplitude = scene.sample(threshold.BLOCK_PX, _MEANS)
    if amplitude.size == 0 or is_logarithmic(amplitude):
        return 0.0
    power = amplitude**2
    return float(np.mean(power > _STRONG * np.median(power)))
