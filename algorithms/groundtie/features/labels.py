"""Labelled keypoints of an image, from a raster or a vector layer, for training a classifier."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..context import Context
from ..errors import ParameterError, VectorLayerError
from ..geometry.vector_layers import read_vector_layer
from ..masks.layer import AREAS, drawn_onto
from ..rasters.grid import FloatArray, Grid
from ..rasters.pair import Image
from ..rasters.patch import window_sums
from ..rasters.reading import RasterSource, Window
from ..rasters.tiling import tiles
from ..rasters.warping import sample
from .classifier_training import Training
from .patch_statistics import BAND_RATIOS, NO_BANDS, PATCH_PX, patch_statistics
from .tiles import MARGIN_PX, TILE_PX, Detecting, inside

Labels = NDArray[np.int8]

# Labels of keypoints: to be kept, to be left out, or none.
KEPT, LEFT_OUT, UNKNOWN = 1, 0, -1


# A keypoint's descriptor depends on its whole patch: matches are rarely right if more than this
# share of the patch is to be left out (reasoned, not tuned).
_LARGEST_SHARE = 0.25


@dataclass(frozen=True)
class RasterLabels:
    """Labels of a raster's first band: pixels of some values are to be left out, others kept.

    Parameters
    ----------
    source
        The raster.
    left_out
        The values to be left out.
    chosen
        Whether points were chosen; the sizes of the classes are then not representative.
    """

    source: RasterSource
    left_out: frozenset[str]
    chosen: ClassVar = False

    def label(self, piece: Grid) -> Labels:
        """Return the labels of a grid's pixels, shape (h, w)."""
        values, known = sample(
            self.source, piece, piece.to_pixels_of(self.source.grid), "nearest", 1
        )
        numbers = [float(text) for text in self.left_out]
        labels = np.where(np.isin(values, numbers), LEFT_OUT, KEPT)
        return np.where(known, labels, UNKNOWN).astype(np.int8)

    def points(self, piece: Grid) -> tuple[FloatArray, Labels]:
        """Return the source's own points as positions on a grid, shape (m, 2), and their labels."""
        return np.zeros((0, 2)), np.zeros(0, np.int8)


@dataclass(frozen=True)
class LayerLabels:
    """Labels of a vector layer: pixels in its polygons, and its points.

    Parameters
    ----------
    areas
        Polygons as GeoJSON on the image's map, and their labels.
    xy, labels
        Points on the image's map, shape (m, 2), and their labels.
    """

    areas: tuple[tuple[dict[str, Any], int], ...]
    xy: FloatArray
    labels: Labels

    @property
    def chosen(self) -> bool:
        """Whether points were chosen (see `RasterLabels`): points are, polygons are not."""
        return len(self.xy) > 0

    def label(self, piece: Grid) -> Labels:
        """Return the labels of a grid's pixels, shape (h, w)."""
        # Pixels on which no polygon is drawn, 0, have unknown labels.
        shapes = [(geometry, label - UNKNOWN) for geometry, label in self.areas]
        return np.asarray(drawn_onto(piece, shapes, np.uint8).astype(np.int8) + UNKNOWN, np.int8)

    def points(self, piece: Grid) -> tuple[FloatArray, Labels]:
        """Return the source's own points as positions on a grid, shape (m, 2), and their labels."""
        return piece.map_to_pixel(self.xy), self.labels


LabelSource = RasterLabels | LayerLabels


def patch_labels(labels: Labels, px: FloatArray) -> Labels:
    """Return the labels of keypoints, from those of all pixels in their patches.

    Parameters
    ----------
    labels
        Labels of the pixels, shape (h, w).
    px
        Positions (col, row) of n keypoints, shape (n, 2).

    Returns
    -------
    Shape (n,): unknown if the keypoint's own pixel is, left out if more than a quarter of the known
    pixels in the patch around it are.
    """
    left_out, known = (
        window_sums(which.astype(np.float32), PATCH_PX)
        for which in (labels == LEFT_OUT, labels != UNKNOWN)
    )
    label = np.where(left_out > _LARGEST_SHARE * known, LEFT_OUT, KEPT)
    cols, rows = np.rint(px).astype(int).T
    return np.where(labels == UNKNOWN, UNKNOWN, label)[rows, cols].astype(np.int8)


def raster_labels(source: RasterSource, left_out: Sequence[str]) -> RasterLabels:
    """Return the labels of a raster.

    Raises
    ------
    ParameterError
        The values to be left out are no numbers.
    """
    for text in left_out:
        if _number(text) is None:
            raise ParameterError(f"left_out must be numbers for a raster, not {text!r}")
    return RasterLabels(source, frozenset(left_out))


def layer_labels(
    path: str | os.PathLike[str], field: str, left_out: Sequence[str], grid: Grid
) -> LayerLabels:
    """Read the labels of a layer's points and polygons.

    Parameters
    ----------
    path
        Any vector file that fiona reads; its first layer is used.
    field
        Name of the attribute with the class.
    left_out
        Values of the attribute that are to be left out; all others are kept.
    grid
        Grid of the image.

    Raises
    ------
    VectorLayerError
        The layer cannot be read, has no such attribute, or neither points nor polygons.
    GeoreferencingError
        Only one of layer and image has a CRS.
    """
    layer = read_vector_layer(path).on_map(grid)
    if field not in layer.fields:
        names = ", ".join(layer.fields) or "none"
        raise VectorLayerError(f"{path} has no attribute {field!r}; it has: {names}")
    areas, xy, labels = [], [], []
    for feature in layer.features:
        geometry, value = feature["geometry"], feature["properties"].get(field)
        if value is None:
            continue
        label = LEFT_OUT if _is_one_of(value, left_out) else KEPT
        if geometry["type"] in AREAS:
            areas.append((geometry, label))
        elif geometry["type"] in ("Point", "MultiPoint"):
            each = np.atleast_2d(geometry["coordinates"])[:, :2]
            xy.extend(each.tolist())
            labels.extend([label] * len(each))
    if not areas and not xy:
        raise VectorLayerError(f"{path} has neither points nor polygons with a class at the image")
    return LayerLabels(tuple(areas), np.array(xy).reshape(-1, 2), np.array(labels, np.int8))


def _is_one_of(value: Any, texts: Sequence[str]) -> bool:
    """Whether a value is one of the texts; numbers of a layer are compared as numbers (1 = 1.0)."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return str(value) in texts
    return any(value == _number(text) for text in texts)


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def labelled_points(
    image: Image,
    labels: LabelSource,
    detector: Detecting,
    statistics: str,
    context: Context,
) -> Training:
    """Return an image's labelled keypoints, and labelled points, with statistics of their patches.

    Parameters
    ----------
    image
        The image; it is read in tiles.
    labels
        Source of the labels.
    detector
        Detector of the keypoints.
    statistics
        One of `patch_statistics.STATISTICS`.
    context
        Threads in which tiles are processed.
    """
    grid = image.source.grid
    looked_at = len(image.source.image_bands) if statistics == BAND_RATIOS else 0

    def look(tile: Window) -> Training:
        piece = grid.window(*tile.widened(MARGIN_PX))
        core = Window(MARGIN_PX, MARGIN_PX, tile.width, tile.height)
        patch = image.read_onto(piece, grid.map_to_pixel)
        found = detector.detect(patch)
        px = found.take(inside(found.position_px, core)).position_px
        label = patch_labels(labels.label(piece), px)
        own, own_label = labels.points(piece)
        within = inside(own, core)
        px, label = np.vstack([px, own[within]]), np.concatenate([label, own_label[within]])
        px, label = px[label != UNKNOWN], label[label != UNKNOWN]
        bands = image.bands_onto(piece, grid.map_to_pixel) if looked_at else NO_BANDS
        values = patch_statistics(statistics, patch, px, bands)
        return Training(values, label == KEPT, px + np.subtract(tile[:2], MARGIN_PX), looked_at)

    return Training.concatenate(list(context.map(look, list(tiles(grid, TILE_PX)))))
