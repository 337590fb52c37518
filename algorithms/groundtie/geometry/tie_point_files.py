"""Tie points in files: GeoPackage, GeoJSON, CSV and the QGIS Georeferencer's .points."""

from __future__ import annotations

import csv
import json
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from affine import Affine
from numpy.typing import NDArray
from rasterio.crs import CRS
from rasterio.errors import CRSError

from ..errors import OutputError, TransformFileError
from ..rasters.atomic import writing
from ..rasters.grid import Grid, reproject
from .tie_point_frames import NUMBERS, TEXTS, tie_point_columns
from .tie_points import USED, TiePoints
from .transform import Transform

FloatArray = NDArray[np.float64]
Row = dict[str, Any]

_LAYER = "tie_points"
_TEXTS = (*TEXTS, "reference_crs")

# Longitude and latitude, as GeoJSON demands (RFC 7946).
_GEOJSON_CRS = CRS.from_epsg(4326)

# The Georeferencer counts pixels from the image's corner, and rows downwards from 0.
_GEOREFERENCER_PIXELS = Grid(Affine.scale(1, -1), None, 1, 1)


@dataclass(frozen=True)
class StoredTiePoints:
    """What of tie points is needed to fit a transform to them.

    Parameters
    ----------
    reference_xy
        Positions on the reference map, shape (n, 2).
    input_px
        Positions in the input image (col, row), pixel centres at integers, shape (n, 2).
    is_check
        True for points that are held out of every fit, shape (n,).
    used
        False for rejected points, shape (n,).
    crs
        CRS of the reference map.
    more
        Further columns, shape (n,) each; NaN where a value is missing.
    """

    reference_xy: FloatArray
    input_px: FloatArray
    is_check: NDArray[np.bool_]
    used: NDArray[np.bool_]
    crs: CRS | None
    more: dict[str, FloatArray] = field(default_factory=dict)


def write_tie_points(
    path: str | os.PathLike[str],
    points: TiePoints,
    transform: Transform,
    more: Mapping[str, FloatArray] = MappingProxyType({}),
) -> None:
    """Write tie points in the format that the suffix of `path` tells.

    `.gpkg` and `.geojson` hold lines from where the input claims a point to be to where the
    reference has it, in the reference's CRS and in longitude and latitude; `.csv` holds the
    attributes alone; `.points` is for the QGIS Georeferencer, with rejected points disabled.

    Parameters
    ----------
    path
        File to write; see `rasters.atomic.Outputs.stage`.
    points
        The points.
    transform
        What their residuals refer to, with the CRS of the map and the input's grid.
    more
        Further columns of numbers, shape (n,) each, by their names; `.points` has no room for them.

    Raises
    ------
    OutputError
        The file cannot be written, or its suffix is not known.
    """
    write = _WRITERS.get(Path(path).suffix.lower())
    if write is None:
        raise OutputError(f"tie points are written as {', '.join(_WRITERS)}: {path}")
    with writing(path):
        write(Path(path), points, transform, more)


def read_tie_points(
    path: str | os.PathLike[str], input_grid: Grid, more: Sequence[str] = ()
) -> StoredTiePoints:
    """Read tie points that `write_tie_points`, or a person with QGIS, wrote.

    Parameters
    ----------
    path
        A `.gpkg`, `.geojson`, `.csv` or `.points` file. Tables need the columns `reference_x`,
        `reference_y`, and `claimed_x`, `claimed_y` or `input_col`, `input_row`.
    input_grid
        Grid of the input. Georeferenced inputs find their pixels by the claimed positions, so
        that any raster of the scene can be given; others find them by column and row.
    more
        Further columns of numbers to read, where the file has them.

    Raises
    ------
    TransformFileError
        The file cannot be read or understood.
    """
    read = _READERS.get(Path(path).suffix.lower())
    if read is None:
        raise TransformFileError(f"tie points are read from {', '.join(_READERS)}: {path}")
    try:
        return read(Path(path), input_grid, more)
    except (
        OSError,
        ValueError,
        KeyError,
        TypeError,
        CRSError,
    ) as error:
        reason = f"column {error} is missing" if isinstance(error, KeyError) else error
        raise TransformFileError(f"cannot read the tie points {path}: {reason}") from error


def _rows(points: TiePoints, transform: Transform, more: Mapping[str, FloatArray]) -> list[Row]:
    columns = {**tie_point_columns(points, transform), **more}
    texts = {"reference_crs": "" if transform.crs is None else transform.crs.to_string()}
    return [
        dict(zip(columns, values, strict=True)) | texts
        for values in zip(*(column.tolist() for column in columns.values()), strict=True)
    ]


def _line(row: Row, crs: CRS | None, target: CRS | None) -> dict[str, Any]:
    ends = np.array(
        [[row["claimed_x"], row["claimed_y"]], [row["reference_x"], row["reference_y"]]]
    )
    return {"type": "LineString", "coordinates": reproject(ends, crs, target).tolist()}


def _write_gpkg(
    path: Path, points: TiePoints, transform: Transform, more: Mapping[str, FloatArray]
) -> None:
    from .geopackage import write_layer  # heavy

    rows = _rows(points, transform, more)
    properties = dict.fromkeys((*NUMBERS, *more), "float") | dict.fromkeys(_TEXTS, "str")
    records = (
        {
            "type": "Feature",
            "geometry": _line(row, transform.crs, transform.crs),
            "properties": {name: _or_null(value) for name, value in row.items()},
        }
        for row in rows
    )
    write_layer(path, _LAYER, records, len(rows), properties, transform.crs)


def _write_geojson(
    path: Path, points: TiePoints, transform: Transform, more: Mapping[str, FloatArray]
) -> None:
    features = [
        {
            "type": "Feature",
            "geometry": _line(row, transform.crs, _GEOJSON_CRS),
            "properties": {name: _or_null(value) for name, value in row.items()},
        }
        for row in _rows(points, transform, more)
    ]
    collection = {"type": "FeatureCollection", "name": _LAYER, "features": features}
    path.write_text(json.dumps(collection, indent=1, allow_nan=False), encoding="utf-8")


def _write_csv(
    path: Path, points: TiePoints, transform: Transform, more: Mapping[str, FloatArray]
) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        table = csv.DictWriter(file, (*NUMBERS, *more, *_TEXTS), lineterminator="\n")
        table.writeheader()
        table.writerows(_rows(points, transform, more))


def _write_points(
    path: Path, points: TiePoints, transform: Transform, more: Mapping[str, FloatArray]
) -> None:
    source_xy = _georeferencer_grid(transform.input_grid).pixel_to_map(points.input_px)
    residual = points.residual_px(transform)
    lines = [] if transform.crs is None else [f"#CRS: {transform.crs.to_wkt()}"]
    lines.append("mapX,mapY,sourceX,sourceY,enable,dX,dY,residual")
    # Its rows are negative: so are its residuals along them.
    # The Georeferencer knows no check points: it would fit to every point that is enabled.
    fitted = points.used & ~points.is_check
    for xy, source, used, (dx, dy) in zip(
        points.reference_xy, source_xy, fitted, residual, strict=True
    ):
        numbers = [*xy, *source, int(used), dx, -dy, np.hypot(dx, dy)]
        lines.append(",".join(f"{number:.17g}" for number in numbers))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _read_gpkg(path: Path, input_grid: Grid, more: Sequence[str]) -> StoredTiePoints:
    from .geopackage import read_layer  # heavy

    rows, crs = read_layer(path)
    return _from_rows(rows, input_grid, crs, more)


def _read_geojson(path: Path, input_grid: Grid, more: Sequence[str]) -> StoredTiePoints:
    collection = json.loads(path.read_text(encoding="utf-8"))
    rows = [feature["properties"] for feature in collection["features"]]
    return _from_rows(rows, input_grid, input_grid.crs, more)


def _read_csv(path: Path, input_grid: Grid, more: Sequence[str]) -> StoredTiePoints:
    with path.open(encoding="utf-8-sig", newline="") as file:
        return _from_rows(list(csv.DictReader(file)), input_grid, input_grid.crs, more)


def _from_rows(
    rows: list[Row], input_grid: Grid, usual_crs: CRS | None, more: Sequence[str]
) -> StoredTiePoints:
    """Return the points of a table; without a column `reference_crs` the map has the usual CRS."""
    named = {str(row["reference_crs"] or "") for row in rows if "reference_crs" in row}
    if len(named) > 1:
        raise ValueError("the points have several CRSs")
    text = named.pop() if named else None
    crs = usual_crs if text is None else CRS.from_user_input(text) if text else None
    reference_xy = _columns(rows, "reference_x", "reference_y")
    if input_grid.is_georeferenced and rows and "claimed_x" in rows[0]:
        claimed = _columns(rows, "claimed_x", "claimed_y")
        input_px = input_grid.map_to_pixel(reproject(claimed, crs, input_grid.crs))
    else:
        input_px = _columns(rows, "input_col", "input_row")
    roles = [row.get("role", "fit") for row in rows]
    states = [row.get("state", USED) for row in rows]
    return StoredTiePoints(
        reference_xy,
        input_px,
        np.array([role == "check" for role in roles], bool),
        np.array([state == USED for state in states], bool),
        crs,
        {name: np.array([_number(row.get(name)) for row in rows]) for name in more},
    )


def _read_points(path: Path, input_grid: Grid, more: Sequence[str]) -> StoredTiePoints:
    """Read a Georeferencer file; without a CRS line its map is in the raster's CRS."""
    crs = input_grid.crs
    lines = path.read_text(encoding="utf-8-sig").splitlines()
    while lines and lines[0].startswith("#"):
        comment = lines.pop(0)
        if comment.startswith("#CRS:"):
            crs = CRS.from_user_input(comment.removeprefix("#CRS:").strip())
    rows: list[Row] = list(csv.DictReader(lines))
    # Older versions of QGIS called the columns so.
    x, y = ("pixelX", "pixelY") if rows and "pixelX" in rows[0] else ("sourceX", "sourceY")
    source_xy = _columns(rows, x, y)
    return StoredTiePoints(
        _columns(rows, "mapX", "mapY"),
        _georeferencer_grid(input_grid).map_to_pixel(source_xy),
        np.zeros(len(rows), bool),
        np.array([row["enable"].strip() != "0" for row in rows], bool),
        crs,
        {name: np.full(len(rows), np.nan) for name in more},
    )


def _georeferencer_grid(input_grid: Grid) -> Grid:
    return input_grid if input_grid.is_georeferenced else _GEOREFERENCER_PIXELS


def _columns(rows: Iterable[Row], x: str, y: str) -> FloatArray:
    return np.array([[float(row[x]), float(row[y])] for row in rows], float).reshape(-1, 2)


def _number(value: Any) -> float:
    return float("nan") if value is None or value == "" else float(value)


def _or_null(value: Any) -> Any:
    return None if isinstance(value, float) and not np.isfinite(value) else value


_WRITERS: dict[str, Callable[[Path, TiePoints, Transform, Mapping[str, FloatArray]], None]] = {
    ".gpkg": _write_gpkg,
    ".geojson": _write_geojson,
    ".csv": _write_csv,
    ".points": _write_points,
}
_READERS: dict[str, Callable[[Path, Grid, Sequence[str]], StoredTiePoints]] = {
    ".gpkg": _read_gpkg,
    ".geojson": _read_geojson,
    ".csv": _read_csv,
    ".points": _read_points,
}
