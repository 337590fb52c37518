"""Tables that people write: CSV, JSON or YAML, with named columns."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterable
from itertools import dropwhile
from pathlib import Path
from typing import Any

from .errors import ParameterError, one_line
from .strict_json import read_json

SUFFIXES = (".csv", ".json", ".yaml", ".yml")

_DELIMITERS = ",;\t"

# What a line without a value is made of.
_BLANK = f"{_DELIMITERS} \r\n"

# Values of YAML that are no text, but none at all, and names that stand for the values of others.
_YAML_TAGS = ("tag:yaml.org,2002:null", "tag:yaml.org,2002:merge")


def read_rows(path: Path) -> list[dict[str, Any]]:
    """Return the rows of a table, by the names of their columns; empty cells are left out.

    CSV has the names in its first line. JSON and YAML hold a list of rows, or `rows` beside
    `defaults`, which apply where a row has no value of its own. Values of CSV and YAML are texts.

    Raises
    ------
    ParameterError
        The table cannot be read or has no rows.
    """
    try:
        rows = _read_csv(path) if path.suffix.lower() == ".csv" else _read_nested(path)
    except UnicodeDecodeError as error:
        raise ParameterError(f"the table {path} is no UTF-8 text: save it as UTF-8") from error
    except (OSError, ValueError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or error
        raise ParameterError(f"cannot read the table {path}: {reason}") from error
    if not rows:
        raise ParameterError(f"the table {path} has no rows")
    return rows


def plain_number(value: Any) -> float:
    """Return the number in a cell, as other programs read it, too.

    Raises
    ------
    TypeError, ValueError
        The cell holds no number. `1_000` and digits of other scripts are numbers in Python alone.
    """
    if isinstance(value, str) and ("_" in value or not value.isascii()):
        raise ValueError(f"{value!r} is no number")
    return float(value)


def csv_rows(
    lines: Iterable[str], column: Callable[[str], str] = str
) -> tuple[list[str], list[dict[str, Any]]]:
    """Return the names of a CSV table's columns, and its rows by these names.

    Rows without a value are left out: spreadsheets write empty cells below a table.

    Parameters
    ----------
    lines
        The table; its first line that is not blank has the names.
    column
        Returns the name of a column by that in the first line.

    Raises
    ------
    ValueError
        A name occurs twice, or a row has more fields, that are not empty, than the first line.
    """
    held = list(dropwhile(lambda line: not line.strip(_BLANK), lines))
    # Spreadsheets write semicolons if a comma is the decimal sign.
    delimiter = max(_DELIMITERS, key=held[0].count) if held else ","
    reader = csv.DictReader(held, delimiter=delimiter)
    rows, names = list(reader), [column(name) for name in reader.fieldnames or () if name]
    if len(set(names)) < len(names):
        raise ValueError("a column's name stands twice in the first line")
    for number, row in enumerate(rows, 1):
        if any(field.strip() for field in row.pop(None, ())):
            raise ValueError(
                f"row {number} has more fields than the first line (is a comma the decimal sign?)"
            )
    return names, [row for row in rows if any((field or "").strip() for field in row.values())]


def _read_csv(path: Path) -> list[dict[str, Any]]:
    with path.open(newline="", encoding="utf-8-sig") as file:
        _, rows = csv_rows(file, _column)
    return [_filled(row) for row in rows]


def _read_nested(path: Path) -> list[dict[str, Any]]:
    is_json = path.suffix.lower() == ".json"
    # A name may be a number of many digits, as a time to the microsecond.
    held: Any = read_json(path, keeps_digits=True) if is_json else _read_yaml(path)
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
        return yaml.load(path.read_text(encoding="utf-8-sig"), _loader_of_texts(yaml))
    except (yaml.YAMLError, RecursionError) as error:
        raise ValueError(one_line(error)) from error


def _loader_of_texts(yaml: Any) -> Any:
    """Return a loader of YAML whose values are texts, as those of CSV.

    PyYAML makes a truth value of the name NO, and other numbers of 0123, 12:30:45 and 1_000.
    """
    resolvers = {
        first: [(tag, pattern) for tag, pattern in known if tag in _YAML_TAGS]
        for first, known in yaml.SafeLoader.yaml_implicit_resolvers.items()
    }
    return type("TextLoader", (yaml.SafeLoader,), {"yaml_implicit_resolvers": resolvers})


def _filled(row: dict[Any, Any]) -> dict[str, Any]:
    values = {
        _column(name): value.strip() if isinstance(value, str) else value
        for name, value in row.items()
    }
    return {name: value for name, value in values.items() if value is not None and value != ""}


def _column(name: Any) -> str:
    """Return a parameter's name in Python by a column's name, as on the command line."""
    return str(name).strip().lstrip("-").replace("-", "_").lower()
