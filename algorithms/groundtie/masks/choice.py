"""The kinds of masks, and which one is used."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ..kinds import AUTO
from ..rasters.patch import is_logarithmic
from . import threshold
from .regions import GroundRegions
from .scene import Scene

NONE, THRESHOLD, REGIONS = "none", "threshold", "regions"
MASKS = (NONE, THRESHOLD, REGIONS, AUTO)

# Block means above this many times their median are strong scatterers, and scenes with more than
# that share of them are dense towns. Measured shares: real towns up to 10 %, simulated dense cities
# 12–27 %.
_STRONG = 4.0
_DENSE = 0.11

# From this share on scenes are built up: where their ground is found for sure, it is matched alone.
# Simulated suburbs: 8.3 % and more, fields up to 3.5 % (20 seeds each of the suite simulated).
_BUILT_UP = 0.08

# Speckle filters dim what is small and bright: of the least of the cities they left 9.5 %.
_PERHAPS_DENSE = 0.09

# Regions must cover this share of a scene, and their skeleton be so many times its side.
_LEAST_GROUND, _LEAST_SKELETON = 0.04, 2.0

# Where less than this share takes part, chips have too few pixels for a joint histogram of their
# own. Of simulated cities up to 42 % is ground, in pixels of 2 m and 3 m: each chip by itself was
# 1.3 px off (median), one histogram of all 0.5 px (suite calibration, class city, 2 m).
_LITTLE = 0.5

# What masks by a vector layer and by a surface model are called.
LAYER, SURFACE = "layer", "surface"

REFERENCE, INPUT = "reference", "input"


@dataclass(frozen=True)
class MaskUsed:
    """The mask that was used.

    Parameters
    ----------
    kind
        One of `MASKS`, `LAYER` or `SURFACE`.
    image
        Which image was masked: "reference" or "input"; None without a mask.
    share
        Share of the pixels that take part.
    reason
        Why, in a sentence.
    is_reliable
        Whether enough roads and banks were found for regions to be the ground, or the image shows
        the elevated objects of the surface model.
    """

    kind: str
    image: str | None
    share: float
    reason: str
    is_reliable: bool = True

    @property
    def is_ground(self) -> bool:
        """Whether nothing but ground takes part, as far as the mask is right."""
        return self.kind in (REGIONS, LAYER, SURFACE)

    @property
    def leaves_little(self) -> bool:
        """Whether chips of what takes part are too poor to be matched each by itself."""
        return self.share < _LITTLE

    def summary(self) -> dict[str, Any]:
        """Return the mask as values that JSON can carry."""
        return asdict(self)

    def line(self) -> str:
        """Return the mask as a line of text."""
        if self.image is None:
            return f"mask: {self.kind}, {self.reason}"
        return f"mask: {self.kind}, {self.share:.0%} of the {self.image} take part; {self.reason}"


def choose(strong_share: float, has_ground: Callable[[], bool]) -> tuple[str, str]:
    """Return the kind of mask that suits a radar image beside a camera's, and why.

    Parameters
    ----------
    strong_share
        The radar image's share of strong scatterers.
    has_ground
        Whether its regions are reliable; asked where they are not needed in any case.
    """
    share = f"strong scatterers on {strong_share:.0%} of the image"
    if is_dense(strong_share):
        return REGIONS, f"{share}, as in a dense town"
    if strong_share >= _BUILT_UP and has_ground():
        return REGIONS, f"{share}, as in a suburb, and its ground was found"
    return NONE, f"{share}: too few buildings to lead astray"


def is_reliable(ground: GroundRegions) -> bool:
    """Whether regions hold enough roads and banks to be the ground of a town."""
    side_m = float(np.sqrt(ground.extent_m2))
    return ground.share >= _LEAST_GROUND and ground.skeleton_m >= _LEAST_SKELETON * side_m


def is_dense(strong_share: float) -> bool:
    """Whether a radar image with this share of strong scatterers shows a dense town."""
    return strong_share >= _DENSE


def is_perhaps_dense(strong_share: float) -> bool:
    """Whether a radar image with this share, filtered or not, may show a dense town."""
    return strong_share >= _PERHAPS_DENSE


def share_of_strong_scatterers(scene: Scene) -> float:
    """Return the share of an image, 0 to 1, that is brighter than usual by 6 dB or more.

    Grey values are amplitudes; means over 4 × 4 pixels are compared with their median. Decibels
    are none: such an image has no share.
    """
    amplitude = scene.sample(threshold.BLOCK_PX)
    if amplitude.size == 0 or is_logarithmic(amplitude):
        return 0.0
    power = amplitude**2
    return float(np.mean(power > _STRONG * np.median(power)))
