"""Masks by the values of a raster, on any grid and map."""

from __future__ import annotations

from dataclasses import dataclass, replace

from ..rasters.grid import reproject
from ..rasters.reading import RasterSource, Window
from ..rasters.warping import sample
from .scene import Scene, Selection
from .values import MaskValues


@dataclass(frozen=True)
class RasterMask:
    """The part of a scene where a mask has none of some values; beyond the mask nothing is.

    Parameters
    ----------
    scene
        The image.
    mask
        The raster, whose first band counts. What it states as nodata is a value as any other.
    values
        What takes no part.
    """

    scene: Scene
    mask: RasterSource
    values: MaskValues

    def select(self, window: Window) -> Selection:
        """Return which pixels of a window take part."""
        bands = tuple(replace(band, nodata=None) for band in self.mask.bands)
        mask = replace(self.mask, bands=bands, has_mask_band=False)
        piece, grid = self.scene.grid.window(*window), mask.grid
        found, inside = sample(
            mask,
            piece,
            lambda xy: grid.map_to_pixel(reproject(xy, piece.crs, grid.crs)),
            "nearest",
            1,
        )
        valid = self.scene.read(window).valid
        return Selection(valid & inside & ~self.values.excluded(found), valid)
