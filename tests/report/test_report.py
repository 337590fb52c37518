"""The page is valid, safe, self-contained and says what its numbers say."""

from __future__ import annotations

import json
import math
import os
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from known_reports import (
    ACCEPTED,
    GRID,
    HOSTILE,
    SHIFT_M,
    Variant,
    numbers_in,
    opened_pair,
    peak_surface,
    points_of,
    refused,
    report_of,
    strict,
    transform_of,
    written,
)
from raster_files import full_disk, utm_grid, wave_image, write_raster

from groundtie.errors import OutputError
from groundtie.geometry.transform import Transform
from groundtie.kinds import REPORT_FORMAT
from groundtie.rasters.atomic import Outputs
from groundtie.rasters.pair import Image, ImagePair, make_pair
from groundtie.rasters.reading import open_raster
from groundtie.report.page import versions
from groundtie.version import __version__


@pytest.mark.slow
def test_every_report_is_a_well_formed_page(variants: list[Variant]) -> None:
    for page in (variant.page for variant in variants):
        assert page.source.startswith('<!DOCTYPE html>\n<html lang="en">')
        assert len(page.all("h1")) == len(page.all("main")) == len(page.all("title")) == 1
        ids = [e.attributes["id"] for e in page.elements if "id" in e.attributes]
        assert len(set(ids)) == len(ids)
        labelled = [e.attributes["aria-labelledby"] for e in page.all("section")]
        assert labelled == ids
        assert all("alt" in e.attributes for e in page.all("img"))
        assert "{{" not in page.text
        assert "{%" not in page.text


def test_every_report_is_self_contained(variants: list[Variant]) -> None:
    for page in (variant.page for variant in variants):
        for element in page.elements:
            for name in ("src", "href", "srcset", "data", "action", "poster"):
                assert str(element.attributes.get(name, "data:")).startswith("data:")
        assert "//" not in re.sub(r"data:[^\"]*", "", page.source).replace("://", "//x")
        assert "@import" not in page.source
        assert not page.all("link", "iframe", "object", "embed", "base")
        policy = [e.attributes.get("content") or "" for e in page.all("meta")]
        assert any(content.startswith("default-src 'none'; img-src data:;") for content in policy)


def test_names_and_values_are_escaped(tmp_path: Path, pair: ImagePair) -> None:
    label = f"<b>{HOSTILE}"
    report = report_of(
        pair,
        title=HOSTILE,
        verdict=replace(ACCEPTED, reason=HOSTILE),
        surfaces=((label, peak_surface(0, 0)),),
        parameters={HOSTILE: HOSTILE, "path": Path("<i>/x.tif")},
    )
    page = written(report, tmp_path)
    assert len(page.all("script")) == 1
    assert not page.all("i")
    assert not any("onerror" in e.attributes for e in page.elements)
    assert page.all("h1")[0].text == HOSTILE
    assert page.all("title")[0].text == f"Accepted: {HOSTILE}"
    assert [e.attributes["alt"] for e in page.all("img")][-1] == f"Similarity surface: {label}"
    assert {HOSTILE, "path"} <= {e.text for e in page.all("th")}
    assert {HOSTILE, "<i>/x.tif"} <= {e.text for e in page.all("td")}


@pytest.mark.slow
def test_file_names_are_escaped(tmp_path: Path) -> None:
    name = "<u>&\"'.tif"
    values = wave_image(GRID, 400).astype(np.float32)
    reference = write_raster(tmp_path / name, values, GRID)
    input = write_raster(tmp_path / "input.tif", values, GRID)
    with open_raster(reference) as r, open_raster(input) as i:
        page = written(report_of(make_pair(Image(r), Image(i))), tmp_path)
    assert not page.all("u")
    assert page.all("img")[0].attributes["alt"] == f"Overview of the reference image {name}"


def test_parameters_and_versions_are_shown(pair: ImagePair, tmp_path: Path) -> None:
    page = written(refused(pair, parameters={"bins": None, "seed": 7}), tmp_path)
    rows = dict(
        zip((e.text for e in page.all("th")), (e.text for e in page.all("td")), strict=True)
    )
    assert rows == {"seed": "7", **versions(), "time": "4.6 s"}
    assert [e.text for e in page.all("caption")] == ["Parameters", "Versions and time"]


def test_versions() -> None:
    found = versions()
    assert list(found) == ["groundtie", "python", "numpy", "scipy", "opencv", "rasterio", "gdal"]
    assert found["groundtie"] == __version__
    assert found["numpy"] == np.__version__
    assert all(re.match(r"\d+\.\d+", version) for version in found.values())


def test_the_json_is_the_summary(variants: list[Variant]) -> None:
    for variant in variants:
        assert variant.numbers == {"format": REPORT_FORMAT, **variant.report.summary()}
        assert list(variant.numbers) == [
            *("format", "verdict", "correction", "transform", "mask"),
            *("notes", "scene", "parameters", "versions", "seconds"),
        ]
        assert variant.numbers["verdict"] == variant.report.registration.verdict.summary()


def test_the_transform_comes_back_from_the_json(pair: ImagePair, variants: list[Variant]) -> None:
    xy = pair.grid.pixel_to_map([[3.0, 4.0]])
    back = Transform.from_json(variants[0].numbers["transform"])
    np.testing.assert_allclose(back(xy), transform_of(pair)(xy), atol=1e-9)


def test_what_json_cannot_carry(pair: ImagePair) -> None:
    parameters = {
        "path": Path("a/b.tif"),
        "nan": math.nan,
        "infinite": np.float32("inf"),
        "count": np.int64(3),
        "share": np.float64(0.5),
        "array": np.array([[1.0, np.nan]]),
        "flags": (True, None),
        3: {"deep": [np.bool_(True), "text"]},
    }
    verdict = replace(ACCEPTED, log10_chance=-math.inf, spread_px=math.inf)
    summary = report_of(pair, parameters=parameters, verdict=verdict).summary()
    assert strict(json.dumps(summary)) == summary
    assert summary["parameters"] == {
        "path": "a/b.tif",
        "nan": None,
        "infinite": None,
        "count": 3,
        "share": 0.5,
        "array": [[1.0, None]],
        "flags": [True, None],
        "3": {"deep": [True, "text"]},
    }
    assert (summary["verdict"]["log10_chance"], summary["verdict"]["spread_px"]) == (None, None)


def test_refused_without_a_transform(pair: ImagePair, tmp_path: Path) -> None:
    page = written(refused(pair), tmp_path)
    assert page.all("h2")[0].text == "Refused"
    assert page.all("title")[0].text.startswith("Refused: ")
    assert "Nothing in common was found." in page.text
    assert "No registered image was written: there is no transform." in page.text
    assert page.numbers == {}  # Nothing was matched: there is nothing to count.
    headings = [e.text for e in page.all("h2")]
    assert headings == ["Refused", "The images at their nominal positions", "How it was made"]
    assert not [e for e in page.all("input") if e.attributes.get("name") == "state"]
    assert len(page.all("img")) == 2
    assert numbers_in(tmp_path)["transform"] is None


@pytest.mark.slow
def test_refused_with_a_transform(pair: ImagePair, tmp_path: Path) -> None:
    transform = transform_of(pair)
    page = written(refused(pair, points=points_of(pair, transform), transform=transform), tmp_path)
    assert "the transform shown here must not be used" in page.text
    assert "after (refused transform)" in page.text
    assert "Random matches fill the search window evenly." in page.text
    # All check points are within the figures, as no error was measured.
    assert "Not in either figure" not in page.text


@pytest.mark.slow
def test_without_georeferencing_there_are_no_metres(
    ungeoreferenced: ImagePair, tmp_path: Path
) -> None:
    transform = transform_of(ungeoreferenced, np.array([7.0, 4.0]))
    report = report_of(
        ungeoreferenced, transform=transform, points=points_of(ungeoreferenced, transform)
    )
    page = written(report, tmp_path)
    assert "have no georeferencing: all distances are in pixels" in page.text
    assert page.numbers["Error at check points (RMSE)"] == "0.61 px"
    assert not re.search(r"\d m\b", page.text)
    assert not any("metres" in str(e.attributes.get("alt")) for e in page.all("img"))


@pytest.mark.slow
def test_map_units_without_a_crs_are_said_to_be_taken_for_metres(tmp_path: Path) -> None:
    grid = replace(GRID, crs=None)
    for pair in opened_pair(tmp_path, grid, SHIFT_M):
        page = written(report_of(pair), tmp_path)
    assert "their map units are taken for metres" in page.text
    assert page.numbers["Error at check points (RMSE)"] == "0.61 px 6.10 m"


@pytest.mark.slow
def test_notes_on_the_images_are_shown(tmp_path: Path) -> None:
    values = wave_image(GRID, 400).astype(np.complex64)
    reference = write_raster(tmp_path / "slc.tif", values, GRID)
    input = write_raster(tmp_path / "input.tif", values.real, GRID)
    with open_raster(reference) as r, open_raster(input) as i:
        page = written(report_of(make_pair(Image(r), Image(i))), tmp_path)
    assert "slc.tif is complex-valued: its amplitude is matched." in page.text


@pytest.mark.slow
def test_the_page_is_small_even_for_large_noisy_images(tmp_path: Path) -> None:
    grid = utm_grid(1200, 1200)
    noise = np.random.default_rng(0).integers(0, 255, (1200, 1200)).astype(np.uint8)
    reference = write_raster(tmp_path / "reference.tif", noise, grid)
    input = write_raster(tmp_path / "input.tif", noise[::-1], grid)
    with open_raster(reference) as r, open_raster(input) as i:
        written(report_of(make_pair(Image(r), Image(i))), tmp_path)
    assert (tmp_path / "report.html").stat().st_size < 2_000_000


@pytest.mark.slow
def test_a_report_that_cannot_be_written(pair: ImagePair, tmp_path: Path) -> None:
    (tmp_path / "report.html").write_text("old")
    full = full_disk(2000)
    with pytest.raises(OutputError, match=r"cannot write .*/report\."), full, Outputs() as outputs:
        report_of(pair).write(outputs, tmp_path / "report.html")
    assert (tmp_path / "report.html").read_text() == "old"
    assert os.listdir(tmp_path) == ["report.html"]


@pytest.mark.slow
def test_the_template_is_found_from_everywhere(
    pair: ImagePair, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert written(report_of(pair), tmp_path).all("style")[0].text.strip()
