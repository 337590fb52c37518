"""Masks by a vector layer: roads, waters, squares of a map."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import VectorLayerError
from ..geometry.vector_layers import read_vector_layer
from ..rasters.reading import Mask, Window
from .scene import Scene, Selection
from .threshold import grown

AREAS = ("Polygon", "MultiPolygon")
_LINES = ("LineString", "MultiLineString")


@dataclass(frozen=True)
class LayerMask:
    """The part of a scene that a vector layer covers.

    Parameters
    ----------
    scene
        The image.
    areas, lines
        GeoJSON geometries on the scene's map.
    reach_px
        Half of the width of the lines.
    is_outside
        Whether what it does not cover takes part instead.
    """

    scene: Scene
    areas: tuple[Any, ...]
    lines: tuple[Any, ...]
    reach_px: int
    is_outside: bool = False

    def select(self, window: Window) -> Selection:
        """Return which pixels of a window take part: those whose centres it covers."""
        reach = self.reach_px
        around = Window(
            window.col - reach,
            window.row - reach,
            window.width + 2 * reach,
            window.height + 2 * reach,
        )
        along = grown(self._drawn(self.lines, around), reach)
        inside = np.s_[reach : reach + window.height, reach : reach + window.width]
        covered = self._drawn(self.areas, window) | along[inside]
        valid = self.scene.read(window).valid
        return Selection(valid & (covered != self.is_outside), valid)

    def _drawn(self, geometries: tuple[Any, ...], window: Window) -> Mask:
        from rasterio.features import rasterize

        shape = (window.height, window.width)
        if not geometries:
            return np.zeros(shape, bool)
        transform = self.scene.grid.window(*window).transform
        drawn = rasterize(geometries, out_shape=shape, transform=transform, dtype=np.uint8)
        return np.asarray(drawn > 0)


def read_layer(path: str | os.PathLike[str], scene: Scene, width_m: float) -> LayerMask:
    """Read a layer's polygons, and its lines of a given width, as a mask of a scene.

    Parameters
    ----------
    path
        Any vector file that fiona reads; its first layer is taken.
    scene
        The image.
    width_m
        Width of lines.

    Raises
    ------
    VectorLayerError
        The layer cannot be read, or has neither polygons nor lines.
    GeoreferencingError
        Only one of layer and scene has a CRS.
    """
    layer = read_vector_layer(path).on_map(scene.grid.crs)
    every = [feature["geometry"] for feature in layer.features]
    found = [geometry for geometry in every if geometry["type"] in AREAS + _LINES]
    areas, lines = (
        tuple(geometry for geometry in found if geometry["type"] in kinds)
        for kinds in (AREAS, _LINES)
    )
    if not areas and not lines:
        raise VectorLayerError(f"the vector layer {path} has neither polygons nor lines")
    return LayerMask(scene, areas, lines, int(width_m / scene.grid.pixel_size_m / 2))
