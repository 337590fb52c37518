"""Point files of the QGIS Georeferencer."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from affine import Affine
from rasterio.crs import CRS

from ..rasters.grid import Grid, require_map
from .point_tables import Row, positions, require_places, table_rows
from .tie_points import USED, TiePoints
from .transform import Transform

SUFFIX = ".points"

# The Georeferencer counts pixels from the image's corner; rows are negative downwards.
_PIXELS = Grid(Affine.scale(1, -1), None, 1, 1)


def write_georeferencer(
    path: Path, points: TiePoints, transform: Transform, own_grid: Grid | None = None
) -> None:
    """Write points for the Georeferencer, with only used points of the fit enabled.

    `own_grid` is the grid on which it places the input, if that is not the transform's grid.
    """
    source_xy = _source_grid(own_grid or transform.input_grid).pixel_to_map(points.input_px)
    residual = points.residual_px(transform)
    lines = [] if transform.crs is None else [f"#CRS: {transform.crs.to_wkt()}"]
    lines.append("mapX,mapY,sourceX,sourceY,enable,dX,dY,residual")
    # The Georeferencer has no check points: it would fit to every enabled point.
    fitted = points.fit
    # Its rows are negative, and so are its residuals along them.
    numbers = [points.reference_xy, source_xy, fitted, residual * [1, -1], np.hypot(*residual.T)]
    for row in np.column_stack(numbers):
        lines.append(",".join(f"{number:.17g}" for number in row))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def read_georeferencer(path: Path, input_grid: Grid) -> TiePoints:
    """Read points of the Georeferencer; without a CRS line, their map has the input's CRS.

    Raises
    ------
    KeyError, TypeError, ValueError
        The table cannot be understood.
    """
    crs = input_grid.crs
    lines = path.read_text(encoding="utf-8-sig").splitlines()
    while lines and lines[0].startswith("#"):
        comment = lines.pop(0)
        if comment.startswith("#CRS:"):
            crs = require_map(CRS.from_user_input(comment.removeprefix("#CRS:").strip()))
    rows = table_rows(lines, ("mapX", "mapY"))
    # Older versions of QGIS named the columns `pixelX` and `pixelY`.
    x, y = ("pixelX", "pixelY") if rows and "pixelX" in rows[0] else ("sourceX", "sourceY")
    grid = _source_grid(input_grid)
    source_xy = require_places(positions(rows, x, y))
    input_px = grid.map_to_pixel(grid.to_own_map(source_xy, grid.crs))
    states = [USED if _is_enabled(row) else "rejected: disabled" for row in rows]
    reference_xy = require_places(positions(rows, "mapX", "mapY"))
    return TiePoints.unmeasured(reference_xy, input_px, crs, states)


def _is_enabled(row: Row) -> bool:
    """Return whether a point takes part in the fit.

    QGIS (`QgsGCPList::loadGcps`) enables points of rows that end before this field, and reads an
    empty field as 0. It reads words as 0, too, even "true", so that words are refused here.
    """
    word = row.get("enable")
    if word is None:
        return True
    if word.strip() not in ("1", "0", ""):
        raise ValueError(f"enable must be 1 or 0, not {word!r}")
    return bool(word.strip() == "1")


def _source_grid(input_grid: Grid) -> Grid:
    return input_grid if input_grid.is_georeferenced else _PIXELS
