"""What mask rasters let take part of other grids."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .averaging import average_window
from .grid import Grid, PointFunction
from .reading import RasterSource
from .warping import sample, sample_by
from .windows import FloatImage, Mask, Window

# A larger pixel takes part if so much of it does: all but what interpolation hardly weighs.
_KEPT_SHARE = 0.99


def kept_on(
    mask: RasterSource,
    grid: Grid,
    to_mask_px: PointFunction,
    keeps: Callable[[FloatImage], Mask],
    span: tuple[int, int],
) -> Mask:
    """Return which pixels of a grid a mask's first band lets take part; beyond the mask none.

    Parameters
    ----------
    mask
        The raster.
    grid
        The grid.
    to_mask_px
        Takes its map positions to pixels of the mask.
    keeps
        Returns which of the mask's values take part; pixels without data never do.
    span
        Columns and rows of the mask that must take part together, as `reduction` has them; (1, 1):
        the nearest pixel decides.
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
    cols, rows = part.col + np.arange(part.width), part.row + np.arange(part.height)
    on_rows = (rows >= 0) & (rows < source.grid.height)
    return np.logical_and.outer(on_rows, (cols >= 0) & (cols < source.grid.width))
