"""Real pairs whose ground is much the same in both images, as what is drawn over both would be."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.accuracy import CORRECT
from benchmarks.attacks.cases import named
from benchmarks.cases import read_cases
from benchmarks.offsets import Scene
from benchmarks.one_grid import OneGridCase
from benchmarks.real import ShiftedCase


@pytest.mark.parametrize("name", ["ss-ponds", "ss-meander"])
@pytest.mark.slow
def test_radar_images_in_pixels_of_many_looks_are_registered(real_data: Path, name: str) -> None:
    """Where speckle has averaged out, a third of the area varies alike."""
    case = next(case for case in read_cases(real_data) if case.name == name)
    assert ShiftedCase(case, 0, tool="match_sar_sar", pixel_m=2.0).run(1).verdict == CORRECT


@pytest.mark.parametrize(
    "name", ["-/dn-2/coregister/87016", "resampled/oo-port/match_optical/87003"]
)
@pytest.mark.slow
def test_two_dates_of_one_camera_that_lie_off_one_another_are_registered(
    real_data: Path, tmp_path: Path, name: str
) -> None:
    """Their edges coincide as sharply as those of what is drawn, which moves by whole pixels."""
    found = named(f"two dates of one camera/{name}", real_data, tmp_path).run(1)
    assert found.verdict == CORRECT


@pytest.mark.slow
def test_two_cameras_images_of_what_may_be_a_town_are_registered(
    real_data: Path, tmp_path: Path
) -> None:
    """Lakes, before which the land is as bright as a radar's town: 10 of 16 check points agree."""
    case = next(case for case in read_cases(real_data) if case.name == "oo-lakes")
    found = OneGridCase(Scene(case, tmp_path), "where they belong").run(1)
    assert found.verdict == CORRECT
