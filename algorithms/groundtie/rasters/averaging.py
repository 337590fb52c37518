"""Means over the areas of larger pixels, in which invalid pixels carry no weight."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from .metadata import working_dtype
from .windows import Mask, Window

if TYPE_CHECKING:
    from .reading import RasterSource

Read = Callable[["RasterSource", Window], tuple[NDArray[Any], Mask]]

# A larger pixel is valid if at least this share of its area is.
MIN_VALID_SHARE = 0.5

# Pixels held at a time: many blocks of a file, as blocks at the border are read twice.
HELD_PIXELS = 2048**2


def overlaps(edges: NDArray[np.float64], count: int, dtype: Any) -> sparse.csr_matrix:
    """Return the share of each of `count` pixels that lies in each interval.

    Parameters
    ----------
    edges
        Borders of the n intervals, rising, shape (n + 1,); pixel i extends from i to i + 1.
    count
        Number of pixels in the row or column.
    dtype
        Type of the result.

    Returns
    -------
    sparse matrix, shape (n, count)
        Lengths between 0 and 1.
    """
    intervals = len(edges) - 1
    first = np.clip(np.floor(edges[:-1]).astype(int), 0, count)
    stop = np.clip(np.ceil(edges[1:]).astype(int), 0, count)
    indptr = np.concatenate([[0], np.cumsum(stop - first)])
    owner = np.repeat(np.arange(intervals), stop - first)
    pixel = np.arange(indptr[-1]) - indptr[owner] + first[owner]
    length = np.minimum(edges[owner + 1], pixel + 1) - np.maximum(edges[owner], pixel)
    return sparse.csr_matrix((length.astype(dtype), pixel, indptr), shape=(intervals, count))


def area_average(
    values: NDArray[Any],
    valid: Mask,
    row_edges: NDArray[np.float64],
    col_edges: NDArray[np.float64],
) -> tuple[NDArray[Any], Mask]:
    """Average the valid pixels over the rectangles between row and column edges.

    Parameters
    ----------
    values
        Floating-point or complex image, shape (h, w), finite in invalid pixels, too.
    valid
        Which pixels count, shape (h, w).
    row_edges, col_edges
        Borders of the rectangles in corner-based pixels, shapes (m + 1,) and (n + 1,).

    Returns
    -------
    means
        Shape (m, n), dtype of `values`; 0 where invalid.
    valid
        Shape (m, n); False where less than `MIN_VALID_SHARE` of the area is valid.
    """
    precision = values.real.dtype
    down = overlaps(row_edges, values.shape[0], precision)
    across = overlaps(col_edges, values.shape[1], precision)
    if valid.all():
        total = weighted_sums(down, across, values)
        weight = np.outer(down.sum(axis=1).A1, across.sum(axis=1).A1)
    else:
        total = weighted_sums(down, across, np.where(valid, values, values.dtype.type(0)))
        weight = weighted_sums(down, across, valid.astype(precision))
    area = np.outer(np.diff(row_edges), np.diff(col_edges))
    enough = weight >= MIN_VALID_SHARE * area - 1e-6 * area
    means = np.divide(total, weight, out=np.zeros_like(total), where=enough)
    return means.astype(values.dtype, copy=False), enough


def average_window(
    read: Read, source: RasterSource, level: RasterSource, window: Window, shape: tuple[int, int]
) -> tuple[NDArray[Any], Mask]:
    """Average a window of a raster to a smaller size, without holding all of it in memory.

    Parameters
    ----------
    read
        Returns values and validity of a window of the raster or of a level, ([bands,] h, w).
    source, level
        The raster, and the level of it that is read: the raster itself, or an overview.
    window
        Window in pixels of the raster.
    shape
        Height and width of the result.

    Returns
    -------
    means, valid
        Shapes ([bands,] height, width), as `area_average`.
    """
    top, row_edges = _edges(
        window.row, window.height, shape[0], (source.grid.height, level.grid.height)
    )
    left, col_edges = _edges(
        window.col, window.width, shape[1], (source.grid.width, level.grid.width)
    )
    width = int(np.ceil(col_edges[-1]))
    lines = max(int(HELD_PIXELS / col_edges[-1] * shape[0] / row_edges[-1]), 1)
    strips = []
    for first in range(0, shape[0], lines):
        edges = row_edges[first : first + lines + 1]
        start, stop = int(np.floor(edges[0])), int(np.ceil(edges[-1]))
        values, valid = read(level, Window(left, top + start, width, stop - start))
        values = values.astype(working_dtype(values.dtype), copy=False)
        images, shown = (part.reshape(-1, *part.shape[-2:]) for part in (values, valid))
        pairs = zip(images, shown, strict=True)
        means = [area_average(v, ok, edges - start, col_edges) for v, ok in pairs]
        strips.append([np.stack(part) for part in zip(*means, strict=True)])
    found, known = (np.concatenate(part, axis=1) for part in zip(*strips, strict=True))
    whole = *values.shape[:-2], *shape
    return found.reshape(whole), known.reshape(whole)


def _edges(
    first: int, side: int, count: int, sizes: tuple[int, int]
) -> tuple[int, NDArray[np.float64]]:
    """Return the first pixel of a level that a window needs, and the larger pixels' borders.

    Along one axis, for a window of `side` pixels from `first` on, divided into `count` parts; the
    borders are counted from that first pixel. `sizes` are the raster's and the level's.
    """
    whole, reduced = sizes
    start = int(np.floor(first * reduced / whole))
    edges = np.linspace(0, side, count + 1)
    return start, edges if whole == reduced else (first + edges) * reduced / whole - start


def weighted_sums(
    down: sparse.csr_matrix, across: sparse.csr_matrix, values: NDArray[Any]
) -> NDArray[Any]:
    """Return the sums of an image over rectangles whose sides are given by `overlaps`."""
    # Rows first: this runs along contiguous memory and leaves little for the second product.
    lines = down @ values
    # OpenCV, which lacks complex numbers, transposes images of 2^n columns in a fifth of the time.
    turned = np.ascontiguousarray(lines.T) if np.iscomplexobj(lines) else cv2.transpose(lines)
    return np.asarray((across @ turned).T)
