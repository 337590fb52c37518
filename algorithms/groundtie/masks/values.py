"""Values of a mask that take no part: numbers, or classes that missions define."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import ParameterError
from ..rasters.raster_masks import kept_on
from ..rasters.reading import Mask, RasterSource, Window
from ..rasters.warping import reduction
from .scene import Scene, Selection

# Stands for the values of a vector layer that covers the area which takes no part.
INSIDE = "inside"

# Pixels are read in single precision, which tells whole numbers apart up to here.
_LARGEST = 2**24 - 1

_RANGE = re.compile(r"\s*(\d{1,9})\s*(?:-\s*(\d{1,9})\s*)?")


@dataclass(frozen=True)
class MaskValues:
    """Values of a mask's first band that take no part.

    Parameters
    ----------
    ranges
        First and last value of each range.
    bits
        Values in which any of these bits is set.
    """

    ranges: tuple[tuple[int, int], ...] = ()
    bits: int = 0

    def excluded(self, values: NDArray[Any]) -> Mask:
        """Return which values, of any shape, take no part; among them all that are not finite."""
        whole = np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0).astype(np.int64)
        found = ~np.isfinite(values) | ((whole & self.bits) != 0)
        for first, last in self.ranges:
            found |= (values >= first) & (values <= last)
        return np.asarray(found)


# No data, defects, clouds and their shadows; water takes part, and so does snow but in `udm2`.
SCHEMES: Mapping[str, MaskValues] = MappingProxyType(
    {
        # Sentinel-2's scene classification: no data, saturated, shadow, clouds [MainKnorn2017].
        "scl": MaskValues(((0, 1), (3, 3), (8, 10))),
        # Landsat Collection 2: fill, dilated cloud, cirrus, cloud, shadow [USGS2022].
        "qa-pixel": MaskValues(bits=0b11111),
        # Fmask: shadow, cloud, no observation [Zhu2012].
        "fmask": MaskValues(((2, 2), (4, 4), (255, 255))),
        # Harmonized Landsat Sentinel-2: cirrus, cloud, adjacent to either, shadow [Claverie2018];
        # fill has all bits set.
        "hls-fmask": MaskValues(bits=0b1111),
        # Planet's usable data mask: its first band is 0 on cloud, haze, shadow, snow [Planet2022].
        "udm2": MaskValues(((0, 0),)),
    }
)


def mask_values(text: str) -> MaskValues:
    """Return the values that a text stands for: a scheme's name, or numbers such as 3,8-10.

    Raises
    ------
    ParameterError
        The text is neither.
    """
    scheme = SCHEMES.get(text.strip().lower().replace("_", "-"))
    if scheme is not None:
        return scheme
    ranges = []
    for part in text.split(","):
        match = _RANGE.fullmatch(part)
        first, last = (0, -1) if match is None else (int(match[1]), int(match[2] or match[1]))
        if not first <= last <= _LARGEST:
            names = ", ".join(SCHEMES)
            raise ParameterError(
                f"values of a mask must be numbers up to {_LARGEST} and ranges, as 3,8-10, or one "
                f"of {names}; of a vector layer {INSIDE}; not {text!r}"
            )
        ranges.append((first, last))
    return MaskValues(tuple(ranges))


@dataclass(frozen=True)
class RasterMask:
    """The part of a scene that a mask covers with none of the given values.

    Parameters
    ----------
    scene
        The image.
    mask
        The raster, whose first band counts. Its nodata value is treated like any other value.
    values
        Values that take no part.
    """

    scene: Scene
    mask: RasterSource
    values: MaskValues

    def select(self, window: Window) -> Selection:
        """Return which pixels of a window take part."""
        bands = tuple(replace(band, nodata=None) for band in self.mask.bands)
        mask = replace(self.mask, bands=bands, has_mask_band=False)
        grid, excluded = self.scene.grid, self.values.excluded
        to_mask, piece = grid.to_pixels_of(mask.grid), grid.window(*window)
        kept = kept_on(mask, piece, to_mask, lambda found: ~excluded(found), self._span)
        valid = self.scene.read(window).valid
        return Selection(valid & kept, valid)

    @cached_property
    def _span(self) -> tuple[int, int]:
        """How many columns and rows of the mask a pixel of the image spans."""
        grid = self.scene.grid
        return reduction(grid, grid.to_pixels_of(self.mask.grid), self.mask.grid.size)
