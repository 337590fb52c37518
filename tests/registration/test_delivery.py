"""The output of a registering tool: its files, or the report of a refusal."""

from __future__ import annotations

import json
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
from contexts import context
from evidences import LOST, refused
from textured_pairs import TexturedPair, listing

from groundtie.context import Context
from groundtie.errors import NotRegisteredError, OutputError
from groundtie.geometry.transform import load_transform
from groundtie.registration import delivery
from groundtie.registration.asked import specified
from groundtie.registration.delivery import Call, RegistrationFiles
from groundtie.registration.registered_output import RegisteredOutput
from groundtie.registration.registration import Registration
from groundtie.registration.specification import SAR_SAR

__all__ = ["context"]


def files_in(folder: Path) -> RegistrationFiles:
    names = folder / "p.csv", folder / "t.json", folder / "r.html"
    return RegistrationFiles(None, *names)


@pytest.mark.slow
def test_files_of_an_accepted_registration(
    registration: Registration, tmp_path: Path, context: Context
) -> None:
    files = files_in(tmp_path)
    files.write(registration, context)
    assert set(listing(tmp_path)) == {"p.csv", "t.json", "r.html", "r.json"}
    points, transform = registration.tie_points, registration.accepted_transform()
    assert points is not None
    np.testing.assert_array_equal(
        load_transform(tmp_path / "t.json")(points.reference_xy), transform(points.reference_xy)
    )
    assert set(files.named()) == {"tie_points", "transform", "report"}
    assert RegistrationFiles().named() == {}
    output = RegisteredOutput(tmp_path / "o.tif", "reference", "cubic")
    assert RegistrationFiles(output).named() == {"output": tmp_path / "o.tif"}


def test_a_refused_registration_writes_its_report_and_raises(
    registration: Registration, tmp_path: Path, context: Context
) -> None:
    lost = refused(registration)
    call = Call("", "", files_in(tmp_path))
    with pytest.raises(
        NotRegisteredError, match=r"input\.tif was not .*: nothing in common"
    ) as error:
        call.deliver(lost, context, ExitStack())
    assert error.value.verdict is LOST
    assert LOST.advice in str(error.value)
    assert set(listing(tmp_path)) == {"r.html", "r.json"}
    numbers = json.loads((tmp_path / "r.json").read_text())
    assert numbers["verdict"]["accepted"] is False
    assert numbers["verdict"]["rule"] == "nothing in common"
    with pytest.raises(NotRegisteredError):
        lost.require_accepted()
    registration.require_accepted()


@pytest.mark.parametrize(
    ("name", "grid", "is_stated"),
    [
        ("o.tif", "reference", False),
        ("o.tif", "input", True),
        ("o.tif", "untouched", True),
        ("o.vrt", "reference", True),
    ],
)
def test_what_is_written_beyond_the_overlap_is_stated(
    wide: Registration,
    tmp_path: Path,
    context: Context,
    name: str,
    grid: str,
    is_stated: bool,
) -> None:
    files = RegistrationFiles(RegisteredOutput(tmp_path / name, grid), report=tmp_path / "r.html")
    found = Call("", "", files).deliver(wide, context, ExitStack())
    (line,) = [line for line in found.lines() if "outside of the overlap" in line] or [""]
    assert ("of the registered image" in line) == is_stated
    assert ("outside of the overlap" in (tmp_path / "r.html").read_text()) == is_stated
    numbers = json.loads((tmp_path / "r.json").read_text())
    assert ("outside_of_overlap" in numbers) == is_stated
    assert ("outside_of_overlap" in found.summary()) == is_stated
    if is_stated:
        assert numbers["outside_of_overlap"]["share"] == pytest.approx(0.5, abs=0.1)


def test_what_fails_later_leaves_no_report_either(
    registration: Registration, tmp_path: Path, context: Context, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OutputError("the disk is full")

    monkeypatch.setattr(delivery, "write_tie_points", full)
    with pytest.raises(OutputError):
        files_in(tmp_path).write(registration, context)
    assert listing(tmp_path) == {}


def test_rasters_stay_open_as_long_as_a_delivered_registration(
    registration: Registration, context: Context
) -> None:
    closed: list[str] = []
    stack = ExitStack()
    stack.callback(closed.append, "closed")
    kept = Call("", "", RegistrationFiles()).deliver(registration, context, stack)
    assert closed == []
    kept.close()
    assert closed == ["closed"]
    kept.close()
    assert closed == ["closed"]


def test_rasters_are_closed_with_a_registration_that_nobody_keeps(
    registration: Registration, context: Context
) -> None:
    closed: list[str] = []
    call = Call("", "", RegistrationFiles())
    for found in (registration, refused(registration)):
        stack = ExitStack()
        stack.callback(closed.append, "closed")
        try:
            kept = call.deliver(found, context, stack)
            del kept
        except NotRegisteredError:
            pass
    assert closed == ["closed"] * 2


def test_a_tools_parameters_go_into_the_specification_and_the_report(
    textured: TexturedPair, tmp_path: Path
) -> None:
    parameters = {
        "reference": textured.reference,
        "input": textured.input,
        "output": None,
        "output_grid": "untouched",
        "tie_points": None,
        "transform": None,
        "report": None,
        "displacement": None,
        "reference_band": None,
        "input_band": 1,
        "reference_mask": None,
        "input_mask": None,
        "mask_values": None,
        "workers": 2,
        "model": "auto",
        "max_error": 2.5,
        "search_radius": 150.0,
        "search_rotation": None,
        "matching_pixel_size": None,
    }
    spec = specified(SAR_SAR, parameters)
    # Pixels without resampling allow a shift only.
    assert (spec.model, spec.max_error_px, spec.search_radius_m) == ("translation", 2.5, 150.0)
    assert (spec.rotation_deg, spec.scale) == (None, None)
    assert (spec.matcher, spec.radar) == (SAR_SAR.matcher, SAR_SAR.radar)
    call = Call.of(parameters, delivery.SILENT)
    assert (call.bands, call.workers, call.parameters) == ((None, 1), 2, parameters)
    assert call.files == RegistrationFiles()
    drawn = Call.of(parameters | {"output": tmp_path / "o.tif"}, delivery.SILENT).files
    assert drawn == RegistrationFiles(RegisteredOutput(tmp_path / "o.tif", "untouched", "cubic"))
