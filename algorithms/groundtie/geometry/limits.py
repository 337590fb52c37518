"""Limits of the search around an image's nominal place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SearchLimits:
    """Largest shift, rotation and scale of the input against its nominal geotransform.

    Parameters
    ----------
    radius
        Largest shift, in the unit of the search: metres on the map, pixels in windows.
    rotation_deg
        Largest rotation, either way.
    scale
        Smallest and largest scale.
    """

    radius: float
    rotation_deg: float = 0.0
    scale: tuple[float, float] = (1.0, 1.0)

    @property
    def is_shift(self) -> bool:
        """Whether only shifts are searched for."""
        return self.rotation_deg == 0 and self.scale == (1.0, 1.0)
