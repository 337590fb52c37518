"""How far an image may lie from its nominal place."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SearchLimits:
    """How far the input may be shifted, rotated and scaled against its nominal geotransform.

    Parameters
    ----------
    radius
        Largest shift, in the unit of the positions searched: metres on the map, pixels of windows.
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
        """Whether nothing but shifts is searched for."""
        return self.rotation_deg == 0 and self.scale == (1.0, 1.0)
