"""Values of an image at any positions, with invalid pixels carrying no weight."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from .grid import Grid
from .kernels import REACH, interpolate
from .reading import FloatImage, Mask, RasterSource, Window, working_dtype

FloatArray = NDArray[np.float64]
ToInputPx = Callable[[FloatArray], FloatArray]

METHODS = tuple(REACH)

# Interpolating between the nodes of the lattice may be wrong by this much.
_TOLERANCE_PX = 0.01
_FIRST_STEP = 64

# Positions nearer than this to pixels lie on them: map coordinates have no more digits.
_ON_PIXELS = 1e-6

# Stands for positions that are not finite: outside of every image.
_NOWHERE = -1e9


@runtime_checkable
class DenseMap(Protocol):
    """A map from a grid to input pixels that knows best how to find them for all of its pixels.

    It need not be smooth: terrain, for one, may have steps anywhere.
    """

    def __call__(self, xy: FloatArray) -> FloatArray:
        """Return the input pixels (col, row), shape (n, 2), at map positions (n, 2)."""

    def coordinates(self, grid: Grid) -> FloatArray:
        """Return the input column and row of every pixel of a grid, shape (2, height, width)."""


@dataclass(frozen=True)
class Lattice:
    """Input positions at the nodes of a lattice in a grid, dense enough to interpolate between.

    Parameters
    ----------
    rows, cols
        Rows and columns of the grid where the nodes are, rising, from first to last.
    px
        Input columns and rows at the nodes, shape (2, rows, cols).
    """

    rows: NDArray[np.int_]
    cols: NDArray[np.int_]
    px: FloatArray

    def at(self, rows: NDArray[np.int_], cols: NDArray[np.int_]) -> FloatArray:
        """Return the input positions, shape (2, rows, cols), at other rows and columns."""
        return _between(_between(self.px, self.rows, rows, 1), self.cols, cols, 2)

    def lies_within(self, width: int, height: int) -> bool:
        """Tell whether all positions, also between nodes, lie on pixels of an image."""
        size = np.array([width, height])[:, None, None]
        return bool(np.all((self.px > -0.49) & (self.px < size - 0.51)))


def lattice(grid: Grid, to_input_px: ToInputPx) -> Lattice:
    """Evaluate a map at a lattice of pixels, halving its step until interpolation is exact enough.

    Parameters
    ----------
    grid
        The pixels in question.
    to_input_px
        Takes map positions of the grid, shape (n, 2), to input pixels (col, row), shape (n, 2).
    """
    step = min(_FIRST_STEP, 1 << max(grid.width, grid.height).bit_length())
    coarse = _evaluate(grid, to_input_px, step)
    while step > 1:
        step //= 2
        fine = _evaluate(grid, to_input_px, step)
        if not np.isfinite(fine.px).all():
            fine = _evaluate(grid, to_input_px, 1)
            return Lattice(fine.rows, fine.cols, np.where(np.isfinite(fine.px), fine.px, _NOWHERE))
        error = np.abs(coarse.at(fine.rows, fine.cols) - fine.px).max()
        if error < _TOLERANCE_PX:
            return fine
        coarse = fine
    return coarse


def coordinates(grid: Grid, to_input_px: ToInputPx) -> FloatArray:
    """Return the input column and row of every pixel of a grid, shape (2, height, width).

    Good to 0.01 px; positions that are not finite become far outside. Parameters as `lattice`.
    """
    if isinstance(to_input_px, DenseMap):
        return to_input_px.coordinates(grid)
    nodes = lattice(grid, to_input_px)
    rows, cols = np.arange(grid.height), np.arange(grid.width)
    if len(nodes.rows) == grid.height and len(nodes.cols) == grid.width:
        return nodes.px
    return nodes.at(rows, cols)


def resample(
    image: NDArray[Any],
    valid: Mask,
    px: ArrayLike,
    method: str,
    dtype: np.dtype[Any] | None = None,
) -> tuple[NDArray[Any], Mask]:
    """Interpolate an image at given positions.

    A result is valid if the pixel nearest to it is. Where the kernel of `cubic` or `lanczos`
    would touch invalid pixels, the valid ones are interpolated bilinearly instead, so that
    nodata never bleeds.

    Parameters
    ----------
    image
        Shape (h, w), any dtype; finite everywhere.
    valid
        Shape (h, w).
    px
        Columns and rows of the positions, shape (2, m, n).
    method
        One of `METHODS`.
    dtype
        Of the result; by default the image's.

    Returns
    -------
    values
        Shape (m, n), rounded and clipped for integers; 0 where invalid.
    valid
        Shape (m, n).
    """
    px = np.asarray(px)
    dtype = image.dtype if dtype is None else dtype
    if np.abs(px - np.rint(px)).max(initial=0) < _ON_PIXELS:
        method = "nearest"  # every kernel gives the pixel itself
    if method != "nearest" and valid.all() and _touches_no_border(px, image.shape, method):
        values = interpolate(image.astype(working_dtype(image.dtype), copy=False), px, method)
        return _rounded(values, dtype), np.ones(values.shape, bool)
    cols, rows = np.rint(px[0]).astype(np.int64), np.rint(px[1]).astype(np.int64)
    inside = (cols >= 0) & (rows >= 0) & (cols < image.shape[1]) & (rows < image.shape[0])
    cols[~inside], rows[~inside] = 0, 0
    known = inside & valid[rows, cols]
    if method == "nearest":
        return _rounded(np.where(known, image[rows, cols], image.dtype.type(0)), dtype), known
    whole = cv2.erode(
        valid.astype(np.uint8),
        np.ones((2 * REACH[method] + 1,) * 2, np.uint8),
        borderType=cv2.BORDER_CONSTANT,
        borderValue=0,
    )
    partly = known & (whole[rows, cols] == 0)
    filled = np.where(valid, image, image.dtype.type(0)).astype(working_dtype(image.dtype))
    values = interpolate(filled, px, method)
    if partly.any():
        weight = interpolate(valid.astype(filled.real.dtype), px, "bilinear")
        bilinear = interpolate(filled, px, "bilinear")
        values[partly] = bilinear[partly] / weight[partly]
    values[~known] = 0
    return _rounded(values, dtype), known


def reduction(grid: Grid, to_input_px: ToInputPx) -> tuple[int, int]:
    """Return how many input columns and rows a pixel at the grid's centre spans, rounded, >= 1."""
    col, row = grid.centre_px
    around = [[col - 0.5, row], [col + 0.5, row], [col, row - 0.5], [col, row + 0.5]]
    left, right, above, below = to_input_px(grid.pixel_to_map(around))
    if not np.isfinite([left, right, above, below]).all():
        return 1, 1
    span = np.hypot(right - left, below - above)
    return max(round(float(span[0])), 1), max(round(float(span[1])), 1)


def source_window(
    px: FloatArray, size: tuple[int, int], method: str, factor: tuple[int, int] = (1, 1)
) -> Window:
    """Return the part of an image, (width, height) in size, that positions need.

    Parameters
    ----------
    px
        Columns and rows of the positions, shape (2, m, n).
    size
        Width and height of the image.
    method
        One of `METHODS`.
    factor
        Columns and rows that are averaged before: the window starts and ends at their multiples.
        Its borders may lie outside of the image by the kernel's reach; it may be empty.
    """
    bounds = []
    for axis in (0, 1):
        margin = (REACH[method] + 1) * factor[axis]
        low = max(float(px[axis].min()) - margin, -margin)
        high = min(float(px[axis].max()) + margin, size[axis] + margin)
        first = int(np.floor(low / factor[axis])) * factor[axis]
        stop = int(np.ceil((high + 1) / factor[axis])) * factor[axis]
        bounds.append((first, max(stop - first, 0)))
    return Window(bounds[0][0], bounds[1][0], bounds[0][1], bounds[1][1])


def sample(
    source: RasterSource,
    grid: Grid,
    to_input_px: ToInputPx,
    method: str = "cubic",
    band: int | None = None,
) -> tuple[FloatImage, Mask]:
    """Resample one window of a raster, as one grey image, onto a grid that fits into memory.

    Where the grid's pixels are larger than 1.5 input pixels, the mean over the area of so many
    input pixels is taken first (not with `nearest`).

    Parameters
    ----------
    source, band
        The raster and its band, from 1; None takes the mean of all bands but alpha.
    grid, to_input_px
        As in `lattice`.
    method
        One of `METHODS`.

    Returns
    -------
    values, valid
        Shape (height, width) of the grid; float32, 0 where invalid, and bool.
    """
    px = coordinates(grid, to_input_px)
    factor = (1, 1) if method == "nearest" else reduction(grid, to_input_px)
    window = source_window(px, (source.grid.width, source.grid.height), method, factor)
    if not window.width or not window.height:
        shape = (grid.height, grid.width)
        return np.zeros(shape, np.float32), np.zeros(shape, bool)
    image, valid = source.read(window, band, reduced_shape(window, factor))
    return resample(image, valid, inside_window(px, window, factor), method)


def reduced_shape(window: Window, factor: tuple[int, int]) -> tuple[int, int] | None:
    """Return the shape of a window whose pixels are averaged by `factor`; None if they are not."""
    return None if factor == (1, 1) else (window.height // factor[1], window.width // factor[0])


def inside_window(px: FloatArray, window: Window, factor: tuple[int, int]) -> FloatArray:
    """Return positions, shape (2, m, n), in the pixels of a window averaged by `factor`."""
    corner = np.array([window.col, window.row])[:, None, None]
    step = np.array(factor)[:, None, None]
    return np.asarray((px - corner + 0.5) / step - 0.5)


def _evaluate(grid: Grid, to_input_px: ToInputPx, step: int) -> Lattice:
    rows, cols = (
        np.unique(np.append(np.arange(0, size, step), size - 1))
        for size in (grid.height, grid.width)
    )
    nodes = np.stack(np.meshgrid(cols, rows), axis=-1).reshape(-1, 2)
    px = np.asarray(to_input_px(grid.pixel_to_map(nodes)), float)
    return Lattice(rows, cols, px.T.reshape(2, len(rows), len(cols)))


def _between(
    values: FloatArray, nodes: NDArray[np.int_], places: NDArray[np.int_], axis: int
) -> FloatArray:
    """Interpolate linearly along an axis, from values at rising nodes to those at places."""
    if len(nodes) == 1:
        return np.repeat(values, len(places), axis)
    left = np.clip(np.searchsorted(nodes, places, side="right") - 1, 0, len(nodes) - 2)
    share = (places - nodes[left]) / (nodes[left + 1] - nodes[left])
    low, high = values.take(left, axis), values.take(left + 1, axis)
    return np.asarray(
        low + np.expand_dims(share, tuple(range(1, values.ndim - axis))) * (high - low)
    )


def _touches_no_border(px: FloatArray, shape: tuple[int, ...], method: str) -> bool:
    reach = REACH[method]
    last = np.array(shape[::-1])[:, None, None] - 1
    return bool(np.all((px >= reach) & (px <= last - reach)))


def _rounded(values: NDArray[Any], dtype: np.dtype[Any]) -> NDArray[Any]:
    if dtype.kind in "fc" or values.dtype == dtype:
        return values.astype(dtype, copy=False)
    limits = np.iinfo(dtype)
    return np.clip(np.rint(values), limits.min, limits.max).astype(dtype)
