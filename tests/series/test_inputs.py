"""What a series may be named by."""

from __future__ import annotations

import datetime
import json
from pathlib import Path
from typing import Any

import pytest

from groundtie.errors import ParameterError
from groundtie.registration.user_masks import UserMask
from groundtie.series.inputs import list_dates, rasters_behind, time_of
from groundtie.stac_items import stated_time

DAY = datetime.datetime(2020, 3, 4)


def touched(folder: Path, *names: str) -> list[Path]:
    folder.mkdir(exist_ok=True)
    paths = [folder / name for name in names]
    for path in paths:
        path.touch()
    return paths


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("S2A_20200304T101", DAY),
        ("a-2020-03-04-b", DAY),
        ("2020_03_04", DAY),
        ("2020-03-04T00:00:00Z", DAY),
        ("2020-03-04T02:00:00+02:00", DAY),
        ("20200304_180030", datetime.datetime(2020, 3, 4, 18, 0, 30)),
        ("2020-03-04_18:00", datetime.datetime(2020, 3, 4, 18)),
        ("1985", datetime.datetime(1985, 1, 1)),
        ("0001", None),
        ("m_4709963_se_14_1_20100629", datetime.datetime(2010, 6, 29)),
        ("20200230", None),
        ("4709963", None),
        ("image", None),
    ],
)
def test_times_in_names(text: str, expected: datetime.datetime | None) -> None:
    assert time_of(text) == expected


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("2020", datetime.datetime(2020, 1, 1)),
        ("2020-03", datetime.datetime(2020, 3, 1)),
        ("20200304", DAY),
        (" 2020-03-04 ", DAY),
        ("2020-03-04T10", DAY.replace(hour=10)),
        ("2020-03-04 10:20", DAY.replace(hour=10, minute=20)),
        ("20200304T102030Z", DAY.replace(hour=10, minute=20, second=30)),
        ("2020-03-04T10:20:30.5Z", datetime.datetime(2020, 3, 4, 10, 20, 30, 500_000)),
        # Nanoseconds, as catalogues have them, are cut off.
        ("2020-03-04T10:20:30.123456789Z", datetime.datetime(2020, 3, 4, 10, 20, 30, 123_456)),
        ("2020-03-03T22:30:00-01:30", DAY),
        ("2020-03-04T02+02", DAY),
    ],
)
def test_stated_times(text: str, expected: datetime.datetime) -> None:
    assert stated_time(text) == expected


NO_TIMES = (
    "15.06.2020",
    "2020-1-5",
    "2020-13-45",
    "2020-00-05",
    "2020-0304",
    "202003",
    "2020-02-30",
    "2020-01-15T99:00",
    "2020-01-15T10:00:00+99:00",
    "2020-01-15 at noon",
    "S2A_20200304T101",
    "0001-01-01T00:00+01:00",
)


@pytest.mark.parametrize("text", NO_TIMES)
def test_what_is_not_wholly_a_time_is_none(text: str, tmp_path: Path) -> None:
    """A day or a year within it might be another one than was meant."""
    assert stated_time(text) is None
    table = tmp_path / "dates.csv"
    table.write_text(f"file,time\nx.tif,{text}\n")
    with pytest.raises(ParameterError, match=r"row 1: '.*' is no time \(ISO 8601\)"):
        list_dates([table], None)
    found = {**item(1, red={"href": "r.tif"}), "properties": {"datetime": text}}
    path = tmp_path / "item.json"
    path.write_text(json.dumps(found))
    with pytest.raises(ParameterError, match=r"item-1: '.*' is no time \(ISO 8601\)"):
        list_dates([path], None)


def test_files_folders_and_patterns_are_one_list_in_time(tmp_path: Path) -> None:
    (late,) = touched(tmp_path, "b_20210101.tif")
    touched(tmp_path / "more", "a_20200101.TIF", "c_20220101.jp2", "notes.txt")
    found = list_dates([late, tmp_path / "more", tmp_path / "*.tif"], None)
    assert [date.name for date in found] == ["a_20200101", "b_20210101", "c_20220101"]


def test_without_all_times_the_order_is_that_of_the_inputs(tmp_path: Path) -> None:
    paths = touched(tmp_path, "z_20220101.tif", "b.tif", "a_20200101.tif")
    assert [date.raster for date in list_dates(paths, None)] == paths


def test_a_table_names_its_files_from_where_it_lies(tmp_path: Path) -> None:
    table = tmp_path / "dates.csv"
    table.write_text("file,name,time,mask\nx/a.tif,first,2020-03-04,m.tif\n/b.tif,,,\n")
    first, second = list_dates([table], None)
    assert (first.name, first.raster, first.time) == ("first", tmp_path / "x/a.tif", DAY)
    assert first.mask == UserMask(tmp_path / "m.tif")
    assert (second.name, second.raster, second.mask) == ("b", Path("/b.tif"), None)


def test_masks_beside_images_are_theirs_and_no_dates(tmp_path: Path) -> None:
    names = [
        f"T32TQM_202{year}0704T101031_{kind}.jp2"
        for year in (0, 1)
        for kind in ("B08_10m", "SCL_20m")
    ]
    paths = touched(tmp_path / "dates", *names)
    found = list_dates([tmp_path / "dates"], None)
    assert [date.raster for date in found] == paths[::2]
    assert [date.mask.mask for date in found if date.mask is not None] == paths[1::2]
    assert all(date.mask is not None and date.mask.values == "scl" for date in found)


def test_a_table_states_the_values_of_its_masks(tmp_path: Path) -> None:
    image, scl = touched(
        tmp_path, "T32TQM_20200704T101031_B08_10m.jp2", "T32TQM_20200704T101031_SCL_20m.jp2"
    )
    table = tmp_path / "dates.csv"
    rows = [f"{image.name},a,,none", f'b.tif,b,{scl.name},"3,8-10"', "c.tif,c,clouds.gpkg,inside"]
    table.write_text("file,name,mask,mask_values\n" + "\n".join(rows) + "\n")
    assert [date.mask for date in list_dates([table], None)] == [
        None,
        UserMask(scl, "3,8-10"),
        UserMask(tmp_path / "clouds.gpkg", "inside"),
    ]


@pytest.mark.parametrize(("mask", "values"), [("m.tif", "clouds"), ("", "scl"), ("m.gpkg", "3")])
def test_values_that_no_mask_has_name_their_row(tmp_path: Path, mask: str, values: str) -> None:
    table = tmp_path / "dates.csv"
    table.write_text(f"file,mask,mask_values\na.tif,,\nb.tif,{mask},{values}\n")
    with pytest.raises(ParameterError, match=r"dates\.csv, row 2: .*value"):
        list_dates([table], None)


def item(number: int, **assets: Any) -> dict[str, Any]:
    return {
        "type": "Feature",
        "stac_version": "1.0.0",
        "id": f"item-{number}",
        "properties": {"datetime": f"2020-0{number}-04T00:00:00Z"},
        "assets": assets,
    }


TIFF = "image/tiff; application=geotiff; profile=cloud-optimized"


def test_stac_items(tmp_path: Path) -> None:
    items = [
        item(4, red={"href": "4/red.tif", "type": TIFF}, quick={"href": "q.png"}),
        item(3, red={"href": "https://host/red.tif"}, thumb={"href": "t.png", "type": "image/png"}),
    ]
    path = tmp_path / "items.json"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": items}))
    for asset in (None, "red"):
        first, second = list_dates([path], asset)
        assert (first.name, first.raster) == ("item-3", "/vsicurl/https://host/red.tif")
        assert first.time == DAY
        assert (second.name, second.raster) == ("item-4", tmp_path / "4/red.tif")


def test_an_asset_must_be_named_where_there_are_several(tmp_path: Path) -> None:
    path = tmp_path / "item.json"
    path.write_text(json.dumps(item(1, red={"href": "r.tif"}, blue={"href": "b.tif"})))
    with pytest.raises(ParameterError, match=r"as item.json#NAME: blue, red"):
        list_dates([path], None)
    with pytest.raises(ParameterError, match="no asset green"):
        list_dates([path], "green")


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("none.tif", None, "there is no file"),
        ("none*.tif", None, "no file matches"),
        ("a.csv", "path\nx.tif\n", "row 1: no file"),
        ("a.csv", "file,time\nx.tif,soon\n", "row 1: 'soon' is no time"),
        ("a.csv", "file,time\n,2020-01-01\n", "row 1: no file"),
        ("a.json", "[]", "is no STAC item"),
        ("a.json", "{", "cannot read the STAC file"),
        ("a.json", '{"type": "Feature"}', "is no STAC item: 'assets' is missing"),
        ("a.json", '{"type": "FeatureCollection", "features": [1]}', "is no STAC item"),
    ],
)
def test_what_is_no_date_is_one_line(
    tmp_path: Path, name: str, content: str | None, message: str
) -> None:
    path = tmp_path / name
    if content is not None:
        path.write_text(content)
    with pytest.raises(ParameterError, match=message) as caught:
        list_dates([path], None)
    assert "\n" not in caught.value.one_line()


def test_an_empty_folder_and_two_dates_of_one_name(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="holds no raster"):
        list_dates([tmp_path], None)
    touched(tmp_path / "x", "a.tif")
    touched(tmp_path / "y", "a.tif")
    with pytest.raises(ParameterError, match="two dates are called a"):
        list_dates([tmp_path / "x", tmp_path / "y"], None)


IMPOSSIBLE = ["a\0b.tif", "a%00b.tif", "x/a\0/b.tif", "\ud800.tif"]


@pytest.mark.parametrize("href", IMPOSSIBLE)
def test_an_asset_that_no_file_can_be_is_one_line(tmp_path: Path, href: str) -> None:
    path = tmp_path / "item.json"
    path.write_text(json.dumps(item(1, red={"href": href, "type": TIFF})))
    with pytest.raises(ParameterError, match=r"what .*item\.json names has a name that"):
        list_dates([path], None)
    assert set(rasters_behind(path)) == {path}


def test_an_asset_that_no_file_can_be_costs_no_other(tmp_path: Path) -> None:
    path = tmp_path / "item.json"
    odd = {"href": "https://h/x%00.png", "type": "image/png"}
    worse = {"href": "x%00.png", "type": "image/png"}
    path.write_text(json.dumps(item(1, odd=odd, worse=worse, red={"href": "a.tif", "type": TIFF})))
    (tmp_path / "a.tif").touch()
    (date,) = list_dates([path], None)
    assert date.raster == tmp_path / "a.tif"
    assert tmp_path / "a.tif" in rasters_behind(path)


@pytest.mark.parametrize("column", ["file", "mask"])
def test_a_tables_file_that_no_file_can_be_is_one_line(tmp_path: Path, column: str) -> None:
    path = tmp_path / "dates.csv"
    row = {"file": "a.tif", "mask": "m.tif", column: "x/a\0/b.tif"}
    path.write_text(f"file,mask\n{row['file']},{row['mask']}\n")
    with pytest.raises(ParameterError, match=r"what .*dates\.csv names has a name that|NUL"):
        list_dates([path], None)
    assert path in rasters_behind(path)


def test_a_date_whose_name_is_no_text_is_one_line(tmp_path: Path) -> None:
    """It could stand in no table of results."""
    path = tmp_path / "item.json"
    named = {**item(1, red={"href": "a.tif", "type": TIFF}), "id": "a\udcff"}
    path.write_text(json.dumps(named))
    with pytest.raises(ParameterError, match="not UTF-8"):
        list_dates([path], None)
    (tmp_path / "d").mkdir()
    (tmp_path / "d" / "a\udcff.tif").touch()
    with pytest.raises(ParameterError, match="not UTF-8"):
        list_dates([tmp_path / "d"], None)


@pytest.mark.parametrize("name", ["../a", "x/a", "x\\a", "/a", ".", "..", "a\0"])
@pytest.mark.parametrize("source", ["table", "item"])
def test_a_name_that_leads_out_of_the_folder_is_refused(
    tmp_path: Path, name: str, source: str
) -> None:
    """A raster is written under each date's name."""
    if source == "table":
        path = tmp_path / "dates.csv"
        path.write_text(f"file,name\nb.tif,fine\na.tif,{name}\n")
    else:
        path = tmp_path / "item.json"
        named = {**item(1, red={"href": "a.tif", "type": TIFF}), "id": name}
        path.write_text(json.dumps(named))
    with pytest.raises(ParameterError, match=r"a\.tif .*cannot name a file") as caught:
        list_dates([path], None)
    assert caught.value.one_line().isprintable()


def test_dots_within_a_name_lead_nowhere(tmp_path: Path) -> None:
    table = tmp_path / "dates.csv"
    table.write_text("file,name\na.tif,v1.2..b\nb.tif,...\n")
    assert [date.name for date in list_dates([table], None)] == ["v1.2..b", "..."]


def test_a_file_that_two_rows_name_differently_is_refused(tmp_path: Path) -> None:
    table = tmp_path / "dates.csv"
    table.write_text("file,name\na.tif,first\nb.tif,other\n./a.tif,second\n")
    with pytest.raises(ParameterError, match=r"a\.tif is called first and second"):
        list_dates([table], None)
    (path,) = touched(tmp_path / "x", "c.tif")
    table.write_text("file,name\nx/c.tif,first\n")
    with pytest.raises(ParameterError, match="is called c and first"):
        list_dates([path.parent, table], None)


def test_a_file_that_is_named_again_as_it_was_is_one_date(tmp_path: Path) -> None:
    """What the table names, the folder only holds."""
    (path,) = touched(tmp_path / "x", "c.tif")
    table = tmp_path / "dates.csv"
    table.write_text("file,name\nx/c.tif,first\nx/c.tif,first\n")
    assert [date.name for date in list_dates([table, path.parent, path], None)] == ["first"]
    assert [date.name for date in list_dates([path.parent, path], None)] == ["c"]
