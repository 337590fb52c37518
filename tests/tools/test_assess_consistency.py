"""The tool `assess` by the consistency of several transforms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from assessed_files import (
    REFERENCE,
    SHIFT_M,
    Files,
    shifted,
    stored,
    written_files,
)
from raster_files import utm_grid

from groundtie.tools.assess import assess


@pytest.fixture
def files(tmp_path: Path) -> Files:
    return written_files(tmp_path)


class TestConsistency:
    def test_two_way_consistency_is_the_shift_that_was_put_in(self, files: Files) -> None:
        result = assess(files.path("t.json"), back_transform=files.path("back.json"))
        found = result.assessment.two_way
        assert found.in_pixels.rmse == found.in_pixels.mean == pytest.approx(2, abs=1e-6)
        assert found.in_metres.rmse == pytest.approx(10, abs=1e-5)
        assert found.in_pixels.std == pytest.approx((0, 0), abs=1e-6)

    @pytest.mark.parametrize("last", ["closing_transform", "direct_transform"])
    def test_three_way_consistency(self, files: Files, tmp_path: Path, last: str) -> None:
        """Around the triangle (3, −4) m are left."""
        third = utm_grid(200, 160, 8.0)
        onward = np.array([-20.0, 15.0])
        whole = SHIFT_M + onward + [3, -4]
        steps = {
            "onward_transform": shifted(onward, third),
            "closing_transform": shifted(-whole, REFERENCE),
            "direct_transform": shifted(whole, third),
        }
        paths = {name: stored(tmp_path / f"{name}.json", t) for name, t in steps.items()}
        result = assess(
            files.path("t.json"),
            onward_transform=paths["onward_transform"],
            **{last: paths[last]},
        )
        found = result.assessment.three_way
        assert found.in_metres.rmse == pytest.approx(5, abs=1e-5)
        assert found.in_pixels.rmse == pytest.approx(1, abs=1e-6)
        assert len(result.assessment.two_way) == 0
