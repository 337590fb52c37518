"""Parts of the radar image take no part."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from tools.conftest import SimulatedFiles

from groundtie.tools.coregister import coregister


def test_a_threshold_mask_is_used_and_reported(
    simulated: Callable[[str], SimulatedFiles], tmp_path: Path
) -> None:
    pair = simulated("shift")
    result = coregister(pair.reference, pair.input, tmp_path / "out.tif", mask="threshold")
    mask = result.numbers["mask"]
    assert (mask["kind"], mask["image"]) == ("threshold", "reference")
    assert mask["share"] == pytest.approx(0.8, abs=0.02)
    assert pair.error_px(result.transform) < 0.5


def test_either_image_can_be_masked(
    simulated: Callable[[str], SimulatedFiles], tmp_path: Path
) -> None:
    """The optical image is the reference here: the radar's is found all the same."""
    pair = simulated("shift")
    for image, expected in (("auto", "input"), ("reference", "reference")):
        result = coregister(
            pair.input,
            pair.reference,
            tmp_path / "out.tif",
            mask="threshold",
            mask_image=image,
            mask_high_percent=10.0,
        )
        mask = result.numbers["mask"]
        assert mask["image"] == expected
        assert mask["share"] == pytest.approx(0.9, abs=0.06)
