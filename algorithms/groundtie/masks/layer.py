"""Masks by a vector layer: roads, waters, squares, as a map has them."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from rasterio.crs import CRS
from rasterio.errors import CRSError

from ..errors import GeoreferencingError, VectorLayerError
from ..rasters.grid import reproject
from ..rasters.reading import Window
from .scene import Scene, Selection


@dataclass(frozen=True)
class LayerMask:
    """What a vector layer covers of a scene; `shapes` are shapely polygons on the scene's map."""

    scene: Scene
    shapes: tuple[Any, ...]

    def select(self, window: Window) -> Selection:
        """Return which pixels of a window take part: those whose centres are covered."""
        from rasterio.features import rasterize

        piece = self.scene.grid.window(*window)
        covered = rasterize(
            self.shapes,
            out_shape=(window.height, window.width),
            transform=piece.transform,
            dtype=np.uint8,
        )
        valid = self.scene.read(window).valid
        return Selection(valid & (covered > 0), valid)


def read_layer(path: str | os.PathLike[str], scene: Scene, width_m: float) -> LayerMask:
    """Read a layer's polygons, and its lines as wide as told, as a mask of a scene.

    Parameters
    ----------
    path
        Any vector file that fiona reads; its first layer is taken.
    scene
        What is masked.
    width_m
        Width of lines.

    Raises
    ------
    VectorLayerError
        The layer cannot be read, or has neither polygons nor lines.
    GeoreferencingError
        Only one of layer and scene has a CRS.
    """
    import fiona
    import shapely
    from fiona.errors import FionaError
    from shapely.geometry import shape

    try:
        with fiona.open(os.fspath(path)) as layer:
            crs = _crs(layer.crs_wkt)
            found = [shape(item["geometry"]) for item in layer if item["geometry"] is not None]
    except (FionaError, OSError, ValueError) as error:
        raise VectorLayerError(f"cannot read the vector layer {path}: {error}") from error
    flat = [part for whole in found for part in getattr(whole, "geoms", [whole])]
    kinds = ("Polygon", "LineString", "LinearRing")
    flat = [part for part in flat if part.geom_type in kinds and not part.is_empty]
    if not flat:
        raise VectorLayerError(f"the vector layer {path} has neither polygons nor lines")
    grid = scene.grid
    if (crs is None) != (grid.crs is None):
        raise GeoreferencingError(f"only one of {path} and {scene.like.path} has a CRS")

    def on_map(xy: np.ndarray) -> np.ndarray:
        return reproject(xy, crs, grid.crs)

    moved = [shapely.transform(part, on_map) for part in flat]
    half = width_m / 2 / float(np.mean(grid.metres_per_unit))
    shapes = [part if part.geom_type == "Polygon" else part.buffer(half) for part in moved]
    return LayerMask(scene, tuple(shapes))


def _crs(text: str) -> CRS | None:
    if not text:
        return None
    try:
        return CRS.from_wkt(text)
    except CRSError as error:
        raise VectorLayerError(f"the vector layer's CRS cannot be understood: {error}") from error
