"""The kinds of parameters: which values they take, and what they say of others."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from groundtie.errors import ParameterError
from groundtie.kinds import (
    Band,
    Choice,
    Distance,
    FileIn,
    FileOut,
    Flag,
    FolderOut,
    Kind,
    Number,
    RasterIn,
    RasterOut,
    Text,
    VectorIn,
    VectorOut,
)

TEXTS: dict[str, Any] = {"label": "Label", "help": "Help."}
NUMBER = Number(**TEXTS, minimum=-2, maximum=5, unit="px")
WHOLE = Number(**TEXTS, minimum=0, integer=True)
RASTER = RasterIn(**TEXTS)
RASTER_OUT = RasterOut(**TEXTS)
HTML_OUT = FileOut(**TEXTS, suffixes=(".html", ".htm"))


@pytest.mark.parametrize(
    ("kind", "value", "expected"),
    [
        (NUMBER, 3, 3.0),
        (NUMBER, "2.5", 2.5),
        (NUMBER, -2, -2.0),
        (NUMBER, 5, 5.0),
        (WHOLE, 4.0, 4),
        (WHOLE, "12", 12),
        (Distance(**TEXTS), "0", 0.0),
        (Choice(**TEXTS, choices=("a", "b")), "b", "b"),
        (Flag(**TEXTS), False, False),
        (Text(**TEXTS), "any", "any"),
        (Band(**TEXTS, of="input"), "3", 3),
        (RASTER, "a/b.tif", Path("a/b.tif")),
        (RASTER, Path("b.jp2"), Path("b.jp2")),
        (RASTER, r"C:\images\b.tif", Path(r"C:\images\b.tif")),
        (RASTER, "/vsizip//a.zip/b.tif", "/vsizip//a.zip/b.tif"),
        (RASTER, 'HDF5:"a.h5"://b', 'HDF5:"a.h5"://b'),
        (VectorIn(**TEXTS), "https://host/a.gpkg", "/vsicurl/https://host/a.gpkg"),
        (FileIn(**TEXTS, suffixes=(".json",)), "t.json", Path("t.json")),
        (RASTER_OUT, "x.TIF", Path("x.TIF")),
        (VectorOut(**TEXTS), "x.gpkg", Path("x.gpkg")),
        (HTML_OUT, "x.htm", Path("x.htm")),
        (FolderOut(**TEXTS), "out", Path("out")),
    ],
)
def test_values_come_out_in_their_proper_type(kind: Kind, value: Any, expected: Any) -> None:
    found = kind.check("name", value)
    assert found == expected
    assert type(found) is type(expected)
    assert kind.check("name", found) == found


@pytest.mark.parametrize(
    ("kind", "value", "message"),
    [
        (NUMBER, 5.01, "size must be -2 to 5 px, not 5.01"),
        (NUMBER, "many", "size must be a number, not 'many'"),
        (NUMBER, True, "size must be a number, not True"),
        (NUMBER, None, "size must be a number, not None"),
        (NUMBER, math.nan, "size must be a finite number, not nan"),
        (NUMBER, "1_0", "size must be a number, not '1_0'"),
        (NUMBER, "٣", "size must be a number, not '٣'"),
        (Number(**TEXTS), math.inf, "size must be a finite number, not inf"),
        (WHOLE, 1.5, "size must be a whole number, not 1.5"),
        (WHOLE, -1, "size must be at least 0, not -1"),
        (Number(**TEXTS, maximum=3), 4, "size must be at most 3, not 4"),
        (Distance(**TEXTS), -0.5, "size must be at least 0 m, not -0.5"),
        (Choice(**TEXTS, choices=("a", "b")), "c", "size must be one of a, b, not 'c'"),
        (
            Choice(**TEXTS, choices=("a", "b")),
            np.arange(2),
            "size must be one of a, b, not array([0, 1])",
        ),
        (Flag(**TEXTS), "yes", "size must be true or false, not 'yes'"),
        (Text(**TEXTS), 3, "size must be a text, not 3"),
        (Band(**TEXTS, of="input"), 0, "size must be at least 1, not 0"),
        (RASTER, "", "size must be a path, not ''"),
        (RASTER, 7, "size must be a path, an open dataset or an array, not 7"),
        (
            RASTER,
            np.zeros(3),
            "size: an array must have the shape (h, w) or (bands, h, w), not (3,)",
        ),
        (VectorIn(**TEXTS), 7, "size must be a path, not 7"),
        (RASTER_OUT, "x.jpg", "size must end in .tif or .tiff: x.jpg"),
        (HTML_OUT, "report", "size must end in .html or .htm: report"),
    ],
)
def test_other_values_are_refused_in_one_line(kind: Kind, value: Any, message: str) -> None:
    with pytest.raises(ParameterError) as caught:
        kind.check("size", value)
    assert str(caught.value) == message


@given(st.floats() | st.integers(-(10**6), 10**6))
def test_a_number_is_taken_exactly_within_its_range(value: float) -> None:
    if -2 <= value <= 5:
        assert NUMBER.check("size", value) == value
    else:
        with pytest.raises(ParameterError):
            NUMBER.check("size", value)


@pytest.mark.parametrize(
    ("minimum", "maximum", "text"),
    [
        (0, 2**31 - 1, "0 to 2147483647"),
        (0.5, 1, "0.5 to 1"),
        (0, math.inf, "at least 0"),
        (-math.inf, 2, "at most 2"),
    ],
)
def test_the_range_in_words(minimum: float, maximum: float, text: str) -> None:
    assert Number(**TEXTS, minimum=minimum, maximum=maximum).range_text == text


def test_any_number_has_no_range() -> None:
    assert Number(**TEXTS).range_text == ""


def test_a_file_whose_name_looks_like_a_driver_is_a_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("scene:1.tif").touch()
    assert RASTER.check("input", "scene:1.tif") == Path("scene:1.tif")


def test_a_choice_of_names_may_have_hyphens() -> None:
    kind = Choice(label="Tool", help="It.", choices=("match_sar_sar", "low-pass"))
    assert kind.check("tool", "match-sar-sar") == "match_sar_sar"
    assert kind.check("tool", "low-pass") == "low-pass"
    with pytest.raises(ParameterError, match="must be one of"):
        kind.check("tool", "low_pass")
