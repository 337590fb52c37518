"""Heights of elevated objects over a map, from a surface model or from buildings' footprints."""

from __future__ import annotations

import math
import os
import re
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from ..errors import VectorLayerError
from ..geometry.vector_layers import read_vector_layer
from ..rasters.grid import Grid
from ..rasters.height_surfaces import read_heights
from ..rasters.patch import window_sums
from ..rasters.reading import FloatImage, Mask, RasterSource
from ..rasters.warping import sample_by
from .layer import AREAS, drawn_onto
from .ray_casting import Heights

# Wider objects count as ground: halls and blocks are at most this wide, or have courtyards.
WIDEST_M = 100.0

# Lower objects count as ground: cars, hedges, the noise of a surface model.
LOWEST_M = 2.0

# Heights within this distance determine a place's ground: the widest object, and the mean's window.
GROUND_REACH_M = 1.5 * WIDEST_M

# Side of the cells whose lowest height counts as ground, in metres; courtyards are wider.
_GROUND_CELL_M = 4.0

# Placeholder above all heights on Earth.
_NOWHERE_M = np.float32(1e5)

# Heights are summed as whole numbers of this step, so that running sums leave no rounding behind.
_STEP_M = 1 / 1024

_HEIGHT_FIELDS = ("height", "height_m", "hoehe", "z_height", "measuredheight")
_NUMBER = re.compile(r"\s*(\d+(?:\.\d+)?)\s*m?\s*")


@dataclass(frozen=True)
class RasterModel:
    """A raster of heights of roofs, canopies and ground (DSM), on any grid and map.

    The ground is the surface that remains when all objects narrower than a block are removed.

    Parameters
    ----------
    raster
        The heights.
    band
        Number of the band, from 1.
    """

    raster: RasterSource
    band: int = 1

    def heights(self, piece: Grid) -> tuple[Heights, Mask]:
        """Return heights on a grid, and where they are known; the ground is found on this grid."""
        to_px = piece.to_pixels_of(self.raster.grid)
        surface, known = sample_by(
            self.raster,
            piece,
            to_px,
            "bilinear",
            lambda part, out: read_heights(self.raster, part, out, self.band),
        )
        if not known.any():
            return Heights(np.zeros_like(surface), np.zeros_like(surface)), known
        ground = bare_ground(surface, known, piece.pixel_size_m)
        # Unknown pixels must neither hide other pixels nor be laid over them.
        lowest = np.float32(ground[known].min())
        surface, ground = (np.where(known, part, lowest) for part in (surface, ground))
        return Heights(np.maximum(surface, ground), ground), known


@dataclass(frozen=True)
class FootprintModel:
    """Buildings of a vector layer, with heights above level ground.

    Parameters
    ----------
    buildings
        GeoJSON geometries on the map with their heights in metres, lower ones first.
    unknown
        Geometries of buildings whose heights are not known.
    """

    buildings: tuple[tuple[Any, float], ...]
    unknown: tuple[Any, ...] = ()

    def heights(self, piece: Grid) -> tuple[Heights, Mask]:
        """Return heights on a grid, and where they are known."""
        surface = drawn_onto(piece, self.buildings, np.float32, all_touched=True)
        shapes = [(area, 1) for area in self.unknown]
        known = drawn_onto(piece, shapes, np.uint8, all_touched=True) == 0
        return Heights(surface, np.zeros_like(surface)), known


SurfaceModel = RasterModel | FootprintModel


def read_footprints(path: str | os.PathLike[str], grid: Grid) -> FootprintModel:
    """Read buildings with their heights from a vector layer.

    Raises
    ------
    VectorLayerError
        The layer cannot be read, or has no polygons with a height.
    GeoreferencingError
        Only one of layer and grid has a CRS.
    """
    layer = read_vector_layer(path)
    field = next((name for name in layer.fields if name.lower() in _HEIGHT_FIELDS), None)
    if field is None:
        has = ", ".join(layer.fields) or "none"
        raise VectorLayerError(f"{path} has no field height with metres; its fields: {has}")
    stated = [_metres(feature["properties"].get(field)) for feature in layer.features]
    if layer.kinds.isdisjoint(AREAS) or all(height_m is None for height_m in stated):
        raise VectorLayerError(f"{path} has no polygons with a height in {field}")
    found = [
        (feature["geometry"], _metres(feature["properties"].get(field)))
        for feature in layer.on_map(grid).features
        if feature["geometry"]["type"] in AREAS
    ]
    buildings = sorted(((area, m) for area, m in found if m is not None), key=lambda one: one[1])
    return FootprintModel(tuple(buildings), tuple(area for area, m in found if m is None))


def _metres(value: Any) -> float | None:
    """Return a height in metres, a number or as OpenStreetMap writes it; None: there is none."""
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return float(value) if math.isfinite(value) else None
    match = _NUMBER.fullmatch(str(value)) if isinstance(value, str) else None
    return None if match is None else float(match[1])


def ground_cell_px(pixel_m: float) -> int:
    """Return the side, in pixels, of the cells whose lowest heights count as ground."""
    return max(round(_GROUND_CELL_M / pixel_m), 1)


def bare_ground(surface: FloatImage, known: Mask, pixel_m: float) -> FloatImage:
    """Return the height of the ground below all objects narrower than `WIDEST_M`.

    A morphological opening of the cells' lowest heights leaves level ground and slopes unchanged.
    Noise makes the lowest heights too low; the local mean height of ground pixels above them
    corrects this.
    """
    cell = ground_cell_px(pixel_m)
    rows, cols = surface.shape
    padding = [(0, -n % cell) for n in (rows, cols)]
    filled = np.pad(np.where(known, surface, _NOWHERE_M), padding, mode="edge")
    blocks = filled.reshape(filled.shape[0] // cell, cell, filled.shape[1] // cell, cell)
    side = _cells(WIDEST_M, cell * pixel_m)
    # The opening ignores everything beyond the border.
    opened: FloatImage = np.asarray(
        cv2.morphologyEx(blocks.min(axis=(1, 3)), cv2.MORPH_OPEN, np.ones((side, side), np.uint8)),
        np.float32,
    )
    raised = opened + _mean_above(blocks, opened, _cells(WIDEST_M / 2, cell * pixel_m))
    # Unknown cells beside known ones get their lowest height, for the interpolation between them.
    rim = cv2.erode(raised, np.ones((3, 3), np.uint8))
    ground = np.where(opened < _NOWHERE_M, raised, rim)
    whole = cv2.resize(ground, filled.shape[::-1], interpolation=cv2.INTER_LINEAR)
    return np.asarray(whole[:rows, :cols], np.float32)


def _mean_above(blocks: FloatImage, lowest: FloatImage, side: int) -> FloatImage:
    """Return the mean height of ground pixels above the lowest ground, shape (rows, cols).

    Blocks are cells of heights, shape (rows, n, cols, n); the mean is over `side` cells a side.
    """
    steps = np.rint((blocks - lowest[:, None, :, None]) / _STEP_M)
    is_ground = (steps <= LOWEST_M / _STEP_M) & (blocks < _NOWHERE_M)
    total, count = (
        window_sums(values.sum(axis=(1, 3), dtype=np.float64), side)
        for values in (np.where(is_ground, steps, 0), is_ground)
    )
    return (total / np.maximum(count, 1) * _STEP_M).astype(np.float32)


def _cells(length_m: float, cell_m: float) -> int:
    """Return a length in cells, as an odd number."""
    return max(round(length_m / cell_m), 1) | 1
