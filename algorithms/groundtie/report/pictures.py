"""The pictures of a report as data URIs: overviews of the images, and similarity surfaces."""

from __future__ import annotations

import base64

import cv2
import numpy as np
from numpy.typing import NDArray

from ..rasters.grid import FloatArray, Grid, PointFunction, mesh
from ..rasters.patch import Patch
from ..similarity.surface import Surface

Picture = NDArray[np.uint8]

# Longer side of the overviews, and of the faint one under the residuals.
OVERVIEW_PX = 800
BACKDROP_PX = 600

# Three overviews and a backdrop of this size in base64, and some figures, stay below 2 MB.
LARGEST_JPEG_BYTES = 330_000

_JPEG_QUALITIES = (85, 75, 60, 45, 30, 15)

# Grey of pixels without data, and contrast of a backdrop: both chosen by eye.
_NO_DATA_GREY = 226
_BACKDROP_STRENGTH = 0.4

# Tint of masked pixels: reddish purple [Okabe2008].
_TINT_BGRA = (167, 121, 204, 77)

# Nodes a side of the lattice that replaces a transform in an overview.
_NODES = 33


def overview_grid(grid: Grid, longest_px: int = OVERVIEW_PX) -> Grid:
    """Return a grid with larger pixels, if needed, so that no side is longer than this."""
    factor = max(grid.size) / longest_px
    return grid.scaled(factor) if factor > 1 else grid


def overview_positions(to_input_px: PointFunction, grid: Grid) -> PointFunction:
    """Return a fast approximation of a transform, good to a fraction of an overview's pixel.

    A spline with hundreds of knots would take longer than all the rest of the report. Where there
    is no approximation, as at the seam of an input of the whole Earth, it is the transform itself.
    """
    from scipy.interpolate import RectBivariateSpline

    cols, rows = (np.linspace(-0.5, side - 0.5, _NODES) for side in grid.size)
    nodes = mesh(cols, rows)
    px = to_input_px(grid.pixel_to_map(nodes))
    if not np.isfinite(px).all():
        return to_input_px
    splines = [RectBivariateSpline(rows, cols, axis.reshape(_NODES, _NODES), s=0) for axis in px.T]

    def positions(xy: FloatArray) -> FloatArray:
        at = grid.map_to_pixel(xy)
        return np.column_stack([spline.ev(at[:, 1], at[:, 0]) for spline in splines])

    between = [(nodes[1:] + nodes[:-1]) / 2 for nodes in (cols, rows)]
    middles = grid.pixel_to_map(mesh(*between))
    off_px = np.hypot(*(positions(middles) - to_input_px(middles)).T)
    pixel = np.median(np.hypot(*(px[1:] - px[:-1]).T)) / (cols[1] - cols[0])
    return positions if (off_px <= pixel).all() else to_input_px


def grey_picture(patch: Patch) -> Picture:
    """Stretch the grey values between the 2nd and 98th percentile; no data becomes light grey."""
    picture = np.full(patch.values.shape, _NO_DATA_GREY, np.uint8)
    values = patch.values[patch.valid]
    if values.size:
        low, high = np.percentile(values, (2, 98))
        if low == high:
            low, high = low - 0.5, high + 0.5
        picture[patch.valid] = np.clip((values - low) / (high - low) * 255, 0, 255)
    return picture


def tint_uri(masked: NDArray[np.bool_]) -> str:
    """Return a tint of masked pixels, transparent elsewhere, as the data URI of a PNG."""
    picture = np.zeros((*masked.shape, 4), np.uint8)
    picture[masked] = _TINT_BGRA
    return png_uri(picture)


def backdrop(picture: Picture) -> Picture:
    """Return a picture small and faint enough to draw on."""
    factor = min(BACKDROP_PX / max(picture.shape), 1.0)
    size = [max(round(side * factor), 1) for side in picture.shape[::-1]]
    small = cv2.resize(picture, size, interpolation=cv2.INTER_AREA)
    return np.asarray(255 - (255 - small.astype(np.float32)) * _BACKDROP_STRENGTH, np.uint8)


def jpeg_uri(picture: Picture) -> str:
    """Return a picture as a data URI, in the best quality within `LARGEST_JPEG_BYTES`."""
    for quality in _JPEG_QUALITIES:
        data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, quality])[1].tobytes()
        if len(data) <= LARGEST_JPEG_BYTES:
            break
    return data_uri("image/jpeg", data)


def surface_uri(surface: Surface) -> str:
    """Return a similarity surface as the data URI of a PNG, one pixel a shift."""
    low, high = float(surface.min()), float(surface.max())
    levels = ((surface - low) / max(high - low, 1e-9) * 255).astype(np.uint8)
    colours = cv2.applyColorMap(levels, cv2.COLORMAP_VIRIDIS)
    return png_uri(np.asarray(colours, np.uint8))


def png_uri(picture: Picture) -> str:
    """Return a picture, grey, BGR or BGRA, as the data URI of a PNG."""
    return data_uri("image/png", cv2.imencode(".png", picture)[1].tobytes())


def data_uri(kind: str, data: bytes) -> str:
    """Return a URI that holds the data."""
    return f"data:{kind};base64,{base64.b64encode(data).decode('ascii')}"
