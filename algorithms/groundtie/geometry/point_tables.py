"""Tables of points in files: rows by column name, and the positions in them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from ..rasters.grid import FloatArray
from ..tables import csv_rows, plain_number

Row = dict[str, Any]

REFERENCE = ("reference_x", "reference_y")

# Columns of a point's place in the input: on the reference map, on the input's map, as a pixel.
NOMINAL = ("nominal_x", "nominal_y")
INPUT = ("input_x", "input_y")
PIXEL = ("input_col", "input_row")

# Standard deviations of a match.
SIGMA = ("sigma_x_px", "sigma_y_px")

# Larger than any coordinate on a map of the Earth, in any unit, or in an image.
_FARTHEST = 1e10


def table_rows(lines: Iterable[str], needed: Sequence[str]) -> list[Row]:
    """Return the rows of a CSV table by the names of its columns.

    Raises
    ------
    KeyError
        One of the needed columns is missing in the first line, whether or not rows follow.
    ValueError
        See `csv_rows`.
    """
    names, rows = csv_rows(lines)
    for name in needed:
        if names and name not in names:
            raise KeyError(name)
    return rows


def columns(rows: list[Row], x: str, y: str) -> FloatArray:
    """Return the positions in two columns, shape (n, 2); NaN where a row has none."""
    return np.column_stack([numbers(rows, x), numbers(rows, y)])


def numbers(rows: list[Row], name: str) -> FloatArray:
    """Return a column of numbers, shape (n,); NaN where a row has none."""
    found = np.full(len(rows), np.nan)
    for place, row in enumerate(rows):
        if row.get(name) not in (None, ""):
            found[place] = _number(row, name, place + 1)
    return found


def _number(row: Row, name: str, number: int) -> float:
    """Return the number in a column of a row; `number` counts rows from 1, for messages."""
    try:
        return plain_number(row[name])
    except (TypeError, ValueError) as error:
        shown = "empty" if row[name] in (None, "") else f"{row[name]!r:.40}"
        raise ValueError(f"{name} in row {number} is {shown}, and must be a number") from error


def positions(rows: Iterable[Row], x: str, y: str) -> FloatArray:
    """Return the positions in two columns, shape (n, 2), which every row must have.

    Raises
    ------
    KeyError, ValueError
        A row has no position.
    """
    places = [position(row, x, y, number) for number, row in enumerate(rows, 1)]
    return np.array(places, float).reshape(-1, 2)


def position(row: Row, x: str, y: str, number: int) -> tuple[float, float]:
    """Return the position in two columns of a row, which is `number`, from 1, in messages.

    Raises as `positions`.
    """
    return _number(row, x, number), _number(row, y, number)


def require_places(places: FloatArray) -> FloatArray:
    """Return positions from a file, shape (n, 2), unchanged.

    Raises
    ------
    ValueError
        A position is not finite, or too far off to lie on any map.
    """
    lost = int((~(np.abs(places) < _FARTHEST)).any(axis=1).sum())
    if lost:
        raise ValueError(f"{lost} of {len(places)} positions are not finite, or on no map")
    return places
