"""A raster's grey image held in memory, for steps that read it again and again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..arrays import Raster
from .bands import BandInfo
from .handles import ArrayHandles
from .reading import RasterSource


def held_grey(source: RasterSource, band: int | None = None) -> RasterSource:
    """Return a raster that reads the same grey values and validity as another one, from memory.

    Parameters
    ----------
    source
        The raster.
    band
        Number of its band, from 1; None: the mean of all bands but alpha.
    """
    values, valid = source.read(source.window, band)
    values[~valid] = np.nan
    # Whoever states nothing of what is valid must not seem to.
    nodata = float("nan") if source.says_what_is_valid else None
    return replace(
        source,
        bands=(BandInfo.plain("float32", nodata),),
        has_mask_band=False,
        colormap=None,
        _handles=ArrayHandles(Raster(values)),
    )
