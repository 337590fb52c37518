"""Tables that people write: CSV, JSON or YAML, with named columns."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

from .errors import ParameterError
from .strict_json import read_json

SUFFIXES = (".csv", ".json", ".yaml", ".yml")

_DELIMITERS = ",;\t"


def read_rows(path: Path) -> list[dict[str, Any]]:
    """Return the rows of a table, by the names of their columns; empty cells are left out.

    CSV has the names in its first line. JSON and YAML hold a list of rows, or `rows` beside
    `defaults`, which count where a row has no value of its own.

    Raises
    ------
    ParameterError
        The table cannot be read or has no rows.
    """
    try:
        rows = _read_csv(path) if path.suffix.lower() == ".csv" else _read_nested(path)
    except (OSError, ValueError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or error
        raise ParameterError(f"cannot read the table {path}: {reason}") from error
    if not rows:
        raise ParameterError(f"the table {path} has no rows")
    return rows


def plain_number(value: Any) -> float:
    """Return the number that a cell holds, which other programs read alike.

    Raises
    ------
    TypeError, ValueError
        It holds none; Python alone takes `1_000`, and digits of other scripts, for numbers.
    """
    if isinstance(value, str) and ("_" in value or not value.isascii()):
        raise ValueError(f"{value!r} is no number")
    return float(value)


def _read_csv(path: Path) -> list[dict[str, Any]]:
    with path.open(newline="", encoding="utf-8-sig") as file:
        header = file.readline()
        file.seek(0)
        # Spreadsheets write semicolons where a comma is the decimal sign.
        reader = csv.DictReader(file, delimiter=max(_DELIMITERS, key=header.count))
        names = list(reader.fieldnames or ())
        rows = list(reader)
    if len({_column(name) for name in names}) < len(names):
        raise ValueError("a column's name stands twice in the first line")
    for number, row in enumerate(rows, 1):
        if None in row:
            raise ValueError(f"row {number} has more cells than the first line")
    return [_filled(row) for row in rows]


def _read_nested(path: Path) -> list[dict[str, Any]]:
    held: Any = read_json(path) if path.suffix.lower() == ".json" else _read_yaml(path)
    defaults: Any = {}
    if isinstance(held, dict):
        if set(held) - {"defaults", "rows"}:
            raise ValueError("it must be a list of rows, or have rows and defaults only")
        defaults, held = held.get("defaults") or {}, held.get("rows")
    if not isinstance(held, list) or not all(isinstance(row, dict) for row in [defaults, *held]):
        raise ValueError("it must be a list of rows that are made of names and values")
    return [{**_filled(defaults), **_filled(row)} for row in held]


def _read_yaml(path: Path) -> Any:
    try:
        import yaml
    except ImportError as error:
        raise ValueError("YAML needs the Python package PyYAML; JSON and CSV do not") from error
    try:
        return yaml.safe_load(path.read_text(encoding="utf-8-sig"))
    except (yaml.YAMLError, RecursionError) as error:
        raise ValueError(" ".join(str(error).split())) from error


def _filled(row: dict[Any, Any]) -> dict[str, Any]:
    values = {
        _column(name): value.strip() if isinstance(value, str) else value
        for name, value in row.items()
    }
    return {name: value for name, value in values.items() if value is not None and value != ""}


def _column(name: Any) -> str:
    """Return a parameter's name as Python has it, of a column's as the command line has it."""
    return str(name).strip().lstrip("-").replace("-", "_")
