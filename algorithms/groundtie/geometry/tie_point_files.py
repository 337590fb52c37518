"""Tie-point files: GeoPackage, GeoJSON, CSV and the QGIS Georeferencer's .points."""

from __future__ import annotations

import csv
import logging
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from rasterio.crs import CRS
from rasterio.errors import CRSError

from ..errors import OutputError, TransformFileError
from ..kinds import plain
from ..rasters.atomic import write_csv, write_json, writing
from ..rasters.grid import (
    LON_LAT,
    FloatArray,
    Grid,
    crs_name,
    near_longitude,
    reproject,
    require_map,
)
from ..runs import run_tags
from ..strict_json import read_json
from ..wording import reason_of
from .drawn_points import follow_lines, line_ends
from .georeferencer import SUFFIX as GEOREFERENCER
from .georeferencer import read_georeferencer, write_georeferencer
from .point_tables import (
    INPUT,
    NOMINAL,
    PIXEL,
    REFERENCE,
    SIGMA,
    Row,
    columns,
    numbers,
    position,
    positions,
    require_places,
    table_rows,
)
from .tie_point_frames import NUMBERS, TEXTS, tie_point_columns
from .tie_points import EDITED, USED, TiePoints
from .transform import Transform
from .vector_layers import read_vector_layer, write_vector_layer

_LOG = logging.getLogger(__name__)
SUFFIXES = (".gpkg", ".geojson", ".csv", GEOREFERENCER)
_LAYER = "tie_points"
_TEXTS = (*TEXTS, "reference_crs")
_ROLES = ("fit", "check", "")


def write_tie_points(path: str | os.PathLike[str], points: TiePoints, transform: Transform) -> None:
    """Write tie points in the format of the suffix of `path`.

    `.gpkg` and `.geojson` hold a line for each point, from its nominal position to its position on
    the reference: in the reference's CRS and in longitude and latitude, respectively. `.csv` holds
    the attributes alone. `.points` is for the QGIS Georeferencer, without further columns and with
    only used points of the fit enabled.

    Parameters
    ----------
    path
        File to write; see `rasters.atomic.Outputs.stage`.
    points
        The points.
    transform
        Transform that the residuals refer to, with the CRS of the map and the input's grid.

    Raises
    ------
    OutputError
        The file cannot be written, or its suffix is unknown.
    """
    path = Path(path)
    suffix = _suffix(path, "written as", OutputError)
    with writing(path):
        if suffix == GEOREFERENCER:
            write_georeferencer(path, points, transform)
            return
        rows, names = _rows(points, transform), (*NUMBERS, *points.more)
        if suffix == ".gpkg":
            _write_gpkg(path, rows, names, transform.crs)
        elif suffix == ".geojson":
            features = _features(rows, transform.crs, LON_LAT)
            collection = {"type": "FeatureCollection", "name": _LAYER, "features": features}
            write_json(path, collection)
        else:
            write_csv(path, (*names, *_TEXTS, *run_tags()), rows)


def read_tie_points(
    path: str | os.PathLike[str],
    input_grid: Grid,
    more: Sequence[str] = (),
    table_crs: CRS | None = None,
) -> TiePoints:
    """Read tie points written by `write_tie_points` or by a person with QGIS.

    Parameters
    ----------
    path
        A `.gpkg`, `.geojson`, `.csv` or `.points` file. Tables need the columns `reference_x` and
        `reference_y`, and one of the pairs `nominal_x`, `nominal_y` (on the reference map),
        `input_x`, `input_y` (on the input's own map) or `input_col`, `input_row`.
    input_grid
        Grid of the input. For a georeferenced input, pixels follow from the nominal positions, so
        that any raster of the scene will do; otherwise from column and row.
    more
        Further columns of numbers to read; NaN where the file has none.
    table_crs
        CRS of the reference map for a CSV table that names none; by default that of the input.

    Returns
    -------
    TiePoints
        The points with the CRS of their map; numbers that the file lacks are NaN. The column
        `edited` of `more` is 1 if a person moved or drew the point's line: then the line's ends
        count instead of the columns. It stays 1 for points marked as edited in the file.

    Raises
    ------
    TransformFileError
        The file cannot be read or understood.
    """
    path = Path(path)
    suffix = _suffix(path, "read from", TransformFileError)
    try:
        if suffix == GEOREFERENCER:
            points = read_georeferencer(path, input_grid)
            return replace(points, more={name: np.full(len(points), np.nan) for name in more})
        rows, ends, layer_crs = _read_rows(path, suffix)
        usual_crs = {
            ".gpkg": layer_crs,
            ".geojson": input_grid.crs or layer_crs,
            ".csv": table_crs or input_grid.crs,
        }
        crs = _map_crs(rows, usual_crs[suffix], empty_is_none=suffix != ".gpkg")
        rows, edited = follow_lines(rows, ends, layer_crs, crs, input_grid)
        if edited.any():
            _LOG.info("%s: %d of %d lines were moved or drawn", path, edited.sum(), len(rows))
        points = _from_rows(rows, input_grid, crs, more)
        edited |= numbers(rows, EDITED) > 0
        return replace(points, more={**points.more, EDITED: edited.astype(float)})
    except (OSError, ValueError, KeyError, TypeError, OverflowError, CRSError, csv.Error) as error:
        reason = f"column {error} is missing" if isinstance(error, KeyError) else reason_of(error)
        raise TransformFileError(f"cannot read the tie points {path}: {reason}") from error


def _suffix(path: Path, verb: str, error: type[OutputError | TransformFileError]) -> str:
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise error(f"tie points are {verb} {', '.join(SUFFIXES)}: {path}")
    return suffix


def _rows(points: TiePoints, transform: Transform) -> list[Row]:
    columns = {**tie_point_columns(points, transform), **points.more}
    crs = "" if transform.crs is None else crs_name(transform.crs)
    texts = {"reference_crs": crs, **run_tags()}
    return [
        dict(zip(columns, values, strict=True)) | texts
        for values in zip(*(column.tolist() for column in columns.values()), strict=True)
    ]


def _features(rows: list[Row], crs: CRS | None, target: CRS | None) -> list[dict[str, Any]]:
    """Return rows as GeoJSON features: lines from nominal to reference positions in a CRS."""
    start, end = (reproject(positions(rows, *names), crs, target) for names in (NOMINAL, REFERENCE))
    # Across the antimeridian, longitudes go on: lines would otherwise run around the globe.
    lines = np.stack([start, near_longitude(end, start[:, :1], target)], axis=1)
    return [
        {
            "type": "Feature",
            "geometry": {"type": "LineString", "coordinates": line},
            "properties": plain(row),
        }
        for line, row in zip(lines.tolist(), rows, strict=True)
    ]


def _write_gpkg(path: Path, rows: list[Row], names: Sequence[str], crs: CRS | None) -> None:
    properties = dict.fromkeys(names, "float") | dict.fromkeys((*_TEXTS, *run_tags()), "str")
    write_vector_layer(path, _LAYER, _features(rows, crs, crs), properties, crs)


def _read_rows(path: Path, suffix: str) -> tuple[list[Row], FloatArray, CRS | None]:
    """Return the rows of a file, the ends of their lines, and the CRS of the lines."""
    if suffix == ".gpkg":
        layer = read_vector_layer(path)
        rows = [feature["properties"] for feature in layer.features]
        return rows, line_ends([feature["geometry"] for feature in layer.features]), layer.crs
    if suffix == ".geojson":
        collection = read_json(path)
        features = collection["features"]
        # Properties may be null (RFC 7946, section 3.2).
        rows = [dict(feature.get("properties") or {}) for feature in features]
        ends = line_ends([feature.get("geometry") for feature in features])
        # Older than RFC 7946, but QGIS writes it.
        named = collection.get("crs")
        crs = CRS.from_user_input(named["properties"]["name"]) if named else LON_LAT
        return rows, ends, require_map(crs)
    with path.open(encoding="utf-8-sig", newline="") as file:
        rows = table_rows(file, REFERENCE)
    return rows, line_ends([None] * len(rows)), None


def _map_crs(rows: list[Row], usual: CRS | None, empty_is_none: bool) -> CRS | None:
    """Return the CRS of a table's map positions.

    The column `reference_crs` names it; if the column is empty or missing, it is the usual CRS.
    However, GroundTie writes an empty text to GeoJSON and CSV for images without a CRS.
    """
    named = {str(row["reference_crs"]) for row in rows if row.get("reference_crs")}
    if len(named) > 1:
        raise ValueError("the points have several CRSs")
    if named:
        return require_map(CRS.from_user_input(named.pop()))
    none = empty_is_none and rows and all(row.get("reference_crs") == "" for row in rows)
    return None if none else usual


def _from_rows(
    rows: list[Row], input_grid: Grid, crs: CRS | None, more: Sequence[str]
) -> TiePoints:
    """Return the points of a table."""
    states = [_state(row) for row in rows]
    roles = [_role(row) for row in rows]
    sigma = columns(rows, *SIGMA)
    points = TiePoints.unmeasured(
        require_places(positions(rows, *REFERENCE)),
        require_places(_input_px(rows, input_grid, crs)),
        crs,
        states,
    )
    return replace(
        points,
        score=numbers(rows, "score"),
        covariance_px2=sigma[:, :, None] ** 2 * np.eye(2),
        forward_backward_error_px=numbers(rows, "forward_backward_error_px"),
        is_check=np.array([role == "check" for role in roles], bool),
        more={name: numbers(rows, name) for name in more},
        states_fit="fit" in roles,
    )


def _state(row: Row) -> str:
    """Return the state of a point; what is not used is the reason why."""
    # A drawn line has empty columns.
    stated = str(row.get("state") or USED).strip()
    return USED if stated.lower() == USED else stated


def _role(row: Row) -> str:
    """Return the role of a point; an empty text if none is stated."""
    stated = str(row.get("role") or "")
    role = stated.strip().lower()
    if role not in _ROLES:
        raise ValueError(f"role must be fit or check, not {stated!r}")
    return role


def _input_px(rows: list[Row], input_grid: Grid, crs: CRS | None) -> FloatArray:
    """Return the input pixels (col, row) of the points of a table, shape (n, 2)."""
    names = set().union(*rows)
    px = np.full((len(rows), 2), np.nan)
    if input_grid.is_georeferenced and NOMINAL[0] in names:
        px = input_grid.map_to_pixel(input_grid.to_own_map(columns(rows, *NOMINAL), crs))
    if INPUT[0] in names:
        own_xy = input_grid.to_own_map(columns(rows, *INPUT), input_grid.crs)
        on_map = input_grid.map_to_pixel(own_xy)
        px = np.where(np.isfinite(px), px, on_map)
    for place in np.flatnonzero(~np.isfinite(px).all(axis=1)):
        px[place] = position(rows[place], *PIXEL, int(place) + 1)
    return px
