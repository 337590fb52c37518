"""Means over the area of larger pixels, in which invalid pixels carry no weight."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

# A larger pixel is valid if at least this share of its area is.
MIN_VALID_SHARE = 0.5

# Pixels that are held at a time.
_STRIP_PIXELS = 4_000_000

Lines = Callable[[int, int], tuple[NDArray[Any], NDArray[np.bool_]]]


def overlaps(edges: NDArray[np.float64], count: int, dtype: Any = np.float32) -> sparse.csr_matrix:
    """Return how much of each of `count` pixels lies in each interval.

    Parameters
    ----------
    edges
        Borders of the n intervals, rising, shape (n + 1,); pixel i reaches from i to i + 1.
    count
        Number of pixels in the row or column.
    dtype
        Of the result.

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
    valid: NDArray[np.bool_],
    row_edges: NDArray[np.float64],
    col_edges: NDArray[np.float64],
) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Average the valid pixels over the rectangles between row and column edges.

    Parameters
    ----------
    values
        Floating-point or complex image, shape (h, w); invalid pixels hold anything finite.
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
        total = _sum(down, across, values)
        weight = np.outer(down.sum(axis=1).A1, across.sum(axis=1).A1)
    else:
        total = _sum(down, across, np.where(valid, values, values.dtype.type(0)))
        weight = _sum(down, across, valid.astype(precision))
    area = np.outer(np.diff(row_edges), np.diff(col_edges))
    enough = weight >= MIN_VALID_SHARE * area - 1e-6 * area
    means = np.divide(total, weight, out=np.zeros_like(total), where=enough)
    return means.astype(values.dtype, copy=False), enough


def average_by_strips(
    read_lines: Lines, row_edges: NDArray[np.float64], col_edges: NDArray[np.float64]
) -> tuple[NDArray[Any], NDArray[np.bool_]]:
    """Average an image to a smaller size without ever holding all of it.

    Parameters
    ----------
    read_lines
        Returns values and validity, shapes (bands, lines, width), of some lines, given the first
        and their number.
    row_edges, col_edges
        Borders of the m × n larger pixels, rising, shapes (m + 1,) and (n + 1,).

    Returns
    -------
    means, valid
        Shapes (bands, m, n), as `area_average`.
    """
    count = len(row_edges) - 1
    lines = max(int(_STRIP_PIXELS / col_edges[-1] * count / row_edges[-1]), 1)
    strips = []
    for first in range(0, count, lines):
        edges = row_edges[first : first + lines + 1]
        top, bottom = int(np.floor(edges[0])), int(np.ceil(edges[-1]))
        values, valid = read_lines(top, bottom - top)
        pairs = zip(values, valid, strict=True)
        strips.append([area_average(v, ok, edges - top, col_edges) for v, ok in pairs])
    bands = [zip(*band, strict=True) for band in zip(*strips, strict=True)]
    images = [(np.concatenate(v), np.concatenate(ok)) for v, ok in bands]
    return np.stack([v for v, _ in images]), np.stack([ok for _, ok in images])


def _sum(down: sparse.csr_matrix, across: sparse.csr_matrix, values: NDArray[Any]) -> NDArray[Any]:
    # Rows first: that runs along contiguous memory and leaves little for the second product.
    lines = down @ values
    return np.asarray((across @ np.ascontiguousarray(lines.T)).T)
