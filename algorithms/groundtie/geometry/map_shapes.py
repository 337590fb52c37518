"""Shapes of a vector layer on the map of a grid.

Straight edges of one map are curves on another one, so that long edges are divided before they are
reprojected. What lies far from the grid is cut off first: it may be outside of the projection's
domain, as a polygon of all oceans is on a UTM map.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely.affinity
import shapely.geometry
import shapely.ops
from rasterio.crs import CRS

from ..rasters.grid import FloatArray, Grid, finite, full_turn, mesh, near_longitude, reproject

# Positions along each side of the grid by which its place on the layer's map is known.
_NODES = 21

# Edges are divided into pieces of this share of the grid's side: a parallel at latitude φ departs
# from its chord by L² tan φ / 8 R, which is 0.02 m of 1 km at 45°.
_PIECE = 0.01


@dataclass(frozen=True)
class MapShapes:
    """The neighbourhood of a grid on the map of a layer.

    Parameters
    ----------
    grid
        The pixels.
    crs
        CRS of the layer, another one than the grid's, or one with longitudes.
    box
        Left, lower, right and upper limit on the layer's map: the grid's extent, and as much on
        each side of it.
    piece
        Largest length of an edge, in units of the layer's map.
    """

    grid: Grid
    crs: CRS
    box: tuple[float, float, float, float]
    piece: float

    @classmethod
    def around(cls, grid: Grid, crs: CRS) -> MapShapes | None:
        """Return the neighbourhood of a grid; None if no part of it has a place on the map."""
        along = [np.linspace(-0.5, side - 0.5, _NODES) for side in grid.size]
        seen = reproject(grid.pixel_to_map(mesh(*along)), grid.crs, crs)
        known = finite(seen)
        if not len(known):
            return None
        seen, known = (near_longitude(xy, known[len(known) // 2, 0], crs) for xy in (seen, known))
        low, high = known.min(axis=0), known.max(axis=0)
        (left, lower), (right, upper) = 2 * low - high, 2 * high - low
        with np.errstate(invalid="ignore"):
            steps = np.linalg.norm(np.diff(seen.reshape(_NODES, _NODES, 2), axis=1), axis=2)
        piece = float(np.nanmedian(steps)) * (_NODES - 1) * _PIECE
        return cls(grid, crs, (left, lower, right, upper), piece)

    def of(self, geometry: Any) -> list[Any]:
        """Return the parts of a geometry that lie near the grid, on the grid's map.

        The geometry and its parts are as in GeoJSON, without collections.

        Raises
        ------
        ValueError, ShapelyError
            The geometry is damaged, or has no place on the grid's map.
        """
        shape, turn = shapely.geometry.shape(geometry), full_turn(self.crs)
        copies = [shape]
        if turn is not None:
            copies = [shapely.affinity.translate(shape, by) for by in (-turn, 0.0, turn)]
        return [self._on_grids_map(part) for copy in copies for part in self._cut(copy)]

    def _cut(self, shape: Any) -> list[Any]:
        if shape.is_empty:
            return []
        left, lower, right, upper = shape.bounds
        box, kind = self.box, str(shape.geom_type).removeprefix("Multi")
        is_near = box[0] <= left and box[1] <= lower and right <= box[2] and upper <= box[3]
        # Polygons that cross themselves would become their complement.
        if not is_near and shape.is_valid:
            shape = shapely.ops.clip_by_rect(shape, *box)
        # What the box only touches is of another kind: a line or a point.
        return [part for part in getattr(shape, "geoms", [shape]) if part.geom_type == kind]

    def _on_grids_map(self, part: Any) -> dict[str, Any]:
        if part.geom_type == "Polygon":
            rings = [self._line(ring) for ring in (part.exterior, *part.interiors)]
            return {"type": "Polygon", "coordinates": rings}
        line = self._line(part)
        is_point = part.geom_type == "Point"
        return {"type": part.geom_type, "coordinates": line[0] if is_point else line}

    def _line(self, of: Any) -> list[list[float]]:
        xy = np.array(of.coords, float)[:, :2]
        if self.crs != self.grid.crs:
            xy = self._reprojected(_divided(xy, self.piece))
            if not np.isfinite(xy).all():
                raise ValueError("a part near the image has no place on its map")
        return list(xy.tolist())

    def _reprojected(self, xy: FloatArray) -> FloatArray:
        moved = reproject(xy, self.crs, self.grid.crs)
        turn, own = full_turn(self.grid.crs), full_turn(self.crs)
        if turn is None:
            return moved
        # Reprojected longitudes lie within ±180°, those of a layer may not.
        if own is not None:
            return near_longitude(moved, xy[:, :1] / own * turn, self.grid.crs)
        centre = self.grid.pixel_to_map([self.grid.centre_px])[0, 0]
        return near_longitude(moved, centre, self.grid.crs)


def _divided(xy: FloatArray, longest: float) -> FloatArray:
    """Return a line, (n, 2), with all edges divided into equal pieces no longer than a length."""
    edges = np.diff(xy, axis=0)
    counts = np.maximum(np.ceil(np.hypot(*edges.T) / longest), 1).astype(int)
    firsts = np.repeat(np.cumsum(counts) - counts, counts)
    share = (np.arange(counts.sum()) - firsts) / np.repeat(counts, counts)
    pieces = np.repeat(xy[:-1], counts, axis=0) + share[:, None] * np.repeat(edges, counts, axis=0)
    return np.concatenate([pieces, xy[-1:]])
