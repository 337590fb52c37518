"""Mask rasters evaluated on other grids."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .averaging import average_window
from .grid import Grid, PointFunction
from .reading import RasterSource
from .warping import sample, sample_by
from .windows import FloatImage, Mask, Window

# A larger pixel takes part if this share of it does: all but parts of negligible weight.
_KEPT_SHARE = 0.99


def kept_on(
    mask: RasterSource,
    grid: Grid,
    to_mask_px: PointFunction,
    keeps: Callable[[FloatImage], Mask],
    span: tuple[int, int],
) -> Mask:
    """Return which pixels of a grid a mask's first band keeps; none beyond the mask.

    Parameters
    ----------
    mask
        The raster.
    grid
        The grid.
    to_mask_px
        Takes the grid's map positions to pixels of the mask.
    keeps
        Returns which of the mask's values are kept; pixels without data never are.
    span
        Columns and rows of the mask that must all be kept, as from `reduction`; (1, 1): the nearest
        pixel decides.
    """
    if span == (1, 1):
        values, known = sample(mask, grid, to_mask_px, "nearest", 1)
        return known & keeps(values)

    def kept(source: RasterSource, part: Window) -> tuple[FloatImage, Mask]:
        values, known = source.read(part, 1)
        return (known & keeps(values)).astype(np.float32), _inside(source, part)

    def shares(part: Window, shape: tuple[int, int] | None) -> tuple[FloatImage, Mask]:
        return kept(mask, part) if shape is None else average_window(kept, mask, mask, part, shape)

    share, inside = sample_by(mask, grid, to_mask_px, "bilinear", shares, span)
    return inside & (share >= _KEPT_SHARE)


def _inside(source: RasterSource, part: Window) -> Mask:
    """Return which pixels of a window lie on a raster."""
    inside = np.zeros((part.height, part.width), bool)
    inside[part.common(source.window).slices_in(part)] = True
    return inside
