"""Masks by a vector layer, such as a map's roads, waters and squares."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..errors import VectorLayerError
from ..geometry.vector_layers import read_vector_layer
from ..rasters.grid import Grid
from ..rasters.reading import Mask, Window
from .scene import Scene, Selection
from .threshold import ellipse, grown

AREAS = ("Polygon", "MultiPolygon")
_LINES = ("LineString", "MultiLineString")

_Number = TypeVar("_Number", np.uint8, np.float32)


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
        Half the width of the lines, in columns and in rows.
    is_outside
        Whether the area that it does not cover takes part instead.
    """

    scene: Scene
    areas: tuple[Any, ...]
    lines: tuple[Any, ...]
    reach_px: tuple[int, int]
    is_outside: bool = False

    def select(self, window: Window) -> Selection:
        """Return the pixels of a window that take part: those that the layer covers.

        An area covers the pixels whose centres lie in it. A line covers the pixels along it
        (Bresenham's algorithm) and those within `reach_px` of them.
        """
        around = window.widened(max(self.reach_px))
        along = grown(self._drawn(self.lines, around), ellipse(*self.reach_px))
        covered = self._drawn(self.areas, window) | along[window.slices_in(around)]
        valid = self.scene.read(window).valid
        return Selection(valid & (covered != self.is_outside), valid)

    def _drawn(self, geometries: tuple[Any, ...], window: Window) -> Mask:
        shapes = [(geometry, 1) for geometry in geometries]
        return drawn_onto(self.scene.grid.window(*window), shapes, np.uint8) > 0


def drawn_onto(
    grid: Grid,
    shapes: Sequence[tuple[Any, float]],
    dtype: type[_Number],
    all_touched: bool = False,
) -> NDArray[_Number]:
    """Return shapes' values on the pixels of a grid, shape (h, w); 0 outside all shapes.

    Parameters
    ----------
    grid
        The pixels.
    shapes
        GeoJSON geometries on the grid's map and their values; where they overlap, the last one
        counts.
    dtype
        Type of the values.
    all_touched
        Whether a shape covers all pixels that it touches; else a polygon covers those whose centres
        lie in it.
    """
    from rasterio.features import rasterize

    drawn = np.zeros((grid.height, grid.width), dtype)
    if shapes:
        rasterize(shapes, out=drawn, transform=grid.transform, all_touched=all_touched)
    return drawn


def read_layer(path: str | os.PathLike[str], scene: Scene, width_m: float) -> LayerMask:
    """Read a layer's polygons, and its lines of a given width, as a mask of a scene.

    Parameters
    ----------
    path
        Any vector file that fiona reads; its first layer is used.
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
    layer = read_vector_layer(path)
    if layer.kinds.isdisjoint(AREAS + _LINES):
        raise VectorLayerError(f"the vector layer {path} has neither polygons nor lines")
    every = [feature["geometry"] for feature in layer.on_map(scene.grid).features]
    areas, lines = (
        tuple(geometry for geometry in every if geometry["type"] in kinds)
        for kinds in (AREAS, _LINES)
    )
    # With the pixels along the line, the odd number of pixels that is nearest to the width.
    across, down = (int(width_m / side_m / 2) for side_m in scene.grid.pixel_sides_m)
    return LayerMask(scene, areas, lines, (across, down))
