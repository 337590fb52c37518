"""JSON from files that anybody may have written: what is no plain JSON is an error, not a surprise.

Python reads more than JSON: infinity and NaN, and whole numbers of any length, which become
neither a float nor the size of an array.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any


def read_json(path: Path, *, keeps_digits: bool = False) -> Any:
    """Return what a JSON file holds; all of its numbers are finite.

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
    """Yield what each line of a file states.

    Of lines that are no JSON, as the last one of a program that was killed, nothing is taken; a
    file that cannot be read has no lines.

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
    """Return what JSON in UTF-8 states; all of its numbers are finite.

    Parameters
    ----------
    content
        The JSON.
    keeps_digits
        Whole numbers keep all digits, as those that are names must; else long ones become floats.

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
    # A float has 15 digits; whole numbers beyond count nothing.
    return int(text) if len(text) <= 15 else _finite(text)


def _exact(text: str) -> int:
    _finite(text)  # beyond is nobody's number, nor is it short enough for a name
    return int(text)
