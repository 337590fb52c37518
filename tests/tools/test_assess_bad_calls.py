"""Calls of `assess` that cannot be: one line, exit code 2, nothing written."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from assessed_files import (
    REFERENCE,
    Files,
    shifted,
    stored,
    table,
    words,
    written_files,
)
from raster_files import full_disk, write_raster
from textured_pairs import listing

from groundtie.cli import main
from groundtie.errors import (
    CancelledError,
    GeoreferencingError,
    GroundTieError,
    NoOverlapError,
    OutputError,
    ParameterError,
    RasterOpenError,
    SameFileError,
    TooFewPointsError,
    TransformFileError,
)
from groundtie.progress import Progress
from groundtie.tools.assess import assess


@pytest.fixture
def files(tmp_path: Path) -> Files:
    return written_files(tmp_path)


class TestBadCalls:
    """One clear line, exit code 2 where it is an error, and nothing left behind."""

    CALLS: tuple[tuple[type[GroundTieError], str, dict[str, str]], ...] = (
        (ParameterError, "there is nothing to judge by", {}),
        (ParameterError, "there is nothing to judge by", {"transform": "t.json"}),
        (ParameterError, "there is nothing to judge by", {"transform": "t.json", "max_error": "3"}),
        (
            ParameterError,
            "there is nothing to judge by",
            {"reference": "reference.tif", "input": "input.tif"},
        ),
        (ParameterError, "give a transform, or the input", {"tie_points": "points.gpkg"}),
        (ParameterError, "give a transform, or the input", {"check_points": "check.csv"}),
        (
            ParameterError,
            "max_error needs points",
            {"transform": "t.json", "back_transform": "back.json", "max_error": "3"},
        ),
        (
            ParameterError,
            "fitted to tie points; .*holds a transform",
            {"transform": "t.json", "tie_points": "points.gpkg", "model": "tps"},
        ),
        (
            ParameterError,
            "fitted to tie points: there are none",
            {"input": "input.tif", "check_points": "check.csv", "model": "tps"},
        ),
        (
            ParameterError,
            "consistency needs a transform",
            {"input": "input.tif", "back_transform": "back.json"},
        ),
        *(
            (ParameterError, "three-way consistency needs", {"transform": "t.json", **more})
            for more in (
                {"onward_transform": "back.json"},
                {"closing_transform": "back.json"},
                {"direct_transform": "back.json"},
                {
                    "onward_transform": "back.json",
                    "closing_transform": "t.json",
                    "direct_transform": "t.json",
                },
            )
        ),
        (
            TransformFileError,
            "missing.json",
            {"transform": "missing.json", "check_points": "check.csv"},
        ),
        (
            TransformFileError,
            "cannot read the transform",
            {"transform": "points.gpkg", "check_points": "check.csv"},
        ),
        (
            TransformFileError,
            "check.csv",
            {"transform": "t.json", "back_transform": "check.csv"},
        ),
        (
            TransformFileError,
            "missing.csv",
            {"transform": "t.json", "check_points": "missing.csv"},
        ),
        (
            TransformFileError,
            "tie points are read from",
            {"transform": "t.json", "tie_points": "input.tif"},
        ),
        (
            RasterOpenError,
            "missing.tif",
            {"transform": "t.json", "check_points": "check.csv", "input": "missing.tif"},
        ),
        (
            SameFileError,
            "input is the same raster as reference",
            {"check_points": "check.csv", "reference": "input.tif", "input": "input.tif"},
        ),
        (
            ParameterError,
            "must be 0.1 to 100",
            {"transform": "t.json", "check_points": "check.csv", "max_error": "0"},
        ),
    )

    @pytest.mark.parametrize(("error", "message", "options"), CALLS)
    def test_one_line_and_nothing_written(
        self,
        files: Files,
        tmp_path: Path,
        capsys: pytest.CaptureFixture[str],
        error: type[GroundTieError],
        message: str,
        options: dict[str, str],
    ) -> None:
        """Also with a report, where that is not what makes the call complete."""
        before = listing(tmp_path)
        values = {
            name: value if name in ("max_error", "model") else files.path(value)
            for name, value in options.items()
        }
        with pytest.raises(error, match=message):
            assess(**values)
        assert main(words(**values)) == 2
        captured = capsys.readouterr()
        assert captured.out == ""
        assert captured.err.startswith("groundtie: error: ")
        assert captured.err.count("\n") == 1
        assert listing(tmp_path) == before

    def test_a_failure_with_a_report_leaves_none(self, files: Files, tmp_path: Path) -> None:
        before = listing(tmp_path)
        calls: list[tuple[type[GroundTieError], dict[str, Any]]] = [
            (TransformFileError, {"check_points": files.path("missing.csv")}),
            (TooFewPointsError, {"tie_points": self.empty(files)}),
            (OutputError, {"check_points": files.path("check.csv"),
                           "report": tmp_path / "none" / "r.html"}),
            (ParameterError, {"check_points": files.path("check.csv"),
                              "report": tmp_path / "r.pdf"}),
        ]  # fmt: skip
        before = listing(tmp_path)
        for error, change in calls:
            with pytest.raises(error):
                assess(
                    **{"transform": files.path("t.json"), "report": tmp_path / "r.html"} | change
                )
        assert listing(tmp_path) == before

    def empty(self, files: Files) -> Path:
        return table(files.path("empty.csv"), np.zeros((0, 2)), np.zeros((0, 2)))

    def test_the_report_never_overwrites_an_input(self, files: Files, tmp_path: Path) -> None:
        """The numbers beside t.html would be t.json, which is the transform."""
        before = listing(tmp_path)
        with pytest.raises(SameFileError, match=r"would also write .*t\.json, which is transform"):
            assess(
                files.path("t.json"),
                check_points=files.path("check.csv"),
                report=files.path("t.html"),
            )
        with pytest.raises(SameFileError, match="which is back_transform"):
            assess(
                files.path("t.json"),
                back_transform=files.path("back.json"),
                report=files.path("back.html"),
            )
        assert listing(tmp_path) == before

    def test_transforms_of_another_place(self, files: Files, tmp_path: Path) -> None:
        far = stored(tmp_path / "far.json", shifted([0, 0], REFERENCE.window(5000, 0, 90, 90)))
        with pytest.raises(NoOverlapError, match=r"t\.json, .*far\.json"):
            assess(files.path("t.json"), back_transform=far)
        raster = write_raster(
            tmp_path / "far.tif", np.ones((9, 9), np.uint8), REFERENCE.window(5000, 0, 9, 9)
        )
        with pytest.raises(NoOverlapError, match=r"far\.tif does not lie"):
            assess(files.path("t.json"), check_points=files.path("check.csv"), input=raster)
        with pytest.raises(NoOverlapError, match=r"as registered, misses .*far\.tif"):
            assess(
                files.path("t.json"),
                reference=raster,
                input=files.path("input.tif"),
                report=tmp_path / "r.html",
            )

    @pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
    def test_only_one_has_a_crs(self, files: Files, tmp_path: Path) -> None:
        plain = write_raster(tmp_path / "plain.tif", np.ones((240, 320), np.uint8))
        with pytest.raises(GeoreferencingError, match="only one of"):
            assess(
                input=plain,
                reference=files.path("reference.tif"),
                check_points=files.path("check.csv"),
            )

    def test_cancelling_leaves_nothing(self, files: Files, tmp_path: Path) -> None:
        before = listing(tmp_path)
        with pytest.raises(CancelledError):
            assess(
                files.path("t.json"),
                check_points=files.path("check.csv"),
                report=tmp_path / "r.html",
                progress=Progress(is_cancelled=lambda: True),
            )
        assert listing(tmp_path) == before

    def test_a_full_disk_keeps_the_old_report(self, files: Files, tmp_path: Path) -> None:
        (tmp_path / "r.html").write_text("old")
        before = listing(tmp_path)
        with full_disk(4096), pytest.raises(OutputError, match=r"cannot write .*r\.json"):
            assess(
                files.path("t.json"),
                check_points=files.path("check.csv"),
                report=tmp_path / "r.html",
            )
        assert listing(tmp_path) == before
