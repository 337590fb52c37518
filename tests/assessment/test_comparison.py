"""Swipe and checkerboard show reference and registered input, and the page of an assessment."""

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
from raster_files import UTM, utm_grid, wave_image, write_raster
from rasterio.crs import CRS

from groundtie.arrays import Raster
from groundtie.assessment.accuracy import Assessment
from groundtie.assessment.comparison import Comparison, compare
from groundtie.assessment.point_errors import PointErrors
from groundtie.errors import GeoreferencingError, NoOverlapError, OutputError
from groundtie.geometry.models import Frame, PolynomialModel
from groundtie.geometry.transform import Transform
from groundtie.kinds import REPORT_FORMAT
from groundtie.rasters.atomic import Outputs
from groundtie.rasters.grid import Grid
from groundtie.rasters.pair import Image, make_pair
from groundtie.rasters.reading import RasterSource, open_raster
from groundtie.report.assessment_report import AssessmentReport

GRID = utm_grid(160, 120)
SHIFT_M = np.array([70.0, 40.0])
LENGTH_M = 400.0
LONLAT = CRS.from_epsg(4326)
HOSTILE = """<script>alert(1)</script>"'&{{ 7*7 }}<img src=x onerror=alert(1)>"""


def shifted(shift: np.ndarray, grid: Grid = GRID, crs: CRS | None = UTM) -> Transform:
    model = PolynomialModel("translation", Frame(Affine.identity()), np.array([shift], float))
    return Transform(model, crs, grid)


@dataclass(frozen=True)
class Opened:
    """A pair of the same waves; the input claims to lie off by SHIFT_M."""

    reference: RasterSource
    input: RasterSource


@pytest.fixture(scope="module")
def opened(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Opened]:
    folder = tmp_path_factory.mktemp("pair")
    seen = wave_image(GRID, LENGTH_M).astype(np.float32)
    moved = wave_image(GRID.shifted(*-SHIFT_M), LENGTH_M).astype(np.float32)
    reference = write_raster(folder / "reference.tif", seen, GRID)
    input = write_raster(folder / "input.tif", moved, GRID)
    with open_raster(reference) as r, open_raster(input) as i:
        yield Opened(r, i)


def grey(uri: str | None) -> np.ndarray:
    assert uri is not None
    return picture_of(uri, "image/jpeg").astype(float)


def likeness(one: np.ndarray, other: np.ndarray) -> float:
    inside = np.s_[10:-10, 10:-10]
    return float(np.corrcoef(one[inside].ravel(), other[inside].ravel())[0, 1])


class TestComparison:
    @pytest.mark.parametrize("shift", [0.0, 0.3, -5.0])
    @pytest.mark.parametrize("wests", [(-180, -180), (-180, 0), (0, -180), (-90, 0)])
    def test_the_whole_earth_is_shown_whole(self, wests: tuple[int, int], shift: float) -> None:
        """Outlines that a few thousandths of a degree took across 180° left out a twentieth."""
        values = np.random.default_rng(0).uniform(size=(2, 90, 180))
        places = [Affine(2, 0, west, 0, -2, 90) for west in wests]
        reference, input = (
            open_raster(Raster(image, place, LONLAT))
            for image, place in zip(values, places, strict=True)
        )
        transform = shifted(np.array([shift, 0.0]), input.grid, LONLAT)
        assert compare(reference, input, transform).width == 180

    def test_the_registered_input_looks_like_the_reference(self, opened: Opened) -> None:
        found = compare(opened.reference, opened.input, shifted(SHIFT_M))
        reference = grey(found.reference)
        assert reference.shape == (found.height, found.width)
        assert likeness(grey(found.registered), reference) > 0.99
        assert likeness(grey(found.nominal), reference) < 0.9
        assert (found.reference_name, found.input_name) == ("reference.tif", "input.tif")

    def test_it_shows_where_they_overlap_as_registered(self, opened: Opened) -> None:
        """The input lies 7 px to the left of and 4 px below where it claims to be."""
        found = compare(opened.reference, opened.input, shifted(SHIFT_M))
        assert (found.width, found.height) == (160 - 7, 120 - 4)
        assert likeness(grey(found.reference), wave_image(GRID, LENGTH_M)[4:, : 160 - 7]) > 0.99

    def test_what_does_not_overlap_nominally_may_do_so_as_registered(
        self, tmp_path: Path, opened: Opened
    ) -> None:
        away = np.array([5_000.0, 9_000.0])
        far = write_raster(
            tmp_path / "far.tif", wave_image(GRID, LENGTH_M).astype(np.float32),
            GRID.shifted(*away),
        )  # fmt: skip
        with open_raster(far) as source:
            found = compare(opened.reference, source, shifted(away, source.grid))
            assert likeness(grey(found.registered), grey(found.reference)) > 0.99
            # Where it claims to be there is nothing: light grey.
            assert np.unique(np.rint(grey(found.nominal))).tolist() == [226]

    def test_a_transform_on_another_map(self, opened: Opened) -> None:
        """The transform's map is in degrees, the reference in UTM; nothing is off."""
        nominal = Transform.nominal(LONLAT, GRID)
        moved = replace(nominal, input_grid=GRID.shifted(*-SHIFT_M))
        found = compare(opened.reference, opened.input, moved)
        assert likeness(grey(found.registered), grey(found.reference)) > 0.99
        # The footprint in degrees is not aligned, which may take a pixel more.
        assert abs(found.width - (160 - 7)) <= 1

    def test_without_a_transform_the_pair_is_shown_as_nominal(self, opened: Opened) -> None:
        pair = make_pair(Image(opened.reference), Image(opened.input))
        found = Comparison.of(pair, None)
        assert found.registered is None
        assert likeness(grey(found.nominal), grey(found.reference)) < 0.9
        assert grey(found.backdrop).min() > 140

    def test_images_that_do_not_meet_as_registered(self, opened: Opened) -> None:
        with pytest.raises(NoOverlapError, match=r"input\.tif, as registered, misses .*reference"):
            compare(opened.reference, opened.input, shifted(np.array([90_000.0, 0.0])))

    def test_only_one_has_a_crs(self, opened: Opened) -> None:
        with pytest.raises(GeoreferencingError, match=r"only one of .*reference\.tif and the tra"):
            compare(opened.reference, opened.input, shifted(SHIFT_M, crs=None))


def errors(bias: Any, count: int = 12, std: float = 0.3) -> PointErrors:
    """Return errors with this mean and standard deviation in pixels of 10 m."""
    random = np.random.default_rng(0)
    noise = random.normal(size=(count, 2))
    noise = (noise - noise.mean(axis=0)) / noise.std(axis=0) * std
    xy = GRID.pixel_to_map(random.uniform([10, 10], [150, 110], (count, 2)))
    transform = shifted(SHIFT_M)
    return PointErrors.of(transform, xy, transform(xy) + noise + np.asarray(bias, float))


def report_of(opened: Opened | None = None, **changes: Any) -> AssessmentReport:
    assessment = Assessment(
        control_points=errors([0, 0], 20),
        test_points=errors([0.1, 0.1], 9),
        check_points=errors([0.5, -0.25]),
        two_way=errors([0.2, 0], 30),
    )
    transform = shifted(SHIFT_M)
    report = AssessmentReport(
        title="Assessment of t.json",
        assessment=assessment,
        verdict=assessment.judge(3.0),
        transform=transform,
        comparison=compare(opened.reference, opened.input, transform) if opened else None,
        parameters={"transform": Path("t.json"), "max_error": 3.0},
        seconds=1.25,
    )
    return replace(report, **changes)


def written(report: AssessmentReport, folder: Path) -> Page:
    with Outputs() as outputs:
        report.write(outputs, folder / "a.html")
    return Page((folder / "a.html").read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def page(opened: Opened, tmp_path_factory: pytest.TempPathFactory) -> Page:
    return written(report_of(opened), tmp_path_factory.mktemp("page"))


def table(page: Page) -> list[list[str]]:
    """Return the rows of the table of errors, without the header."""
    source = page.source.partition('<table class="errors">')[2].partition("</table>")[0]
    rows = re.findall(r"<tr>(.*?)</tr>", source, re.DOTALL)[1:]
    cells = [re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row, re.DOTALL) for row in rows]
    return [[" ".join(cell.split()) for cell in row] for row in cells]


class TestPage:
    def test_it_is_one_well_formed_page_without_network(self, page: Page) -> None:
        assert page.source.startswith('<!DOCTYPE html>\n<html lang="en">')
        assert len(page.all("h1")) == len(page.all("main")) == len(page.all("script")) == 1
        ids = [e.attributes["id"] for e in page.elements if "id" in e.attributes]
        assert [e.attributes["aria-labelledby"] for e in page.all("section")] == ids
        assert len(set(ids)) == len(ids)
        for element in page.elements:
            for name in ("src", "href", "srcset", "data", "action", "poster"):
                assert str(element.attributes.get(name, "data:")).startswith("data:")
        assert "{{" not in page.text
        assert "{%" not in page.text
        assert not page.all("link", "iframe", "object", "embed", "base")
        policy = [e.attributes.get("content") or "" for e in page.all("meta")]
        assert any(text.startswith("default-src 'none'; img-src data:;") for text in policy)

    def test_the_verdict_comes_first(self, page: Page) -> None:
        assert [e.text for e in page.all("h2")] == [
            "Accepted",
            "Errors",
            "Reference and registered image",
            "Errors over the input",
            "How it was made",
        ]
        assert page.all("title")[0].text == "Accepted: Assessment of t.json"
        assert "Check points confirm the registration." in page.text
        # RMSE² = bias² + standard deviations²
        expected = math.sqrt(0.5**2 + 0.25**2 + 2 * 0.3**2)
        assert page.numbers["Check points (RMSE)"] == f"{expected:.2f} px {10 * expected:.2f} m"
        assert list(page.numbers) == [
            "Control points (RMSE)",
            "Test points (RMSE)",
            "Check points (RMSE)",
            "Two-way consistency (RMSE)",
            "Model",
        ]

    def test_the_table_has_all_numbers(self, page: Page) -> None:
        rows = table(page)
        labels = [row[0] for row in rows if row[0]]
        assert labels == [
            "control points (20 of 20)",
            "test points (9 of 9)",
            "check points (12 of 12)",
            "two-way consistency (30 of 30)",
        ]
        assert [row[1] for row in rows] == ["px", "m"] * 4
        in_px, in_m = rows[4], rows[5]
        assert in_px[7:] == ["+0.50, -0.25", "0.30, 0.30"]
        # In metres y runs to the north.
        assert in_m[7:] == ["+5.00, +2.50", "3.00, 3.00"]
        found = errors([0.5, -0.25]).in_pixels
        lengths = [found.rmse, found.mean, found.median, found.ce90, found.largest]
        assert in_px[2:7] == [f"{value:.2f}" for value in lengths]

    def test_swipe_checkerboard_and_blink(self, page: Page) -> None:
        (viewer,) = [e for e in page.all("figure") if e.attributes.get("class") == "viewer"]
        inputs = page.all("input")
        kinds = [(e.attributes["type"], e.attributes.get("value")) for e in inputs]
        modes = ["swipe", "checker", "blink"]
        assert kinds == [
            ("range", "50"),
            *[("radio", mode) for mode in modes],
            ("radio", "nominal"),
            ("radio", "registered"),
        ]
        style = page.all("style")[0].text
        assert all(f'[data-mode="{mode}"]' in style for mode in modes)
        assert viewer.attributes["data-mode"] == "swipe"
        assert viewer.attributes["data-state"] == "registered"
        alts = [str(e.attributes["alt"]) for e in page.all("img")]
        assert alts[:3] == [
            "Overview of the reference image reference.tif",
            "Overview of the input image input.tif at its nominal position",
            "Overview of the input image input.tif as registered",
        ]
        pictures = [grey(str(e.attributes["src"])) for e in page.all("img")[:3]]
        assert likeness(pictures[2], pictures[0]) > 0.99

    def test_an_image_that_is_believed_has_no_before_and_after(
        self, opened: Opened, tmp_path: Path
    ) -> None:
        drawn = replace(compare(opened.reference, opened.input, shifted(SHIFT_M)), registered=None)
        page = written(report_of(comparison=drawn), tmp_path)
        assert not [e for e in page.all("input") if e.attributes.get("name") == "state"]
        assert page.text.count("checkerboard") == 1

    def test_without_images_there_are_numbers_only(self, tmp_path: Path) -> None:
        page = written(report_of(), tmp_path)
        assert "Reference and registered image" not in [e.text for e in page.all("h2")]
        assert not page.all("input")
        assert len(page.all("img")) == 1

    def test_consistency_alone_is_said_to_be_no_accuracy(self, tmp_path: Path) -> None:
        assessment = Assessment(two_way=errors([0.2, 0], 30))
        page = written(report_of(assessment=assessment, verdict=None), tmp_path)
        headings = [e.text for e in page.all("h2")]
        assert headings == ["Measured", "Errors", "How it was made"]
        assert page.all("title")[0].text.startswith("Measured: ")
        assert "No largest error was asked for: there is no verdict." in page.text
        assert "nothing on this page is a measure of accuracy" in page.text
        assert not page.all("img")

    def test_test_points_alone(self, tmp_path: Path) -> None:
        page = written(report_of(assessment=Assessment(test_points=errors([0, 0]))), tmp_path)
        assert "Outliers among them do not count." in page.text

    def test_points_of_an_image_that_is_finer_agree_in_its_pixels(self, tmp_path: Path) -> None:
        """Two matching pixels are 40 of the input, also without control points."""
        parts = {"test_points": errors([9, 0], 9), "check_points": errors([50, 0])}
        assessment = Assessment(**{name: part.matched_in(20.0) for name, part in parts.items()})
        report = report_of(assessment=assessment, verdict=None)
        assert "test or check point within 40 px" in written(report, tmp_path).text

    def test_a_refusal(self, tmp_path: Path) -> None:
        assessment = Assessment(check_points=errors([4.0, 0]))
        report = report_of(assessment=assessment, verdict=assessment.judge(3.0))
        page = written(report, tmp_path)
        assert page.all("h2")[0].text == "Refused"
        assert "Error at check points is 4.02 px, above 3 px." in page.text
        assert json.loads((tmp_path / "a.json").read_text())["verdict"]["accepted"] is False

    def test_without_georeferencing_there_are_no_metres(self, tmp_path: Path) -> None:
        grid = Grid(Affine.translation(-0.5, -0.5), None, 160, 120)
        transform = shifted(np.array([3, 4]), grid, None)
        xy = np.random.default_rng(0).uniform(10, 100, (9, 2))
        found = PointErrors.of(transform, xy, transform(xy) + [0, 1])
        report = report_of(
            assessment=Assessment(check_points=found), transform=transform, verdict=None
        )
        page = written(report, tmp_path)
        assert page.numbers["Check points (RMSE)"] == "1.00 px"
        assert [row[1] for row in table(page)] == ["px"]
        numbers = json.loads((tmp_path / "a.json").read_text())
        assert numbers["check_points"]["rmse_m"] is None

    def test_only_pictures(self, opened: Opened, tmp_path: Path) -> None:
        page = written(report_of(opened, assessment=Assessment(), verdict=None), tmp_path)
        headings = [e.text for e in page.all("h2")]
        assert headings == ["Measured", "Reference and registered image", "How it was made"]

    def test_names_and_values_are_escaped(self, opened: Opened, tmp_path: Path) -> None:
        base = report_of(opened)
        assert base.verdict is not None and base.comparison is not None
        report = replace(
            base,
            title=HOSTILE,
            verdict=replace(base.verdict, reason=HOSTILE),
            comparison=replace(base.comparison, input_name=HOSTILE),
            parameters={HOSTILE: HOSTILE},
        )
        page = written(report, tmp_path)
        assert len(page.all("script")) == 1
        assert not any("onerror" in e.attributes for e in page.elements)
        assert page.all("h1")[0].text == HOSTILE
        assert page.all("img")[1].attributes["alt"] == (
            f"Overview of the input image {HOSTILE} at its nominal position"
        )

    def test_the_map_shows_errors_where_they_are(self, page: Page) -> None:
        assert "Map of the points in the input" in str(page.all("img")[3].attributes["alt"])
        factor = re.search(r"Arrows are (\d+) times as long", page.text)
        assert factor is not None
        assert int(factor[1]) >= 1


class TestNumbers:
    def test_the_json_is_the_summary(self, tmp_path: Path) -> None:
        report = report_of()
        written(report, tmp_path)

        def refuse(name: str) -> None:
            raise AssertionError(f"{name} is not JSON")

        text = (tmp_path / "a.json").read_text(encoding="utf-8")
        numbers = json.loads(text, parse_constant=refuse)
        assert numbers.pop("format") == REPORT_FORMAT
        assert numbers == report.summary()
        assert list(numbers) == [
            *("verdict", "control_points", "test_points", "check_points", "two_way", "three_way"),
            *("transform", "parameters", "versions", "seconds"),
        ]
        assert numbers["check_points"]["bias_col_px"] == pytest.approx(0.5)
        assert numbers["check_points"]["bias_y_m"] == pytest.approx(2.5)
        assert numbers["three_way"]["points"] == 0
        assert numbers["three_way"]["rmse_px"] is None
        assert numbers["parameters"] == {"transform": "t.json", "max_error": 3.0}
        assert numbers["verdict"]["check_rmse_px"] == numbers["check_points"]["rmse_px"]

    def test_the_transform_comes_back_from_the_json(self) -> None:
        back = Transform.from_json(report_of().summary()["transform"])
        xy = GRID.pixel_to_map([[3.0, 4.0]])
        np.testing.assert_allclose(back(xy), shifted(SHIFT_M)(xy), atol=1e-9)

    def test_a_page_that_cannot_be_written(self, tmp_path: Path) -> None:
        with pytest.raises(OutputError, match=r"does not exist: .*/no$"), Outputs() as outputs:
            report_of().write(outputs, tmp_path / "no" / "a.html")

    def test_numbers_replace_nothing_but_numbers(self, tmp_path: Path) -> None:
        (tmp_path / "a.json").write_text('{"type": "Feature"}', encoding="utf-8")
        with pytest.raises(OutputError, match=r"a\.html would also write .*a\.json, which is som"):
            written(report_of(), tmp_path)
        assert [path.name for path in tmp_path.iterdir()] == ["a.json"]
        (tmp_path / "a.json").unlink()
        written(report_of(), tmp_path)
        written(report_of(), tmp_path)
