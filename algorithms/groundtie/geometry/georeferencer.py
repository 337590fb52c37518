"""The QGIS Georeferencer's files of points."""

from __future__ import annotations

import csv
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from affine import Affine
from rasterio.crs import CRS

from ..rasters.grid import FloatArray, Grid, require_map
from .tie_points import USED, TiePoints
from .transform import Transform

Row = dict[str, Any]

# No position on a map of the Earth, in any unit, nor in an image is farther off.
_FARTHEST = 1e10

# It counts pixels from the image's corner, and rows downwards from 0.
_PIXELS = Grid(Affine.scale(1, -1), None, 1, 1)


def write_georeferencer(path: Path, points: TiePoints, transform: Transform) -> None:
    """Write points for the Georeferencer, in which only used points of the fit are enabled."""
    source_xy = _source_grid(transform.input_grid).pixel_to_map(points.input_px)
    residual = points.residual_px(transform)
    lines = [] if transform.crs is None else [f"#CRS: {transform.crs.to_wkt()}"]
    lines.append("mapX,mapY,sourceX,sourceY,enable,dX,dY,residual")
    # It has no check points: it would fit to every point that is enabled.
    fitted = points.fit
    # Its rows are negative: so are its residuals along them.
    numbers = [points.reference_xy, source_xy, fitted, residual * [1, -1], np.hypot(*residual.T)]
    for row in np.column_stack(numbers):
        lines.append(",".join(f"{number:.17g}" for number in row))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def read_georeferencer(path: Path, input_grid: Grid) -> TiePoints:
    """Read points of the Georeferencer; without a CRS line their map is in the raster's CRS."""
    crs = input_grid.crs
    lines = path.read_text(encoding="utf-8-sig").splitlines()
    while lines and lines[0].startswith("#"):
        comment = lines.pop(0)
        if comment.startswith("#CRS:"):
            crs = require_map(CRS.from_user_input(comment.removeprefix("#CRS:").strip()))
    rows = table_rows(lines)
    # Older versions of QGIS called the columns so.
    x, y = ("pixelX", "pixelY") if rows and "pixelX" in rows[0] else ("sourceX", "sourceY")
    input_px = _source_grid(input_grid).map_to_pixel(require_places(positions(rows, x, y)))
    # As in QGIS, a point of which nothing is said is enabled.
    enabled = [(row.get("enable") or "1").strip() for row in rows]
    states = ["rejected: disabled" if word == "0" else USED for word in enabled]
    reference_xy = require_places(positions(rows, "mapX", "mapY"))
    return unmeasured(reference_xy, input_px, states, crs)


def table_rows(lines: Iterable[str]) -> list[Row]:
    """Return the rows of a CSV table by the names of its columns.

    Fields beyond those of the first line are left out.
    """
    rows = [dict(row) for row in csv.DictReader(lines)]
    for row in rows:
        row.pop(None, None)
    return rows


def unmeasured(
    reference_xy: FloatArray, input_px: FloatArray, states: list[str], crs: CRS | None
) -> TiePoints:
    """Return points of a fit whose places and states are all that is known."""
    count = len(states)
    return TiePoints(
        reference_xy,
        input_px,
        np.full(count, np.nan),
        np.full((count, 2, 2), np.nan),
        np.full(count, np.nan),
        np.zeros(count, bool),
        np.array(states, str),
        crs,
    )


def positions(rows: Iterable[Row], x: str, y: str) -> FloatArray:
    """Return the positions in two columns of a table, shape (n, 2)."""
    return np.array([[float(row[x]), float(row[y])] for row in rows], float).reshape(-1, 2)


def require_places(places: FloatArray) -> FloatArray:
    """Return positions, shape (n, 2), that a file holds.

    Raises
    ------
    ValueError
        One is so far off that it lies on no map, or is not finite.
    """
    lost = int((~(np.abs(places) < _FARTHEST)).any(axis=1).sum())
    if lost:
        raise ValueError(f"{lost} of {len(places)} positions are not finite, or on no map")
    return places


def _source_grid(input_grid: Grid) -> Grid:
    return input_grid if input_grid.is_georeferenced else _PIXELS
