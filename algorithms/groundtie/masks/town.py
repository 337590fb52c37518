"""Whether a radar image shows a town, by its strong scatterers."""

from __future__ import annotations

import numpy as np

from ..rasters.patch import has_negative
from . import threshold
from .scene import Scene

# Block means with a power above this many times the median are strong scatterers. Scenes with at
# least TOWN_SHARE of them are towns (simulated dense cities have 12–27 %, real towns up to 10 %),
# with PERHAPS_TOWN_SHARE they may be: simulated suburbs have 8.3 % and more, fields up to 3.5 % (20
# seeds each of the suite simulated), the lowest city 9.5 % where a speckle filter has dimmed small,
# bright scatterers.
_STRONG = 4.0
TOWN_SHARE, PERHAPS_TOWN_SHARE = 0.11, 0.08

# Number of means that give the share: a share of one tenth to 0.03 %, if they were independent.
# Scenes of more than 4000 × 4000 px are sampled.
_MEANS = 1_000_000


def share_of_strong_scatterers(scene: Scene) -> float:
    """Return the share of an image, 0 to 1, that is brighter than its median by more than 6 dB.

    Grey values are amplitudes; means over 4 × 4 pixels are compared with their median. The share is
    0 where many are negative, as in standardised images.
    """
    amplitude = scene.sample(threshold.BLOCK_PX, _MEANS)
    if amplitude.size == 0 or has_negative(amplitude):
        return 0.0
    power = amplitude**2
    return float(np.mean(power > _STRONG * np.median(power)))
