"""Check whether heights fit the RPCs, as evidence of a wrong vertical datum.

A constant error of all heights moves image positions by nearly the same everywhere, whatever the
relief. A refinement absorbs it as a shift of the RPCs, so that residuals do not show it. The range
of heights that the RPCs were made for may show it, and so may the control points' own heights.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from ..errors import GroundTieError
from ..rasters.reading import open_raster
from .geoids import find_geoid
from .heights import ConstantHeight, surface_over
from .orientation import FloatArray, Orientation, seen_at

# Largest height offset without a warning, in metres: terrain models err by a few metres, geoids lie
# tens from the ellipsoid.
_OFFSET_M = 10.0

# The ground must also leave the RPCs' range of heights by more than this share of half the range.
_BEYOND_SHARE = 0.05

# Share of the ground's heights that is left out at either end of their range.
_TAIL = 0.01


@dataclass(frozen=True)
class HeightCheck:
    """Evidence of the vertical datum of the heights.

    Parameters
    ----------
    ground_m
        Lowest and highest ground in the image, metres above the ellipsoid.
    range_m
        Lowest and highest height that the RPCs were made for.
    geoid_m
        Height of the geoid EGM96 above the ellipsoid; None: its grid cannot be read, or the height
        is constant.
    control_offset_m
        Median of the control points' own heights minus the ground's; None: they have none.
    """

    ground_m: tuple[float, float]
    range_m: tuple[float, float]
    geoid_m: float | None
    control_offset_m: float | None = None

    @property
    def beyond_m(self) -> float:
        """Distance by which the ground leaves the RPCs' range: below (negative) or above it."""
        below = min(self.ground_m[0] - self.range_m[0], 0.0)
        above = max(self.ground_m[1] - self.range_m[1], 0.0)
        return max(above, below, key=abs)

    def summary(self) -> dict[str, Any]:
        """Return the check as JSON values."""
        return asdict(self) | {"warnings": self.warnings()}

    def warnings(self) -> list[str]:
        """Return warnings of wrong heights."""
        found = []
        scale = (self.range_m[1] - self.range_m[0]) / 2
        if abs(self.beyond_m) > max(_OFFSET_M, _BEYOND_SHARE * scale):
            geoid = (
                "" if self.geoid_m is None else f" (EGM96 is {self.geoid_m:.0f} m above it here)"
            )
            found.append(
                f"the ground lies at {self.ground_m[0]:.0f} to {self.ground_m[1]:.0f} m above the "
                f"ellipsoid{geoid}, but the RPCs were made for {self.range_m[0]:.0f} to "
                f"{self.range_m[1]:.0f} m: is the vertical datum right?"
            )
        if self.control_offset_m is not None and abs(self.control_offset_m) > _OFFSET_M:
            found.append(
                f"the control points lie {self.control_offset_m:+.0f} m from the ground of the "
                "terrain model: is the vertical datum right?"
            )
        return found


def check_heights(
    orientation: Orientation, size: tuple[int, int], control_offset_m: float | None
) -> HeightCheck:
    """Check the heights of an orientation.

    Parameters
    ----------
    orientation
        The image's orientation.
    size
        Width and height of the image, in pixels.
    control_offset_m
        See `HeightCheck`.
    """
    rpc = orientation.rpc
    seen = seen_at(rpc, size, orientation.heights.typical_m)
    low, high = np.nanquantile(orientation.heights.at(seen), (_TAIL, 1 - _TAIL)).tolist()
    constant = isinstance(orientation.heights, ConstantHeight)
    geoid_m = None if constant else _geoid(seen)
    return HeightCheck((low, high), rpc.heights_m(), geoid_m, control_offset_m)


def _geoid(lon_lat: FloatArray) -> float | None:
    try:
        path = find_geoid("EGM96")
        assert path is not None
        with open_raster(path) as source:
            return float(np.nanmean(surface_over(source, lon_lat).at(lon_lat)))
    except GroundTieError:
        return None
