"""The page is valid, safe, self-contained and says what its numbers say."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from affine import Affine
from html_pages import Page, picture_of
from raster_files import utm_grid, wave_image, write_raster

from groundtie.errors import OutputError
from groundtie.geometry.models import Frame, PolynomialModel
from groundtie.geometry.tie_points import TiePoints
from groundtie.geometry.transform import Transform
from groundtie.rasters.grid import PIXEL_COORDINATES, Grid
from groundtie.rasters.pair import Image, ImagePair, make_pair
from groundtie.rasters.reading import open_raster
from groundtie.registration.verdict import Verdict, refuse
from groundtie.report.report import Report, versions
from groundtie.version import __version__

GRID = utm_grid(160, 120)
# The input claims its ground to lie 70 m to the east and 40 m to the north of the truth.
SHIFT_M = np.array([70.0, 40.0])
HOSTILE = """<script>alert(1)</script>"'&{{ 7*7 }}<img src=x onerror=alert(1)>"""

ACCEPTED = Verdict(
    accepted=True,
    reason="check points confirm the registration",
    fit_points=12,
    fit_points_used=11,
    check_points=9,
    check_points_agreeing=8,
    check_rmse_px=0.61,
    check_rmse_m=6.1,
    check_ce90_px=0.93,
    check_ce90_m=9.3,
    log10_chance=-14.2,
    spread_px=0.21,
    extrapolated_share=0.18,
)


@pytest.fixture(scope="module")
def pair(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ImagePair]:
    yield from opened_pair(tmp_path_factory.mktemp("pair"), GRID, SHIFT_M)


@pytest.fixture(scope="module")
def page(pair: ImagePair, tmp_path_factory: pytest.TempPathFactory) -> Page:
    """Return the page of an accepted registration."""
    return written(report_of(pair), tmp_path_factory.mktemp("page"))


@dataclass(frozen=True)
class Variant:
    """A report, its page and its numbers."""

    report: Report
    page: Page
    numbers: dict[str, Any]


@pytest.fixture(scope="module")
def variants(pair: ImagePair, tmp_path_factory: pytest.TempPathFactory) -> list[Variant]:
    """Return a report of every stage that a registration can come to."""
    transform = transform_of(pair)
    points = points_of(pair, transform)
    folder = tmp_path_factory.mktemp("variants")
    return [
        Variant(report, written(report, folder), numbers_in(folder))
        for report in (
            report_of(pair),
            refused(pair),
            refused(pair, points=points),
            refused(pair, points=points, transform=transform),
            refused(pair, points=points.take(slice(0, 12)), transform=transform),
            refused(pair, points=points.take(slice(0, 0)), transform=transform),
            report_of(pair, parameters={}, surfaces=()),
        )
    ]


@pytest.fixture
def ungeoreferenced(tmp_path: Path) -> Iterator[ImagePair]:
    grid = Grid(PIXEL_COORDINATES, None, 160, 120)
    yield from opened_pair(tmp_path, grid, np.array([7.0, 4.0]), georeferenced=False)


def opened_pair(
    folder: Path, grid: Grid, shift: np.ndarray, georeferenced: bool = True
) -> Iterator[ImagePair]:
    """Make a pair of the same waves, the input's off by a shift in map units."""
    length = 40 * grid.pixel_size[0]
    place = {"grid": grid} if georeferenced else {}
    seen = wave_image(grid, length).astype(np.float32)
    moved = wave_image(grid.shifted(*-shift), length).astype(np.float32)
    reference = write_raster(folder / "reference.tif", seen, **place)
    input = write_raster(folder / "input.tif", moved, **place)
    with open_raster(reference) as r, open_raster(input) as i:
        yield make_pair(Image(r), Image(i))


def transform_of(pair: ImagePair, shift: np.ndarray = SHIFT_M) -> Transform:
    model = PolynomialModel("translation", Frame(Affine.identity()), shift[None])
    return Transform(model, pair.grid.crs, pair.input.source.grid)


def points_of(pair: ImagePair, transform: Transform) -> TiePoints:
    """Return 12 points of the fit, of which one is rejected, and 9 check points, one far off."""
    random = np.random.default_rng(3)
    xy = pair.grid.pixel_to_map(random.uniform([5, 5], [155, 115], (21, 2)))
    error_px = random.normal(0, 0.4, (21, 2))
    error_px[-1] = [11, -6]
    points = TiePoints(
        xy,
        transform(xy) + error_px,
        np.full(21, 9.0),
        np.tile(np.eye(2) / 20, (21, 1, 1)),
        np.zeros(21),
        np.arange(21) >= 12,
        np.full(21, "used"),
    )
    return points.reject(np.arange(21) == 4, "disagrees with the model")


def peak_surface(x: float, y: float, height: float = 9.0) -> np.ndarray:
    rows, cols = np.mgrid[-8:9, -8:9]
    return (height * np.exp(-((cols - x) ** 2 + (rows - y) ** 2) / 4)).astype(np.float32)


def report_of(pair: ImagePair, **changes: Any) -> Report:
    transform = transform_of(pair)
    report = Report(
        title="input.tif registered to reference.tif",
        verdict=ACCEPTED,
        pair=pair,
        points=points_of(pair, transform),
        transform=transform,
        surfaces=(
            ("best check point", peak_surface(1, -2)),
            ("worst check point", peak_surface(6, 3, 4.0)),
        ),
        parameters={"similarity": "fused", "max_error": 3.0},
        seconds=4.56,
    )
    return replace(report, **changes)


def refused(pair: ImagePair, **changes: Any) -> Report:
    nothing = {"points": None, "transform": None, "surfaces": ()}
    verdict = refuse("nothing in common was found")
    return report_of(pair, **{"verdict": verdict, **nothing, **changes})


def written(report: Report, folder: Path) -> Page:
    report.write(folder / "report.html", folder / "report.json")
    return Page((folder / "report.html").read_text(encoding="utf-8"))


def picture(page: Page, alt: str) -> np.ndarray:
    """Return the picture whose alternative text begins so."""
    (element,) = [e for e in page.all("img") if str(e.attributes["alt"]).startswith(alt)]
    uri = str(element.attributes["src"])
    return picture_of(uri, uri.removeprefix("data:").split(";")[0])


def numbers_in(folder: Path) -> dict[str, Any]:
    return strict((folder / "report.json").read_text(encoding="utf-8"))


def strict(text: str) -> Any:
    def refuse_constant(name: str) -> None:
        raise AssertionError(f"{name} is not JSON")

    return json.loads(text, parse_constant=refuse_constant)


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


def test_the_verdict_comes_first(page: Page) -> None:
    assert page.all("h2")[0].text == "Accepted"
    assert page.all("title")[0].text == "Accepted: input.tif registered to reference.tif"
    assert "Check points confirm the registration." in page.text
    assert page.numbers == {
        "Error at check points (RMSE)": "0.61 px 6.10 m",
        "90 % of errors within (CE90)": "0.93 px 9.30 m",
        "Check points that agree": "8 of 9",
        "Agreement by chance": "1 in 1014",  # 10 to the 14th: the exponent is raised
        "Points used in the fit": "11 of 12",
        "Model": "translation",
        "Uncertainty of the model": "0.21 px 2.10 m",
        "Extrapolated": "18 % of the overlap",
    }
    assert [e.text for e in page.all("sup")] == ["14"]
    assert "90 % of right matches lie within 0.93 px (9.30 m) of where" in page.text
    assert "18 % of the overlap lies outside" in page.text


@pytest.mark.slow
def test_a_covered_overlap_is_not_said_to_be_extrapolated(pair: ImagePair, tmp_path: Path) -> None:
    verdict = replace(ACCEPTED, extrapolated_share=0.0)
    page = written(report_of(pair, verdict=verdict), tmp_path)
    assert "surround the whole overlap" in page.text
    assert "lies outside" not in page.text


@pytest.mark.slow
@pytest.mark.parametrize(
    ("log10_chance", "shown"),
    [(-math.inf, "< 1 in 10300"), (-3.4, "1 in 103"), (-0.5, "32 %"), (0.0, "100 %")],
)
def test_how_chance_is_said(
    pair: ImagePair, tmp_path: Path, log10_chance: float, shown: str
) -> None:
    verdict = replace(ACCEPTED, log10_chance=log10_chance)
    page = written(report_of(pair, verdict=verdict), tmp_path)
    assert page.numbers["Agreement by chance"] == shown


def test_the_correction_is_the_injected_shift(page: Page) -> None:
    length = np.hypot(7, 4)
    assert f"moves the input by {length:.1f} px ({10 * length:.1f} m) at the centre" in page.text
    assert f"by {length:.1f} to {length:.1f} px over the grid" in page.text


def test_pictures_before_and_after(page: Page) -> None:
    reference = picture(page, "Overview of the reference image reference.tif").astype(float)
    claimed = picture(page, "Overview of the input image input.tif where it claims").astype(float)
    registered = picture(page, "Overview of the input image input.tif as registered").astype(float)
    inside = np.s_[15:-15, 15:-15]
    assert reference.shape == claimed.shape == registered.shape == (120, 160)

    def likeness(image: np.ndarray) -> float:
        return float(np.corrcoef(image[inside].ravel(), reference[inside].ravel())[0, 1])

    assert likeness(registered) > 0.99
    assert likeness(claimed) < 0.9


def test_the_viewer_can_be_used_by_keyboard(page: Page) -> None:
    inputs = page.all("input")
    kinds = [(e.attributes["type"], e.attributes.get("name")) for e in inputs]
    assert kinds == [("range", None), *[("radio", "mode")] * 3, *[("radio", "state")] * 2]
    (viewer,) = [e for e in page.all("figure") if e.attributes.get("class") == "viewer"]
    checked = {
        e.attributes["name"]: e.attributes["value"] for e in inputs if "checked" in e.attributes
    }
    # Every state that can be chosen has its style.
    assert checked == {
        "mode": viewer.attributes["data-mode"],
        "state": viewer.attributes["data-state"],
    }
    style = page.all("style")[0].text
    for name in ("mode", "state"):
        values = [e.attributes["value"] for e in inputs if e.attributes.get("name") == name]
        assert all(f'[data-{name}="{value}"]' in style for value in values)


def test_figures_of_errors(page: Page) -> None:
    alts = [str(e.attributes["alt"]) for e in page.all("img")]
    assert any("11 of 12 points used in the fit, 8 of 9 check points agree" in a for a in alts)
    assert any(a.startswith("Histogram") and "RMSE 0.61 px, CE90 0.93 px" in a for a in alts)
    assert any("a circle of radius 0.93 px, the CE90" in a for a in alts)
    # The figures reach to 3 px; one check point is 12.5 px off.
    assert "the 9 check points that were matched" in page.text
    assert "1 more than 3.0 px are not shown" in page.text


def test_surfaces_show_their_peaks(page: Page) -> None:
    assert picture(page, "Similarity surface: best check point").shape == (17, 17, 3)
    peaks = [e.attributes for e in page.all("circle") if e.attributes.get("class") == "peak"]
    # Pixel (col, row) = (8 + 1, 8 - 2) has its centre half a pixel further.
    assert [(p["cx"], p["cy"]) for p in peaks] == [("9.50", "6.50"), ("14.50", "11.50")]
    assert "± 8 px; peak 9.0 σ at (1.0, -2.0) px" in page.text


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
    page = written(report_of(pair, parameters={"bins": None, "seed": 7}), tmp_path)
    rows = dict(
        zip((e.text for e in page.all("th")), (e.text for e in page.all("td")), strict=True)
    )
    assert rows == {"bins": "–", "seed": "7", **versions(), "time": "4.6 s"}
    assert [e.text for e in page.all("caption")] == ["Parameters", "Versions and time"]


def test_versions() -> None:
    found = versions()
    assert list(found) == ["groundtie", "python", "numpy", "scipy", "opencv", "rasterio", "gdal"]
    assert found["groundtie"] == __version__
    assert found["numpy"] == np.__version__
    assert all(re.match(r"\d+\.\d+", version) for version in found.values())


def test_the_json_is_the_summary(variants: list[Variant]) -> None:
    for variant in variants:
        assert variant.numbers == variant.report.summary()
        keys = ["verdict", "transform", "mask", "parameters", "versions", "seconds"]
        assert list(variant.numbers) == keys
        assert variant.numbers["verdict"] == variant.report.verdict.summary()


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
    assert set(page.numbers.values()) == {"–", "0 of 0"}
    headings = [e.text for e in page.all("h2")]
    assert headings == ["Refused", "The images as claimed", "How it was made"]
    assert not [e for e in page.all("input") if e.attributes.get("name") == "state"]
    assert len(page.all("img")) == 2
    assert numbers_in(tmp_path)["transform"] is None


def test_refused_with_points_only(pair: ImagePair, tmp_path: Path) -> None:
    page = written(refused(pair, points=points_of(pair, transform_of(pair))), tmp_path)
    assert "Tie points on the map" in [e.text for e in page.all("h2")]
    assert "times as long" not in page.text
    assert "Errors at check points" not in [e.text for e in page.all("h2")]


def test_refused_with_a_transform(pair: ImagePair, tmp_path: Path) -> None:
    transform = transform_of(pair)
    page = written(refused(pair, points=points_of(pair, transform), transform=transform), tmp_path)
    assert "the transform shown here must not be used" in page.text
    assert "after (refused transform)" in page.text
    assert "Random matches fill the search window evenly." in page.text
    # All check points are within the figures, as no error was measured.
    assert "not shown in either" not in page.text


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
    with pytest.raises(OutputError, match=r"cannot write .*nowhere/report\.html"):
        report_of(pair).write(tmp_path / "nowhere" / "report.html", tmp_path / "report.json")
    with pytest.raises(OutputError, match=r"cannot write .*nowhere/report\.json"):
        report_of(pair).write(tmp_path / "report.html", tmp_path / "nowhere" / "report.json")


def test_the_template_is_found_from_everywhere(
    pair: ImagePair, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert written(report_of(pair), tmp_path).all("style")[0].text.strip()
