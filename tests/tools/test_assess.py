"""The tool `assess` from files to numbers, verdict and report."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from assessed_files import (
    INPUT,
    REFERENCE,
    SHIFT_M,
    Files,
    shifted,
    stored,
    table,
    words,
    written_files,
)
from html_pages import Page, picture_of
from raster_files import utm_grid, wave_image, write_raster
from textured_pairs import TexturedPair

from groundtie import load_transform
from groundtie.cli import main
from groundtie.declaration import tool_of
from groundtie.errors import (
    NotRegisteredError,
    TooFewPointsError,
)
from groundtie.geometry.tie_point_files import read_tie_points, write_tie_points
from groundtie.geometry.transform import Transform
from groundtie.kinds import REPORT_FORMAT
from groundtie.rasters.grid import PIXEL_COORDINATES, Grid
from groundtie.tools.assess import assess
from groundtie.tools.coregister import coregister


@pytest.fixture
def files(tmp_path: Path) -> Files:
    return written_files(tmp_path)


class TestEvidence:
    def test_check_points(self, files: Files) -> None:
        result = assess(files.path("t.json"), check_points=files.path("check.csv"))
        found = result.assessment.check_points
        assert len(found) == 25
        assert found.in_pixels.rmse == pytest.approx(0.5, abs=1e-6)
        assert found.in_pixels.bias == pytest.approx((0.3, -0.4), abs=1e-6)
        assert found.in_metres.rmse == pytest.approx(2.5, abs=1e-5)
        assert found.in_metres.bias == pytest.approx((1.5, 2.0), abs=1e-5)
        assert result.verdict is None
        assert result.summary()["verdict"] is None
        assert result.files == {}

    def test_known_normal_errors_have_the_ce90_of_theory(self, files: Files) -> None:
        """An error that is drawn from a normal distribution of 2 px: CE90 is 4.29 px."""
        count = 1005
        random = np.random.default_rng(5)
        radius = 2 * np.sqrt(-2 * np.log(1 - (np.arange(count) + 0.5) / count))
        angle = random.uniform(0, 2 * np.pi, count)
        xy = REFERENCE.pixel_to_map(random.uniform([20, 20], [140, 100], (count, 2)))
        error = radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
        points = table(files.path("p.csv"), xy, shifted(SHIFT_M)(xy) + error)
        found = assess(files.path("t.json"), check_points=points).assessment.check_points
        assert found.in_pixels.ce90 == pytest.approx(2 * 2.1460, rel=1e-4)
        assert found.in_pixels.rmse == pytest.approx(2 * math.sqrt(2), rel=1e-3)
        assert found.in_metres.ce90 == pytest.approx(10 * 2.1460, rel=1e-4)

    def test_control_and_test_points(self, files: Files) -> None:
        result = assess(files.path("t.json"), files.path("points.gpkg"))
        control, test = result.assessment.control_points, result.assessment.test_points
        assert (len(control), len(test)) == (20, 10)
        assert control.in_pixels.bias == pytest.approx((1, 0), abs=1e-6)
        assert test.in_pixels.bias == pytest.approx((0, 0.5), abs=1e-6)

    @pytest.mark.slow
    def test_without_a_transform_one_is_fitted(self, files: Files) -> None:
        """The fit takes up what all control points have in common; the test points show it."""
        result = assess(
            tie_points=files.path("points.gpkg"),
            input=files.path("input.tif"),
            model="translation",
        )
        assert result.transform.model.kind == "translation"
        assert result.assessment.control_points.in_pixels.rmse == pytest.approx(0, abs=1e-6)
        assert result.assessment.test_points.in_pixels.bias == pytest.approx((-1, 0.5), abs=1e-6)
        fitted = assess(tie_points=files.path("points.gpkg"), input=files.path("input.tif"))
        assert fitted.transform.model.kind == "affine"

    def test_the_georeferencing_of_an_image_that_any_program_registered(
        self, files: Files, tmp_path: Path
    ) -> None:
        """The input as it is lies off by all of its misregistration."""
        result = assess(input=files.path("input.tif"), check_points=files.path("check.csv"))
        found = result.assessment.check_points
        expected = SHIFT_M / [5, -5] + [0.3, -0.4]
        assert found.in_pixels.bias == pytest.approx(tuple(expected), abs=1e-6)
        values = wave_image(INPUT, 400.0).astype(np.float32)
        right = write_raster(tmp_path / "right.tif", values, INPUT.shifted(*-SHIFT_M))
        result = assess(input=right, check_points=files.path("check.csv"), max_error=1.0)
        assert result.verdict is not None and result.verdict.accepted
        assert result.assessment.check_points.in_pixels.rmse == pytest.approx(0.5, abs=1e-6)

    def test_a_raster_of_other_pixels_is_measured_in_its_own(
        self, files: Files, tmp_path: Path
    ) -> None:
        """The same scene in pixels of 20 m: tie points find their place by the map."""
        coarse = utm_grid(80, 60, 20.0)
        raster = write_raster(tmp_path / "c.tif", np.ones((60, 80), np.float32), coarse)
        result = assess(files.path("t.json"), files.path("points.gpkg"), input=raster)
        assert result.assessment.control_points.in_pixels.rmse == pytest.approx(0.25, abs=1e-6)
        assert result.assessment.control_points.in_metres.rmse == pytest.approx(5, abs=1e-5)

    def test_images_without_georeferencing(self, tmp_path: Path) -> None:
        plain = Grid(PIXEL_COORDINATES, None, 90, 80)
        transform = shifted([4, -3], plain, None)
        xy = np.random.default_rng(0).uniform(10, 70, (8, 2))
        result = assess(
            stored(tmp_path / "t.json", transform),
            check_points=table(tmp_path / "p.csv", xy, transform(xy) + [0.0, 2.0]),
            back_transform=stored(tmp_path / "b.json", shifted([-4, 2], plain, None)),
        )
        assert result.assessment.check_points.in_pixels.rmse == pytest.approx(2)
        assert result.assessment.two_way.in_pixels.rmse == pytest.approx(1)
        assert result.assessment.check_points.error_m is None
        assert all(" m)" not in line for line in result.lines())


class TestVerdict:
    def test_accepted(self, files: Files, capsys: pytest.CaptureFixture[str]) -> None:
        options = {"transform": files.path("t.json"), "check_points": files.path("check.csv")}
        assert main(words(**options, max_error=0.6)) == 0
        out = capsys.readouterr().out
        assert out.startswith("accepted: check points confirm the registration\n")
        assert "check points: 25 of 25 points, RMSE 0.50 px (2.50 m)" in out
        assert "bias +0.30, -0.40 px" in out

    def test_refused(
        self, files: Files, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        """Exit code 3 and one line; the report is written, as that of coregister."""
        options = {"transform": files.path("t.json"), "check_points": files.path("check.csv")}
        report = tmp_path / "r.html"
        assert main([*words(**options, max_error=0.4, report=report), "--json"]) == 3
        captured = capsys.readouterr()
        assert captured.err.count("\n") == 1
        assert "t.json is refused: error at check points is 0.50 px, above 0.4 px" in captured.err
        verdict = json.loads(captured.out)["verdict"]
        assert verdict["accepted"] is False
        assert verdict["check_rmse_px"] == pytest.approx(0.5)
        assert verdict["chance"] is None
        numbers = json.loads(report.with_suffix(".json").read_text(encoding="utf-8"))
        assert numbers["verdict"] == verdict
        assert Page(report.read_text(encoding="utf-8")).all("h2")[0].text == "Refused"

    def test_a_refusal_in_python(self, files: Files) -> None:
        with pytest.raises(NotRegisteredError, match=r"above 0\.4 px") as error:
            assess(files.path("t.json"), check_points=files.path("check.csv"), max_error=0.4)
        assert error.value.verdict is not None
        assert error.value.verdict.check_points == 25

    def test_inconsistency_refuses_what_points_accept(self, files: Files) -> None:
        evidence = {
            "check_points": files.path("check.csv"),
            "back_transform": files.path("back.json"),
        }
        assert assess(files.path("t.json"), **evidence, max_error=2.1).verdict is not None
        with pytest.raises(NotRegisteredError, match=r"two-way inconsistency is 2\.00 px"):
            assess(files.path("t.json"), **evidence, max_error=1.9)

    @pytest.mark.slow
    def test_test_points_are_judged_where_there_are_no_others(self, files: Files) -> None:
        """Residuals of the fit are 1 px, held-out points are off by 0.5 px."""
        calls = {"transform": files.path("t.json"), "tie_points": files.path("points.gpkg")}
        result = assess(**calls, max_error=0.6)
        assert result.verdict is not None
        assert result.verdict.check_rmse_px == pytest.approx(0.5)
        with pytest.raises(NotRegisteredError, match=r"error at test points is 0\.50 px"):
            assess(**calls, max_error=0.45)

    def test_the_fit_alone_is_no_ground(self, files: Files, tmp_path: Path) -> None:
        fitted = tmp_path / "fit.csv"
        xy = REFERENCE.pixel_to_map(np.random.default_rng(1).uniform(20, 100, (9, 2)))
        table(fitted, xy, shifted(SHIFT_M)(xy))
        assert assess(files.path("t.json"), fitted).assessment.control_points.in_pixels.rmse < 1e-6
        with pytest.raises(TooFewPointsError, match="no points took no part in the fit"):
            assess(files.path("t.json"), fitted, max_error=3.0)

    def test_points_without_roles_do_not_check_their_own_fit(self, files: Files) -> None:
        """Files of the Georeferencer have no roles; other ones need none."""
        fitted = files.path("fit.points")
        transform = load_transform(files.path("t.json"))
        points = read_tie_points(files.path("points.gpkg"), INPUT)
        write_tie_points(fitted, points, transform)
        for path in (fitted, files.path("check.csv")):
            same = path.parent / ".." / "in" / path.name
            with pytest.raises(TooFewPointsError, match="no points took no part in the fit"):
                assess(files.path("t.json"), path, same)
        found = assess(files.path("t.json"), check_points=fitted).assessment.check_points
        assert len(found) == 20


class TestReport:
    @pytest.mark.slow
    def test_swipe_and_checkerboard_of_the_two_rasters(self, files: Files, tmp_path: Path) -> None:
        result = assess(
            files.path("t.json"),
            files.path("points.gpkg"),
            files.path("check.csv"),
            reference=files.path("reference.tif"),
            input=files.path("input.tif"),
            max_error=3.0,
            report=tmp_path / "r.html",
        )
        assert result.files == {"report": str(tmp_path / "r.html")}
        page = Page((tmp_path / "r.html").read_text(encoding="utf-8"))
        assert page.all("h2")[0].text == "Accepted"
        modes = [
            e.attributes["value"] for e in page.all("input") if e.attributes.get("name") == "mode"
        ]
        assert modes == ["swipe", "checker", "blink"]
        pictures = [
            picture_of(str(e.attributes["src"]), "image/jpeg").astype(float)[10:-10, 10:-10]
            for e in page.all("img")[:3]
        ]
        likeness = [np.corrcoef(p.ravel(), pictures[0].ravel())[0, 1] for p in pictures[1:]]
        assert likeness[0] < 0.9 < 0.99 < likeness[1]
        numbers = json.loads((tmp_path / "r.json").read_text(encoding="utf-8"))
        assert len(numbers.pop("run")) == 16
        assert numbers.pop("format") == REPORT_FORMAT
        assert {**numbers, "files": result.files} == result.summary()
        assert numbers["check_points"]["rmse_px"] == pytest.approx(0.5)
        assert numbers["parameters"]["check_points"] == str(files.path("check.csv"))

    def test_two_images_and_no_number(self, files: Files, tmp_path: Path) -> None:
        """To look at an image that claims to be registered is evidence, too."""
        result = assess(
            reference=files.path("reference.tif"),
            input=files.path("input.tif"),
            report=tmp_path / "r.html",
        )
        page = Page((tmp_path / "r.html").read_text(encoding="utf-8"))
        assert page.all("title")[0].text == "Measured: Assessment of input.tif"
        assert not [e for e in page.all("input") if e.attributes.get("name") == "state"]
        assert result.lines() == [f"report: {tmp_path / 'r.html'}"]

    def test_numbers_only(self, files: Files, tmp_path: Path) -> None:
        assess(
            files.path("t.json"),
            back_transform=files.path("back.json"),
            report=tmp_path / "r.html",
        )
        assert sorted(os.listdir(tmp_path)) == ["in", "r.html", "r.json"]
        page = Page((tmp_path / "r.html").read_text(encoding="utf-8"))
        assert not page.all("img")
        assert "Two-way consistency (RMSE)" in page.numbers

    def test_the_summary_has_what_the_outputs_promise(self, files: Files) -> None:
        result = assess(
            files.path("t.json"), files.path("points.gpkg"), files.path("check.csv"),
            files.path("back.json"),
        )  # fmt: skip
        summary = json.loads(json.dumps(result.summary(), allow_nan=False))
        values = {output.name: output.value(summary) for output in tool_of(assess).outputs}
        # Nothing was measured three-way.
        assert values.pop("THREE_WAY_RMSE_PX") is None
        assert values == pytest.approx(
            {
                "CHECK_RMSE_PX": 0.5,
                "CHECK_CE90_M": 2.5,
                "TEST_RMSE_PX": 0.5,
                "CONTROL_RMSE_PX": 1.0,
                "TWO_WAY_RMSE_PX": 2.0,
            },
            abs=1e-5,
        )


class TestWithOtherTools:
    @pytest.mark.slow
    def test_what_coregister_wrote_is_judged_as_coregister_did(
        self, simulated: Callable[[str], Any], tmp_path: Path
    ) -> None:
        """The same held-out matches; right ones count in full here, by their probability there."""
        pair = simulated("affine")
        made = {"tie_points": tmp_path / "p.gpkg", "transform": tmp_path / "t.json"}
        registered = coregister(
            pair.reference, pair.input, tmp_path / "out.tif",
            workers=2, **made,
        )  # fmt: skip
        result = assess(**made, max_error=3.0)
        assert result.verdict is not None
        ours, theirs = result.verdict, registered.verdict
        # Files hold check points without a peak as rejected ones; the verdict counts them.
        assert registered.check is not None
        assert ours.check_points == registered.check.points.used.sum() <= theirs.check_points
        assert 0 < ours.check_points_agreeing < ours.check_points
        assert ours.check_rmse_px == pytest.approx(theirs.check_rmse_px, rel=0.1)

    @pytest.mark.slow
    def test_the_error_at_true_points_is_that_of_the_transform(
        self, textured: TexturedPair, tmp_path: Path
    ) -> None:
        made = tmp_path / "t.json"
        registered = coregister(
            textured.reference, textured.input, tmp_path / "out.tif",
            workers=2, transform=made,
        )  # fmt: skip
        xy = textured.grid.pixel_to_map(
            np.random.default_rng(0).uniform([30, 30], [200, 190], (50, 2))
        )
        truth = table(tmp_path / "truth.csv", xy, textured.truth(xy))
        measured = assess(made, check_points=truth).assessment.check_points
        error = np.hypot(*(registered.transform(xy) - textured.truth(xy)).T)
        assert measured.in_pixels.rmse == pytest.approx(np.sqrt((error**2).mean()), abs=1e-5)

    @pytest.mark.slow
    def test_the_check_points_of_simulate(
        self, simulated: Callable[[str], Any], tmp_path: Path
    ) -> None:
        pair = simulated("affine")
        truth = pair.folder / "truth.json"
        result = assess(truth, check_points=pair.folder / "check_points.csv", max_error=0.1)
        # The table has six digits.
        assert result.assessment.check_points.in_pixels.largest < 1e-5
        unregistered = assess(
            input=pair.input, check_points=pair.folder / "check_points.csv"
        ).assessment.check_points
        exact = load_transform(truth)
        nominal = Transform.nominal(exact.crs, exact.input_grid)
        assert unregistered.in_pixels.rmse == pytest.approx(pair.error_px(nominal), rel=1e-4)
