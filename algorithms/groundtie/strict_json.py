"""Strict JSON from files of any origin: anything but plain JSON is an error.

Python reads more than JSON: infinity and NaN, and whole numbers of any length, which can be neither
a float nor the size of an array.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any


def read_json(path: Path, *, keeps_digits: bool = False) -> Any:
    """Return the content of a JSON file; all of its numbers are finite.

    Parameters
    ----------
    path
        The file.
    keeps_digits
        As `parse_json`.

    Raises
    ------
    OSError
        The file cannot be read.
    ValueError
        As `parse_json`.
    """
    return parse_json(path.read_bytes(), keeps_digits=keeps_digits)


def read_json_lines(path: Path, *, keeps_digits: bool = False) -> Iterator[Any]:
    """Yield the content of each line of a file.

    Lines that are no JSON are skipped, as the last one of a program that was killed. A file that
    cannot be read has no lines.

    Parameters
    ----------
    path
        The file.
    keeps_digits
        As `parse_json`.
    """
    with suppress(OSError), path.open("rb") as file:
        for line in file:
            with suppress(ValueError):
                yield parse_json(line, keeps_digits=keeps_digits)


def parse_json(content: bytes, *, keeps_digits: bool = False) -> Any:
    """Return the content of JSON in UTF-8; all of its numbers are finite.

    Parameters
    ----------
    content
        The JSON.
    keeps_digits
        Whether whole numbers keep all digits, as names must; otherwise long ones become floats.

    Raises
    ------
    ValueError
        It is no JSON, holds numbers that are not finite, or is nested too deeply.
    """
    try:
        return json.loads(
            content.decode("utf-8-sig"),
            parse_float=_finite,
            parse_int=_exact if keeps_digits else _whole,
            parse_constant=_finite,
        )
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"{text[:20]} is no finite number")
    return number


def _whole(text: str) -> int | float:
    # A float has 15 digits; longer whole numbers are no counts.
    return int(text) if len(text) <= 15 else _finite(text)


def _exact(text: str) -> int:
    _finite(text)  # numbers beyond a float are no values, and too long for a name
    return int(text)
