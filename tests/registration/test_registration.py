"""A registration: its output for users and programs, and that it closes the files it opened."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio.shutil
from evidences import LOST, refused
from raster_files import write_raster
from textured_pairs import TexturedPair, listing

from groundtie.errors import NotRegisteredError, OutputError, ParameterError, SameFileError
from groundtie.matching.check import CHECK_RADIUS_PX, Check
from groundtie.registration.delivery import Call, RegistrationFiles
from groundtie.registration.registration import Registration
from groundtie.registration.specification import Specification


def first_checks(registration: Registration, count: int) -> Registration:
    """Return a registration with only the first of its check points."""
    check = registration.check
    assert check is not None
    few = Check(
        check.points.take(slice(0, count)),  # type: ignore[arg-type]
        check.surfaces[:count],
    )
    return replace(registration, check=few)


def test_surfaces_of_the_best_and_worst_check_points(registration: Registration) -> None:
    surfaces = registration.extreme_surfaces()
    labels = [label for label, _ in surfaces]
    best, worst = labels.count("best check point"), labels.count("worst check point")
    assert best + worst == len(labels)
    assert best == 3
    assert 0 < worst <= 3
    side = 2 * CHECK_RADIUS_PX + 1
    for _, surface in surfaces:
        assert surface.shape == (side, side)
        assert np.isfinite(surface).all()
    assert refused(registration).extreme_surfaces() == ()


def test_few_check_points_are_shown_once(registration: Registration) -> None:
    labels = [label for label, _ in first_checks(registration, 4).extreme_surfaces()]
    assert labels == ["best check point"] * 3 + ["worst check point"]
    assert first_checks(registration, 0).extreme_surfaces() == ()


def test_a_registration_is_lines_for_people_and_json_for_programs(
    registration: Registration,
) -> None:
    found = replace(registration, files={"output": Path("out.tif")}, parameters={"a": 1, "b": None})
    summary = json.loads(json.dumps(found.summary(), allow_nan=False))
    assert summary["files"] == {"output": "out.tif"}
    assert summary["verdict"] == registration.verdict.summary()
    assert summary["parameters"] == {"a": 1}
    assert summary["scene"] == registration.scene.summary()
    assert "tried" not in summary
    lines = found.lines()
    verdict = registration.verdict
    assert lines[0].startswith("correction: ") and " m) at the centre: " in lines[0]
    assert lines[1] == "accepted: check points confirm the registration"
    assert f"{verdict.fit_points_used} of {verdict.fit_points} points" in lines[2]
    assert f"RMSE {verdict.check_rmse_px:.2f} px" in lines[3]
    low, high = verdict.accuracy.ce90_range_px
    assert f"CE90 {verdict.accuracy.ce90_px:.2f} px" in lines[4]
    assert f"known to {low:.2f}–{high:.2f} px; 90 % in an ellipse of " in lines[4]
    assert f"{verdict.check_points_agreeing} of {verdict.check_points}" in lines[5]
    assert lines[-1] == "output: out.tif"
    # Pixels of 10 m: both units.
    assert f"RMSE {verdict.check_rmse_px:.2f} px ({10 * verdict.check_rmse_px:.2f} m)" in lines[3]


@pytest.mark.parametrize(
    ("name", "grid", "is_stated"),
    [
        (None, "reference", False),
        (None, "input", True),
        ("o.tif", "input", True),
        ("o.vrt", "reference", True),
    ],
)
def test_what_is_warped_beyond_the_overlap_is_stated(
    wide: Registration,
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
    name: str | None,
    grid: str,
    is_stated: bool,
) -> None:
    wide.warp(output=None if name is None else tmp_path / name, grid=grid)
    stated = [line for line in caplog.messages if "outside of the overlap" in line]
    assert len(stated) == is_stated
    beyond = wide.beyond_overlap(grid)
    assert (beyond is not None) == (grid == "input")
    if beyond is not None:
        assert beyond.share == pytest.approx(0.5, abs=0.1)


def test_a_raster_without_its_georeferencing_is_warped_onto_the_inputs_grid(
    registration: Registration, textured: TexturedPair, tmp_path: Path
) -> None:
    """Of the same size, it is taken for the input's pixels."""
    with rasterio.open(textured.input) as dataset:
        values = dataset.read()
    bare = write_raster(tmp_path / "bare.tif", values)
    own, found = (registration.warp(raster, grid="input") for raster in (None, bare))
    assert (found.transform, found.crs) == (own.transform, own.crs)
    np.testing.assert_array_equal(found.values, own.values)


class TestWhatIsWrittenOverNothing:
    """The outputs of `warp` and `report` are checked like those of tools."""

    @pytest.mark.parametrize("role", ["input", "reference"])
    def test_neither_over_an_image(
        self, registration: Registration, tmp_path: Path, role: str
    ) -> None:
        image = Path(getattr(registration.pair, role).source.path)
        before = image.read_bytes()
        (tmp_path / "link.tif").symlink_to(image)
        for path in (image, tmp_path / "link.tif"):
            with pytest.raises(SameFileError, match=f"output is the same file as (raster|{role})"):
                registration.warp(output=path)
        assert image.read_bytes() == before

    def test_nor_over_the_raster_that_is_warped(
        self, registration: Registration, textured: TexturedPair, tmp_path: Path
    ) -> None:
        other = tmp_path / "other.tif"
        other.write_bytes(textured.input.read_bytes())
        with pytest.raises(SameFileError, match="output is the same file as raster"):
            registration.warp(other, other)
        assert other.read_bytes() == textured.input.read_bytes()

    def test_nor_over_what_that_is_made_of(
        self, registration: Registration, textured: TexturedPair, tmp_path: Path
    ) -> None:
        other, virtual = tmp_path / "other.tif", tmp_path / "virtual.vrt"
        other.write_bytes(textured.input.read_bytes())
        rasterio.shutil.copy(other, virtual, driver="VRT")
        with pytest.raises(SameFileError, match="output is the same file as a source of raster"):
            registration.warp(virtual, other)
        assert other.read_bytes() == textured.input.read_bytes()

    def test_nor_over_what_else_the_registration_was_called_with(
        self, registration: Registration, tmp_path: Path
    ) -> None:
        mask, output = tmp_path / "mask.tif", tmp_path / "o.tif"
        mask.touch()
        called = {"input_mask": mask, "output": output}
        found = replace(registration, parameters=called, files={"output": output})
        with pytest.raises(SameFileError, match="output is the same file as input_mask"):
            found.warp(output=mask)
        found.warp(output=output)
        assert mask.read_bytes() == b""

    @pytest.mark.slow
    def test_nor_over_an_input_from_another_working_folder(
        self, textured: TexturedPair, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        scene, other = tmp_path / "scene", tmp_path / "other"
        for folder in (scene, other):
            folder.mkdir()
        for name in ("reference", "input"):
            (scene / f"{name}.tif").write_bytes(getattr(textured, name).read_bytes())
        before = (scene / "input.tif").read_bytes()
        (scene / "mask.tif").touch()
        monkeypatch.chdir(tmp_path)
        paths = "scene/reference.tif", "scene/input.tif"
        with Call(*paths, RegistrationFiles()).register(Specification()) as found:
            found = replace(found, parameters={"input_mask": Path("scene/mask.tif")})
            monkeypatch.chdir(other)
            for name in ("input", "mask"):
                with pytest.raises(SameFileError, match=r"same file as (raster|input_mask)"):
                    found.warp(output=scene / f"{name}.tif")
            found.close()
            found.warp(output="o.tif")  # reads the input again
        assert (scene / "input.tif").read_bytes() == before

    @pytest.mark.parametrize("name", ["o.png", "o", "o.html"])
    def test_rasters_have_the_suffix_of_one(
        self, registration: Registration, tmp_path: Path, name: str
    ) -> None:
        with pytest.raises(ParameterError, match=r"output must end in \.tif or \.tiff or \.vrt"):
            registration.warp(output=tmp_path / name)
        assert listing(tmp_path) == {}

    def test_reports_are_pages(self, registration: Registration, tmp_path: Path) -> None:
        (tmp_path / "dsm.tif").write_bytes(b"heights")
        with pytest.raises(ParameterError, match=r"report must end in \.html"):
            registration.report(tmp_path / "dsm.tif")
        (tmp_path / "r.json").write_text('{"type": "Feature"}')
        with pytest.raises(OutputError, match=r"would also write .*r\.json"):
            registration.report(tmp_path / "r.html")
        assert (tmp_path / "dsm.tif").read_bytes() == b"heights"


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"grid": "foo"}, "grid must be one of reference, input, untouched, not 'foo'"),
        ({"grid": "untouched"}, "the grid untouched needs an output"),
        ({"resampling": "foo"}, "resampling must be one of nearest, .*, not 'foo'"),
        ({"workers": -1}, "workers must be 1 to 256, not -1"),
        ({"workers": "x"}, "workers must be a number, not 'x'"),
    ],
)
def test_words_and_numbers_that_mean_nothing(
    registration: Registration, tmp_path: Path, asked: dict[str, Any], message: str
) -> None:
    with pytest.raises(ParameterError, match=message):
        registration.warp(**asked)
    if asked != {"grid": "untouched"}:
        with pytest.raises(ParameterError, match=message):
            registration.warp(output=tmp_path / "o.tif", **asked)
    assert listing(tmp_path) == {}


def test_a_grid_that_is_none_has_nothing_beyond(registration: Registration) -> None:
    with pytest.raises(ParameterError, match="grid must be one of"):
        registration.beyond_overlap("foo")


def test_what_was_tried_before_stands_after_the_correction(registration: Registration) -> None:
    found = replace(registration, tried=("tried chips: refused",))
    assert found.lines()[0].startswith("correction: ")
    assert found.lines()[1] == "tried chips: refused"
    assert found.lines()[2].startswith("accepted: ")
    assert found.summary()["tried"] == ["tried chips: refused"]


def test_a_refusal_is_one_line_with_what_to_try(registration: Registration) -> None:
    lost = refused(registration)
    assert lost.lines() == [f"refused: {LOST.reason}; {LOST.advice}"]
    summary = json.loads(json.dumps(lost.summary(), allow_nan=False))
    assert summary["verdict"]["rule"] == "nothing in common"
    assert lost.transform is None and lost.tie_points is None
    with pytest.raises(AssertionError):
        lost.accepted_transform()


def test_a_refusal_names_what_was_tried(registration: Registration) -> None:
    lost = replace(refused(registration), tried=("chips: refused", "keypoints: refused"))
    assert lost.page().numbers()["tried"] == list(lost.tried)
    with pytest.raises(NotRegisteredError) as caught:
        lost.require_accepted()
    assert caught.value.summary()["tried"] == ["chips: refused", "keypoints: refused"]


@pytest.mark.slow
def test_the_report_is_a_page_and_its_numbers(registration: Registration, tmp_path: Path) -> None:
    registration.report(tmp_path / "r.html")
    assert set(listing(tmp_path)) == {"r.html", "r.json"}
    assert "input.tif registered to reference.tif" in (tmp_path / "r.html").read_text()
    numbers = json.loads((tmp_path / "r.json").read_text())
    assert numbers["verdict"] == registration.verdict.summary()
    refused(registration).report(tmp_path / "lost.html")
    assert "nothing in common" in (tmp_path / "lost.html").read_text()


@pytest.mark.slow
def test_left_as_a_context_manager_it_closes_its_rasters(textured: TexturedPair) -> None:
    spec = Specification(similarity="orientation", search_radius_m=200.0)
    call = Call(textured.reference, textured.input, RegistrationFiles())
    closed: list[bool] = []
    with call.register(spec) as found:
        found.rasters.callback(closed.append, True)
        grid = found.pair.grid
        assert found.pair.reference_patch(grid).valid.any()
        assert closed == []
    assert closed == [True]
    # Computed results remain.
    points, transform = found.tie_points, found.accepted_transform()
    assert points is not None
    assert np.isfinite(transform(points.reference_xy)).all()
    assert found.lines() and found.verdict.accepted
    found.close()
