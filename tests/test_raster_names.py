"""What names of rasters mean."""

from __future__ import annotations

from pathlib import Path

import pytest

from groundtie.raster_names import (
    facts_behind,
    file_name,
    identity,
    is_remote,
    local_files,
    located,
    raster_name,
)

URL = "/vsicurl/https://host/a/b.tif"


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ("a/b.tif", Path("a/b.tif")),
        (Path("/a/b.tif"), Path("/a/b.tif")),
        ("https://host/a/b.tif", URL),
        # What pathlib makes of a URL.
        (Path("https://host/a/b.tif"), URL),
        (URL, URL),
        (Path(URL), URL),
        ("HTTP://host/b.tif", "/vsicurl/http://host/b.tif"),
        ("s3://bucket/b.tif", "/vsis3/bucket/b.tif"),
        ("gs://bucket/b.tif", "/vsigs/bucket/b.tif"),
        ("az://box/b.tif", "/vsiaz/box/b.tif"),
        ("file:///a/b.tif", Path("/a/b.tif")),
        ("/vsizip//vsicurl/https://host/b.zip/b.tif",) * 2,
        ('NETCDF:"a.nc":b', 'NETCDF:"a.nc":b'),
        (Path("NETCDF:a.nc"), Path("NETCDF:a.nc")),
        (r"C:\a\b.tif", Path(r"C:\a\b.tif")),
    ],
)
def test_what_a_name_means(value: str | Path, expected: str | Path) -> None:
    found = raster_name(value)
    assert (found, type(found)) == (expected, type(expected))
    assert raster_name(found) == found
    assert identity(value) == identity(found)


def test_a_file_of_that_very_name_comes_first(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("s3:").mkdir()
    Path("s3:/a.tif").touch()
    assert raster_name("s3:/a.tif") == Path("s3:/a.tif")


def test_a_file_beside_the_one_that_names_it_comes_first(tmp_path: Path) -> None:
    (tmp_path / "S1A:10.tif").touch()
    assert located("S1A:10.tif", tmp_path / "t.csv") == tmp_path / "S1A:10.tif"
    assert located("S1A:11.tif", tmp_path / "t.csv") == "S1A:11.tif"


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        (URL, True),
        ("/vsis3/bucket/b.tif", True),
        ("/vsizip//vsicurl/https://host/b.zip/b.tif", True),
        ("/vsicurl_streaming/http://host/b.tif", True),
        ("WMS:https://host/wms", True),
        ("/vsizip/b.zip/b.tif", False),
        ("/vsimem/b.tif", False),
        ("b.tif", False),
        (Path("/vsis3/b.tif"), False),
    ],
)
def test_what_is_read_over_a_network(name: str | Path, expected: bool) -> None:
    assert is_remote(name) == expected


@pytest.mark.parametrize(
    ("name", "beside", "expected"),
    [
        ("b.tif", Path("/x/item.json"), Path("/x/b.tif")),
        ("/y/b.tif", Path("/x/item.json"), Path("/y/b.tif")),
        ("https://host/a/b.tif", Path("/x/item.json"), URL),
        ("../a/b.tif", "/vsicurl/https://host/c/item.json", URL),
        ("./b.tif", "/vsicurl/https://host/a/item.json?x=/y", URL),
        ("/a/b.tif", "/vsicurl/https://host/c/item.json", URL),
        ("b.tif", "/vsis3/bucket/c/item.json", "/vsis3/bucket/c/b.tif"),
    ],
)
def test_names_beside_a_file(name: str, beside: str | Path, expected: str | Path) -> None:
    assert located(name, beside) == expected


def test_the_name_of_a_file_is_its_last_part() -> None:
    assert file_name(f"{URL}?signature=a/b") == "b.tif"
    assert file_name(Path("/a/b.tif")) == "b.tif"


@pytest.mark.parametrize(
    "name",
    [
        "{0}",
        "/vsizip/{0}/inner/b.tif",
        "/vsitar/{0}/b.tif",
        "/vsigzip/{0}",
        "/vsizip//vsitar/{0}/c.zip/b.tif",
        "/vsizip/{{{0}}}/b.tif",
        'NETCDF:"{0}":band',
        "NETCDF:{0}:band",
        'HDF5:"{0}"://group/band',
        "GTIFF_DIR:1:{0}",
        "/vsisubfile/0_10,{0}",
        "/vsicached?chunk_size=10&file={0}",
        "vrt://{0}?bands=1,1",
        "DERIVED_SUBDATASET:LOGAMPLITUDE:{0}",
    ],
)
def test_the_file_behind_one_of_gdals_names_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    file = tmp_path / "a.nc"
    file.touch()
    known = facts_behind(name.format(file))
    assert local_files(name.format(file)) == [file]
    assert known == facts_behind(name.format(file))
    file.write_bytes(b"other")
    assert known != facts_behind(name.format(file))
    assert local_files(name.format("a.nc"), tmp_path) == [file]
    monkeypatch.chdir(tmp_path)
    assert local_files(name.format("a.nc")) == [file]


def test_an_archive_may_have_the_signs_of_other_names(tmp_path: Path) -> None:
    archive = tmp_path / "a:b, {c}.zip"
    archive.touch()
    assert local_files(f"/vsizip/{archive}/b.tif") == [archive]


@pytest.mark.parametrize(
    "name", ["/vsizip/none.zip/b.tif", 'NETCDF:"none.nc":b', "/vsimem/b.tif", Path("none.tif")]
)
def test_of_what_is_no_file_nothing_is_known(name: Path | str) -> None:
    assert isinstance(name, Path) or local_files(name) == []
    assert facts_behind(name) != facts_behind(name)


def test_what_lies_on_a_server_counts_by_its_name() -> None:
    assert local_files(URL) == []
    assert facts_behind(URL) == facts_behind(URL) != facts_behind(URL.replace("b.tif", "c.tif"))
