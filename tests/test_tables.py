"""Tables of calls, in each of their formats."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from groundtie.errors import ParameterError
from groundtie.tables import read_rows

ROWS = [{"input": "a.tif", "search_radius": "3"}, {"input": "b.tif"}]


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
def test_csv_of_any_spreadsheet(tmp_path: Path, delimiter: str) -> None:
    path = tmp_path / "t.csv"
    lines = ["input,search-radius", " a.tif ,3", "b.tif,", ""]
    path.write_text("\n".join(lines).replace(",", delimiter), encoding="utf-8-sig")
    assert read_rows(path) == ROWS


def test_a_cell_may_hold_commas(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text('input,bands\n"a,b.tif","1,2"\n')
    assert read_rows(path) == [{"input": "a,b.tif", "bands": "1,2"}]


def test_json_is_a_list_of_rows_or_has_defaults(tmp_path: Path) -> None:
    path = tmp_path / "t.json"
    path.write_text(json.dumps([{"input": "a.tif", "search-radius": "3"}, {"input": "b.tif"}]))
    assert read_rows(path) == ROWS
    rows = [{"input": "a.tif"}, {"input": "b.tif", "seed": 9, "model": None}]
    path.write_text(json.dumps({"defaults": {"seed": 4, "model": "affine"}, "rows": rows}))
    assert read_rows(path) == [
        {"input": "a.tif", "seed": 4, "model": "affine"},
        {"input": "b.tif", "seed": 9, "model": "affine"},
    ]


def test_yaml_reads_as_json(tmp_path: Path) -> None:
    pytest.importorskip("yaml")
    path = tmp_path / "t.yaml"
    path.write_text("defaults: {seed: 4}\nrows:\n  - input: a.tif\n  - {input: b.tif, seed: 9}\n")
    assert read_rows(path) == [{"input": "a.tif", "seed": "4"}, {"input": "b.tif", "seed": "9"}]
    path.write_text("- &a {input: a.tif, seed: 4, model: null}\n- {<<: *a, input: b.tif, seed: ~}")
    assert read_rows(path) == [{"input": "a.tif", "seed": "4"}, {"input": "b.tif"}]


@pytest.mark.parametrize(
    "name", ["NO", "on", "0123", "0x1f", "12:30:45", "2020-01-15", "1_000", "1.10", "1e3", ".inf"]
)
def test_yaml_keeps_a_text_as_it_is_written(tmp_path: Path, name: str) -> None:
    """YAML 1.1 has other values for them: NO is false, 12:30:45 a number to the base of 60."""
    pytest.importorskip("yaml")
    (tmp_path / "t.yaml").write_text(f"- name: {name}\n  inputs: [{name}, b.tif]\n")
    assert read_rows(tmp_path / "t.yaml") == [{"name": name, "inputs": [name, "b.tif"]}]


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
def test_rows_of_a_spreadsheet_without_a_value_count_for_nothing(
    tmp_path: Path, delimiter: str
) -> None:
    path = tmp_path / "t.csv"
    lines = ["", " , ", "input,search-radius", "a.tif,3", ",", " , ", "b.tif,", ",,", ""]
    path.write_text("\r\n".join(lines).replace(",", delimiter), newline="")
    assert read_rows(path) == ROWS


def test_yaml_without_its_package_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "yaml", None)
    (tmp_path / "t.yml").write_text("- input: a.tif\n")
    with pytest.raises(ParameterError, match="YAML needs the Python package PyYAML"):
        read_rows(tmp_path / "t.yml")


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("t.csv", "", "has no rows"),
        ("t.csv", "input,output\n", "has no rows"),
        ("t.csv", "input,output\n,\n", "has no rows"),
        ("t.csv", ";\n\n", "has no rows"),
        ("t.csv", "input\na.tif,b.tif\n", "row 1 has more fields"),
        ("t.csv", "input,input\na,b\n", "stands twice"),
        ("t.csv", "max-error,max_error\n1,2\n", "stands twice"),
        ("t.json", "[", "cannot read the table"),
        ("t.json", "[]", "has no rows"),
        ("t.json", "[1]", "a list of rows"),
        ("t.json", '{"rows": 3}', "a list of rows"),
        ("t.json", '{"row": []}', "rows and defaults only"),
        ("t.json", '[{"seed": NaN}]', "no finite number"),
        ("t.json", f'[{{"name": {"9" * 400}}}]', "no finite number"),
        ("t.json", f'[{{"name": {"9" * 9000}}}]', "no finite number"),
        ("t.yaml", "a: [", "cannot read the table"),
        ("t.yaml", "", "a list of rows"),
        ("t.yaml", "- !!python/object/apply:os.getcwd []", "cannot read the table"),
    ],
)
def test_what_is_no_table_is_one_line(
    tmp_path: Path, name: str, content: str, message: str
) -> None:
    if name.endswith("yaml"):
        pytest.importorskip("yaml")
    (tmp_path / name).write_text(content)
    with pytest.raises(ParameterError, match=message) as caught:
        read_rows(tmp_path / name)
    assert str(tmp_path / name) in caught.value.one_line()


def test_a_table_in_another_encoding_says_which_is_needed(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_bytes("input\nMünchen.tif\n".encode("latin-1"))
    with pytest.raises(ParameterError, match="save it as UTF-8"):
        read_rows(tmp_path / "t.csv")


def test_columns_may_be_in_capitals(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("INPUT,Max-Error\na.tif,2\n")
    assert read_rows(tmp_path / "t.csv") == [{"input": "a.tif", "max_error": "2"}]


def test_a_missing_table_is_named(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=r"none\.csv: No such file"):
        read_rows(tmp_path / "none.csv")


@pytest.mark.parametrize("digits", ["20240101123045123", "9" * 300, "-12345678901234567"])
def test_numbers_of_json_that_are_names_keep_their_digits(tmp_path: Path, digits: str) -> None:
    path = tmp_path / "t.json"
    path.write_text(f'[{{"name": {digits}}}]')
    assert [str(row["name"]) for row in read_rows(path)] == [digits]
