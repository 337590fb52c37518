from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from raster_files import utm_grid, write_raster
from textured_pairs import texture

from benchmarks.sharpness import Bands, bands_of_series


@pytest.fixture
def exposure(tmp_path: Path) -> Path:
    """Write one exposure in two bands, the other of which shows the ground darker the brighter."""
    ground = texture(320, 320)
    noise = np.random.default_rng(2).normal(size=(2, 320, 320))
    bands = np.stack([ground, -ground]) + 0.8 * noise
    return write_raster(
        tmp_path / "date.tif", np.rint(2000 + 300 * bands).astype(np.uint16), utm_grid(320, 320)
    )


def test_bands_are_measured_where_they_lie_on_one_another(exposure: Path) -> None:
    found = Bands(exposure, exposure, 1, 2).run(1)
    assert not found.is_drawn and found.group == "bands of one exposure"
    # Noise of as much as the ground varies hides most edges, and blurs the others.
    assert 0.5 < found.sameness.sharpness < 2.5
    assert found.record()["name"] == "date 1, date 2"


def test_every_date_is_measured_and_others_on_one_grid(tmp_path: Path) -> None:
    for name in ("fields/1.tif", "fields/2.tif", "river/1.tif", "river/2.tif", "river/3.tif"):
        path = tmp_path / "series" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    found = bands_of_series(tmp_path)
    apart = [one for one in found if one.reference != one.input]
    alike = [one for one in apart if one.band == one.other_band]
    others = [one for one in apart if one not in alike]
    assert len(found) == 2 * 5 + 2 * 2 + 2 * 3
    assert {(one.reference.stem, one.input.stem) for one in others} == {("1", "2"), ("2", "3")}
    assert len({(one.reference, one.input) for one in alike}) == 3
