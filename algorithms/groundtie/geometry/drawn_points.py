"""Tie points as lines on a map: lines that a person moved or drew override the columns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rasterio.crs import CRS

from ..rasters.grid import FloatArray, Grid, near_longitude, reproject
from .point_tables import INPUT, NOMINAL, PIXEL, REFERENCE, Row, columns
from .vector_layers import simple_geometries

# GeoJSON is usually written with 7 decimals of a degree (RFC 7946, section 11.2), and doubles have
# 15 digits: a smaller difference does not mean that a point was moved.
_RELATIVE, _ABSOLUTE = 1e-9, 1e-7


def line_ends(geometries: Sequence[Any]) -> FloatArray:
    """Return the first and the last position of lines, shape (n, 2, 2).

    NaN if there is no line: a missing or empty geometry, or one of another type.

    Parameters
    ----------
    geometries
        Geometries as in GeoJSON, or None.

    Raises
    ------
    TypeError, ValueError
        A line has several parts, or a position lacks two numbers.
    """
    ends = np.full((len(geometries), 2, 2), np.nan)
    for end, geometry in zip(ends, geometries, strict=True):
        parts = [part for one in simple_geometries(geometry) for part in _line_parts(one)]
        if len(parts) > 1:
            raise ValueError("a line has several parts: draw one line for each point")
        for part in parts:
            end[:] = np.array([part[0][:2], part[-1][:2]], float).reshape(2, 2)
    return ends


def _line_parts(geometry: Any) -> list[Any]:
    """Return the coordinates of the non-empty parts of a line; none for other geometries."""
    kind = str(geometry["type"])
    if not kind.endswith("LineString"):
        return []
    coordinates = geometry["coordinates"]
    parts = coordinates if kind.startswith("Multi") else [coordinates]
    return [part for part in parts if len(part)]


def follow_lines(
    rows: list[Row], ends: FloatArray, layer_crs: CRS | None, crs: CRS | None, input_grid: Grid
) -> tuple[list[Row], NDArray[np.bool_]]:
    """Return the rows of a table with the positions of their lines.

    Parameters
    ----------
    rows
        The table.
    ends
        Nominal and reference position of each row's line, shape (n, 2, 2); NaN: no line.
    layer_crs, crs
        CRS of the lines, and of the map positions in the table.
    input_grid
        Grid of the input.

    Returns
    -------
    list
        The table; rows that agree with their line are unchanged.
    NDArray
        Which rows follow a line that was moved or drawn, shape (n,).

    Raises
    ------
    ValueError
        A nominal position on the map has no place in an input without georeferencing.
    """
    stated = np.stack([columns(rows, *NOMINAL), columns(rows, *REFERENCE)], axis=1)
    drawn = np.asarray(np.isfinite(ends).all(axis=(1, 2)))
    written = _projected(stated, crs, layer_crs).reshape(-1, 2)
    # Layers may count longitudes from elsewhere.
    written = near_longitude(written, ends.reshape(-1, 2)[:, :1], layer_crs)
    moved = drawn[:, None] & ~_same(ends, written.reshape(ends.shape))
    # A row that locates its point by input coordinates may have no nominal position to compare.
    elsewhere = np.isfinite(columns(rows, *INPUT)) | np.isfinite(columns(rows, *PIXEL))
    moved[:, 0] &= np.isfinite(stated[:, 0]).all(1) | ~elsewhere.all(1)
    on_map = _projected(ends, layer_crs, crs)
    are_pixels = not input_grid.is_georeferenced and _are_pixels(rows, stated[:, 0])
    if moved[:, 0].any() and not input_grid.is_georeferenced and not are_pixels:
        raise ValueError(
            "the start of a line was moved or drawn, which has no place in an image without "
            "georeferencing: fill input_col and input_row"
        )
    nominal = PIXEL if are_pixels else NOMINAL
    found = [dict(row) for row in rows]
    for end, names in enumerate((nominal, REFERENCE)):
        for index in np.flatnonzero(moved[:, end]):
            found[index] |= zip(names, on_map[index, end].tolist(), strict=True)
    return found, np.asarray(moved.any(axis=1))


def _are_pixels(rows: list[Row], nominal: FloatArray) -> bool:
    """Whether the nominal positions of a table are pixels of the input."""
    stated = np.isfinite(nominal).all(1)
    px = columns(rows, *PIXEL)
    return bool(stated.any() and _same(nominal[stated], px[stated]).all())


def _same(one: FloatArray, other: FloatArray) -> NDArray[np.bool_]:
    return np.asarray(np.isclose(one, other, _RELATIVE, _ABSOLUTE).all(-1))


def _projected(places: FloatArray, source: CRS | None, target: CRS | None) -> FloatArray:
    """Return positions, shape (n, 2, 2), in another CRS; non-finite ones become NaN."""
    known = np.isfinite(places).all(axis=-1)
    found = np.full_like(places, np.nan)
    found[known] = reproject(places[known], source, target)
    return found
