"""Terrain heights behind an orthoimage's relief displacement: true and assumed ones.

Orthorectification puts each pixel where its line of sight meets the assumed heights. An error of
the assumed heights therefore displaces the pixel along the line of sight.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from affine import Affine
from rasterio.crs import CRS

from ..errors import NoOverlapError
from ..rasters.grid import (
    Grid,
    apply_affine,
    compose,
    mesh,
    require_both_or_none,
)
from ..rasters.height_surfaces import RasterSurface, surface_around
from ..rasters.reading import open_raster
from .models import FloatArray

# Heights must be known on a square lattice with this many points a side.
_ASKED = 33


@dataclass(frozen=True)
class Terrain:
    """Heights of the ground, and the heights that an orthoimage was made with.

    Parameters
    ----------
    ground
        Heights of the ground at map positions.
    assumed
        Heights that the orthoimage was made with; None: one height everywhere.
    region
        Smallest x and y, then largest x and y, of the map area in question. Within it, voids are
        filled and the outermost heights are extended beyond the rasters.
    plane
        Takes query positions, on a map or in a grid's pixels, to the map.
    """

    ground: RasterSurface
    assumed: RasterSurface | None
    region: tuple[float, float, float, float]
    plane: Affine = field(default_factory=Affine.identity)

    @classmethod
    def open(
        cls,
        dem: Any,
        input_dem: Any | None,
        crs: CRS | None,
        region: tuple[float, float, float, float],
    ) -> Terrain:
        """Open terrain models for positions on a map.

        Parameters
        ----------
        dem, input_dem
            The rasters, in any CRS, as `open_raster` takes them.
        crs
            CRS of the map.
        region
            See `Terrain`.

        Raises
        ------
        GeoreferencingError, NoOverlapError, RasterContentError
            A raster has no location, lies elsewhere or holds no value in the region.
        """
        assumed = None if input_dem is None else _surface(input_dem, crs, region)
        return cls(_surface(dem, crs, region), assumed, region)

    def seen_from(self, affine: Affine) -> Terrain:
        """Return this terrain for pixel positions, which `affine` takes to its query positions."""
        return replace(self, plane=compose(self.plane, affine))

    def ground_m(self, xy: FloatArray) -> FloatArray:
        """Return the height of the ground, (n,), at positions (n, 2); NaN if unknown."""
        return self.ground.at(apply_affine(self.plane, xy))

    def assumed_m(self, xy: FloatArray) -> FloatArray:
        """Return the height, (n,), that the orthoimage was made with at positions (n, 2)."""
        if self.assumed is None:
            return np.zeros(len(xy))
        return self.assumed.at(apply_affine(self.plane, xy))

    def require_cover(self, grid: Grid, within: Grid, crs: CRS | None) -> None:
        """Refuse terrain models that do not cover the overlap of two grids.

        Voids amid heights are covered; those that are open to the region's edge are not.

        Raises
        ------
        NoOverlapError
            A terrain model does not reach a part of the overlap, or has no heights there.
        """
        xy = grid.pixel_to_map(grid.places(_ASKED))
        xy = xy[within.covers(within.to_own_map(xy, crs))]
        for surface in (self.ground, self.assumed):
            if surface is None:
                continue
            own = surface.source.grid
            known = own.covers(own.to_own_map(xy, crs)) & surface.encloses(xy)
            if not known.all():
                share = math.floor(100 * known.mean())
                raise NoOverlapError(
                    f"{surface.source.path} covers only {share} % of where the images overlap: "
                    "give a terrain model of all of it"
                )

    def to_json(self) -> dict[str, Any]:
        """Return where the heights come from as values that JSON can carry."""
        assumed = self.assumed
        return {
            "dem": _place(self.ground),
            "input_dem": None if assumed is None else _place(assumed),
            "region": list(self.region),
        }


def _surface(
    raster: Any, crs: CRS | None, region: tuple[float, float, float, float]
) -> RasterSurface:
    # Not closed: the transform may be evaluated, and heights needed, at any time.
    source = open_raster(raster)
    grid = source.grid
    require_both_or_none(grid.crs, crs, f"{source.path} and the reference")
    left, bottom, right, top = region
    last = np.array(grid.size) - 1

    def to_px(xy: FloatArray) -> FloatArray:
        px = grid.map_to_pixel(grid.to_own_map(xy, crs))
        asked = np.all((xy >= [left, bottom]) & (xy <= [right, top]), axis=1)
        return np.where(asked[:, None], np.clip(px, 0, last), px)

    xy = mesh(np.linspace(left, right, _ASKED), np.linspace(bottom, top, _ASKED))
    return surface_around(source, to_px, xy)


def _place(surface: RasterSurface) -> str:
    path = Path(surface.source.place or surface.source.path)
    return str(path.resolve() if path.exists() else path)
