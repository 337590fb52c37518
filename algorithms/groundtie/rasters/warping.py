"""Resampling of images at any positions, in which invalid pixels carry no weight."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from .grid import FloatArray, Grid, PointFunction, mesh
from .kernels import REACH, interpolate
from .lattice import ON_PIXELS, DenseMap, lattice, row_strips
from .metadata import rounded, working_dtype
from .reading import FloatImage, RasterSource
from .windows import Mask, Window

METHODS = tuple(REACH)

# In windows with fewer pixels a side, single precision holds multiples of 1/8192 exactly. Adding
# this number in double precision rounds to such multiples.
_SINGLE_PX = 2000
_ROUNDING = 1.5 * 2.0**39

# Pixels along each side of a grid at which an input is looked for, until one shows it: a million
# positions take 0.1 s.
_SEEN_AT = (1, 32, 1024)

# Reads values and validity, ([bands,] h, w), of a window, averaged to a shape if one is given.
Read = Callable[[Window, tuple[int, int] | None], tuple[NDArray[Any], Mask]]


def resample(
    image: NDArray[Any],
    valid: Mask,
    px: ArrayLike,
    method: str,
    dtype: np.dtype[Any] | None = None,
) -> tuple[NDArray[Any], Mask]:
    """Interpolate an image at given positions.

    A result is valid if the nearest pixel is. Where the kernel of `cubic` or `lanczos` would touch
    invalid pixels, the valid ones are interpolated bilinearly instead, so that nodata never bleeds.

    Parameters
    ----------
    image
        Shape (h, w) or (bands, h, w), any dtype; finite everywhere.
    valid
        The image's shape, or (h, w) if all bands are valid at the same pixels.
    px
        Columns and rows of the positions, shape (2, m, n).
    method
        One of `METHODS`.
    dtype
        Type of the result; by default the image's.

    Returns
    -------
    values
        Shape (m, n) or (bands, m, n), rounded and clipped for integers; 0 where invalid.
    valid
        Shape (m, n) or (bands, m, n), with bands if the argument `valid` has bands.
    """
    px = np.asarray(px)
    dtype = image.dtype if dtype is None else dtype
    # Mostly, the first row suffices to show that positions do not lie on pixels.
    if _on_pixels(px[:, :1]) and _on_pixels(px):
        method = "nearest"  # every kernel returns the pixel itself
    if valid.ndim == 2:
        return _resample(image, valid, px, method, dtype)
    if bool((valid == valid[:1]).all()):
        values, known = _resample(image, valid[0], px, method, dtype)
        return values, np.repeat(known[None], len(image), axis=0)
    bands = [_resample(*band, px, method, dtype) for band in zip(image, valid, strict=True)]
    return np.stack([values for values, _ in bands]), np.stack([known for _, known in bands])


def _resample(
    image: NDArray[Any], valid: Mask, px: NDArray[Any], method: str, dtype: np.dtype[Any]
) -> tuple[NDArray[Any], Mask]:
    """Return `resample` of an image whose bands are valid at the same pixels."""
    if method != "nearest" and valid.all() and are_inside(px, valid.shape, REACH[method]):
        values = interpolate(image.astype(working_dtype(image.dtype), copy=False), px, method)
        return rounded(values, dtype), np.ones(px.shape[1:], bool)
    nearest = _nearest_pixels(px)
    known, whole = _validity(valid, nearest, REACH[method])
    if method == "nearest":
        cols, rows = np.where(known, nearest, 0).astype(np.intp)
        values = np.where(known, image[..., rows, cols], image.dtype.type(0))
        return rounded(values, dtype), known
    filled = np.where(valid, image, image.dtype.type(0))
    filled = filled.astype(working_dtype(image.dtype), copy=False)
    values = interpolate(filled, px, method)
    partly = known & ~whole
    if partly.any():
        there = px[:, None, partly]
        weight = interpolate(valid.astype(filled.real.dtype), there, "bilinear")
        values[..., partly] = (interpolate(filled, there, "bilinear") / weight)[..., 0, :]
    values[..., ~known] = 0
    return rounded(values, dtype), known


def _nearest_pixels(px: NDArray[Any]) -> NDArray[Any]:
    """Return the columns or rows of the pixels nearest to positions, as floating-point numbers.

    Halfway between two pixels, the one with the larger index is taken, as in GDAL: rounding to even
    would lose every second pixel of an image shifted by half a pixel. Positions a rounding error
    below halfway count as halfway.
    """
    return np.floor(px + (0.5 + ON_PIXELS))


def _validity(valid: Mask, nearest: NDArray[Any], reach: int) -> tuple[Mask, Mask]:
    """Return which pixels at `nearest` are valid, and which have only valid pixels in reach."""
    height, width = valid.shape
    inside = lies_inside(nearest, width, height, 0)
    if valid.all():
        return inside, lies_inside(nearest, width, height, reach)
    cols, rows = np.where(inside, nearest, 0).astype(np.intp)
    side = np.ones((2 * reach + 1,) * 2, np.uint8)
    whole = cv2.erode(valid.astype(np.uint8), side, borderType=cv2.BORDER_CONSTANT, borderValue=0)
    return inside & valid[rows, cols], inside & (whole[rows, cols] != 0)


def lies_inside(px: NDArray[Any], width: int, height: int, margin: float) -> Mask:
    """Return which positions, (2, m, n), lie in an image, `margin` within its outer centres."""
    cols, rows = px
    inside: Mask = (cols >= margin) & (cols <= width - 1 - margin)
    return inside & (rows >= margin) & (rows <= height - 1 - margin)


def are_inside(px: NDArray[Any], shape: tuple[int, ...], margin: int) -> bool:
    """Return whether there are positions, (2, m, n), and all lie inside an image of (h, w)."""
    return all(
        axis.size and axis.min() >= margin and axis.max() <= side - 1 - margin
        for axis, side in zip(px, shape[::-1], strict=True)
    )


def reduction(grid: Grid, to_input_px: PointFunction, size: tuple[int, int]) -> tuple[int, int]:
    """Return how many input columns and rows a pixel of a grid spans, rounded, >= 1.

    It is the pixel at the grid's centre, unless the input, of width and height `size`, is seen at
    others only. The result is no more than that size.
    """
    col, row = _seen_pixel(grid, to_input_px, size)
    span = _span(grid, to_input_px, col, row)
    if not np.isfinite(span).all():
        return 1, 1
    if span[0] > size[0] / 2:
        # A global input may wrap around at this pixel, but not at the neighbouring one, too.
        span = np.fmin(span, _span(grid, to_input_px, col - 1, row))
    cols, rows = (
        max(round(min(float(length), most)), 1) for length, most in zip(span, size, strict=True)
    )
    return cols, rows


def _seen_pixel(
    grid: Grid, to_input_px: PointFunction, size: tuple[int, int]
) -> tuple[float, float]:
    """Return the position of a pixel at which a grid shows an input; its centre if none is found.

    Of the pixels that are found it is the one in their middle.
    """
    for count in _SEEN_AT:
        shares = (np.arange(count) + 0.5) / count
        places = mesh(*(shares * side - 0.5 for side in grid.size))
        with np.errstate(invalid="ignore"):
            inside = lies_inside(to_input_px(grid.pixel_to_map(places)).T, *size, -0.5)
        if inside.any():
            seen = places[inside]
            off = seen - seen.mean(axis=0)
            col, row = seen[(off**2).sum(axis=1).argmin()]
            return float(col), float(row)
    return grid.centre_px


def _span(grid: Grid, to_input_px: PointFunction, col: float, row: float) -> FloatArray:
    """Return how many input columns and rows a pixel spans, (2,); not finite if unknown."""
    around = [[col - 0.5, row], [col + 0.5, row], [col, row - 0.5], [col, row + 0.5]]
    left, right, above, below = to_input_px(grid.pixel_to_map(around))
    with np.errstate(invalid="ignore"):  # positions outside of a projection's domain
        return np.asarray(np.hypot(right - left, below - above))


def source_window(
    px: FloatArray, size: tuple[int, int], method: str, factor: tuple[int, int] = (1, 1)
) -> Window:
    """Return the window of an image that is needed to interpolate at positions.

    Parameters
    ----------
    px
        Columns and rows of the positions, shape (2, m, n).
    size
        Width and height of the image.
    method
        One of `METHODS`.
    factor
        Columns and rows averaged beforehand: the window starts and ends at multiples of them. It
        may extend beyond the image by the kernel's reach, and may be empty.
    """
    margins = [(REACH[method] + 1) * step for step in factor]
    seen = px.reshape(2, -1)
    if not are_inside(px, size[::-1], 0):
        # Positions beyond the image, among them unknown ones, need none of its pixels.
        seen = seen[:, _are_near(seen, size, margins)]
        if not seen.size:
            return Window(0, 0, 0, 0)
    bounds = []
    for axis, margin, side, step in zip(seen, margins, size, factor, strict=True):
        low = max(float(axis.min()) - margin, -margin)
        high = min(float(axis.max()) + margin, side + margin)
        first = int(np.floor(low / step)) * step
        stop = int(np.ceil((high + 1) / step)) * step
        bounds.append((first, max(stop - first, 0)))
    return Window(bounds[0][0], bounds[1][0], bounds[0][1], bounds[1][1])


def _are_near(px: FloatArray, size: tuple[int, int], margins: Sequence[int]) -> Mask:
    """Return which positions, (2, n), lie in an image, or within margins around it."""
    near = np.ones(px.shape[1], bool)
    for axis, side, margin in zip(px, size, margins, strict=True):
        near &= (axis >= -margin) & (axis <= side - 1 + margin)
    return near


def sample(
    source: RasterSource,
    grid: Grid,
    to_input_px: PointFunction,
    method: str = "cubic",
    band: int | None = None,
) -> tuple[FloatImage, Mask]:
    """Resample one window of a raster, as one grey image, onto a grid that fits into memory.

    If the grid's pixels are larger than 1.5 input pixels, the input is first averaged over a whole
    number of pixels (not with `nearest`).

    Parameters
    ----------
    source, band
        The raster and its band, from 1; None takes the mean of all bands but alpha.
    grid, to_input_px
        As in `lattice.coordinates`.
    method
        One of `METHODS`.

    Returns
    -------
    values, valid
        Shape (height, width) of the grid; float32, 0 where invalid, and bool.
    """
    return sample_by(
        source, grid, to_input_px, method, lambda part, out: source.read(part, band, out)
    )


def sample_bands(
    source: RasterSource,
    grid: Grid,
    to_input_px: PointFunction,
    of_bands: Callable[[FloatImage], FloatImage] = lambda bands: bands,
) -> tuple[FloatImage, Mask]:
    """Resample all bands but alpha by "cubic", as `sample`; pixels must be valid in all bands.

    Parameters
    ----------
    source, grid, to_input_px
        As in `sample`.
    of_bands
        What is resampled in place of the bands, (bands, h, w): a function of them, pixel by pixel.

    Returns
    -------
    values, valid
        Shape (bands, height, width), float32, and (height, width).
    """

    def read(part: Window, out_shape: tuple[int, int] | None) -> tuple[FloatImage, Mask]:
        values, valid = source.read_bands(part, source.image_bands, out_shape)
        everywhere: Mask = np.asarray(valid.all(axis=0))
        values = np.abs(values) if source.is_complex else values
        known = np.where(everywhere, values, 0).astype(np.float32, copy=False)
        return of_bands(known), everywhere

    return sample_by(source, grid, to_input_px, "cubic", read)


def sample_by(
    source: RasterSource,
    grid: Grid,
    to_input_px: PointFunction,
    method: str,
    read: Read,
    factor: tuple[int, int] | None = None,
) -> tuple[FloatImage, Mask]:
    """Return `sample` of the images that `read` reads, shape ([bands,] height, width).

    Means over the columns and rows of `factor` are taken first; None: as in `sample`.
    """
    if isinstance(to_input_px, DenseMap):
        px = to_input_px.coordinates(grid)
    else:
        nodes = lattice(grid, to_input_px)
        window = nodes.window()
        if window is not None:  # every kernel returns the pixels themselves
            return read(window, None)
        px = nodes.coordinates()
    size = source.grid.size
    if not lies_inside(_nearest_pixels(px), *size, 0).any():
        nothing, shape = read(Window(0, 0, 0, 0), None)[0], (grid.height, grid.width)
        return np.zeros((*nothing.shape[:-2], *shape), np.float32), np.zeros(shape, bool)
    if factor is None:
        factor = (1, 1) if method == "nearest" else reduction(grid, to_input_px, size)
    part = read_around(px, size, method, factor, read)
    assert part is not None  # some of the positions lie inside
    return resample(*part, method)


def read_around(
    px: FloatArray, size: tuple[int, int], method: str, factor: tuple[int, int], read: Read
) -> tuple[NDArray[Any], Mask, NDArray[Any]] | None:
    """Read the window of an image needed for positions, averaged by `factor`; None if it is empty.

    Parameters
    ----------
    px, size, method, factor
        As `source_window`.
    read
        Reads a window, averaged to a shape if one is given: values and validity.

    Returns
    -------
    image, valid, px
        Arguments of `resample`: `px` are the positions in the image that was read.
    """
    window = source_window(px, size, method, factor)
    if not window.width or not window.height:
        return None
    reduced = None if factor == (1, 1) else (window.height // factor[1], window.width // factor[0])
    image, valid = read(window, reduced)
    return image, valid, _inside_window(px, window, factor)


def _inside_window(px: FloatArray, window: Window, factor: tuple[int, int]) -> NDArray[Any]:
    """Return positions, shape (2, m, n), in the pixels of a window averaged by `factor`.

    In windows that are not too large they are rounded to 1/8192 pixel. Single precision holds these
    exactly, and the same place has the same position in every window.
    """
    single = max(window.width / factor[0], window.height / factor[1]) < _SINGLE_PX
    inside = np.empty(px.shape, np.float32 if single else np.float64)
    corner = (window.col, window.row)
    for rows in row_strips(*px.shape[1:]):
        for axis, out, first, step in zip(px, inside, corner, factor, strict=True):
            local = axis[rows] - (first + (step - 1) / 2)
            if step > 1:
                local /= step
            if single:
                local += _ROUNDING
                local -= _ROUNDING
            out[rows] = local
    return inside


def _on_pixels(px: NDArray[Any]) -> bool:
    return bool(np.abs(px - np.rint(px)).max(initial=0) < ON_PIXELS)
