"""The suite of masks: peaks away from 0 are errors, gathered by mask and similarity."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from masks.town import draw_town
from raster_files import utm_grid, write_raster

from benchmarks import masks
from benchmarks.masks import MASKS, SIMILARITIES, Found
from groundtie.masks.scene import Scene
from groundtie.rasters.reading import open_raster


def test_an_error_is_the_length_of_the_shift() -> None:
    found = Found(1, "no mask", "nmi", 3.0, -4.0)
    assert found.error_px == 5.0
    assert found.record()["error_px"] == 5.0


def test_the_table_has_a_row_for_each_mask() -> None:
    cells = {(mask, similarity): [0.5, 1.5, 2.5] for mask in MASKS for similarity in SIMILARITIES}
    table = masks.table(cells)
    assert [row[0] for row in table.rows] == list(MASKS)
    assert table.rows[0][1:] == ["1.5 (33%)"] * 3
    assert masks.stability(cells).found == "1.5, 1.5, 1.5, 1.5"


@pytest.mark.parametrize("name", ["brightest 20 %", "regions, 11 m"])
def test_masks_leave_a_part(name: str, tmp_path: Path) -> None:
    town = draw_town()
    path = write_raster(tmp_path / "a.tif", town.amplitude, utm_grid(400, 400, 1.0))
    with open_raster(path) as source:
        scene = Scene.of(source)
        make = MASKS[name]
        assert make is not None
        chosen = make(scene)(scene.whole).part
    assert 0.05 < chosen.mean() < 0.85
    assert np.mean(town.amplitude[chosen]) < 0.6 * np.mean(town.amplitude[~chosen])
