"""Chips count as matched where the peak lies at the truth, and nowhere else."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from benchmark_cases import MATRIX
from benchmark_scenes import textured_scene
from raster_files import utm_grid

from benchmarks import chips
from benchmarks.chips import ChipCase, ChipShare, chip_centres
from groundtie.similarity.surface import SIMILARITIES


@pytest.fixture(autouse=True)
def small_chips(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chips, "CHIPS_PX", (41, 401))


def of_size(records: tuple[ChipShare, ...], chip_px: int) -> dict[str, ChipShare]:
    return {record.similarity: record for record in records if record.chip_px == chip_px}


@pytest.mark.slow
def test_every_similarity_matches_images_of_the_same_ground(tmp_path: Path) -> None:
    found = ChipCase(textured_scene(tmp_path), 4).run(1)
    small = of_size(found.records, 41)
    assert tuple(small) == SIMILARITIES
    assert {record.chips for record in small.values()} == {4}
    assert {record.shares for record in small.values()} == {(1.0, 1.0)}
    assert all(record.milliseconds > 0 for record in small.values())
    assert {record.group for record in small.values()} == {"sar-optical"}
    assert "texture, 4 chips" in found.line() and "ncc 100%" in found.line()


@pytest.mark.parametrize(("wrong_px", "shares"), [(2.0, (0.0, 1.0)), (5.0, (0.0, 0.0))])
def test_peaks_beside_the_truth_do_not_count(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, wrong_px: float, shares: tuple[float, ...]
) -> None:
    monkeypatch.setattr(chips, "SIMILARITIES", ("ncc",))
    off = MATRIX.copy()
    off[:, 2] += off[:, :2] @ [wrong_px, 0.0]
    found = ChipCase(textured_scene(tmp_path, off), 4).run(1)
    assert of_size(found.records, 41)["ncc"].shares == shares


@pytest.mark.slow
def test_chips_that_are_larger_than_the_image_have_no_share(tmp_path: Path) -> None:
    found = ChipCase(textured_scene(tmp_path), 2).run(1)
    large = of_size(found.records, 401)
    assert {(record.chips, record.shares) for record in large.values()} == {(0, ())}


def test_chips_and_their_search_windows_lie_inside() -> None:
    grid = utm_grid(300, 220)
    centres = chip_centres(grid, 61, 1000)
    reach = 30 + chips.RADIUS_PX + chips.BORDER_PX
    assert centres.min() >= reach
    assert np.all(centres + reach <= np.array([299, 219]))
    assert set(np.diff(np.unique(centres[:, 0]))) == {chips.SPACING_PX}


def test_many_chips_are_thinned_evenly() -> None:
    grid = utm_grid(1000, 1000)
    every, some = chip_centres(grid, 61, 10**6), chip_centres(grid, 61, 50)
    assert len(some) == 50 < len(every)
    assert {tuple(centre) for centre in some} <= {tuple(centre) for centre in every}
    np.testing.assert_array_equal(some[[0, -1]], every[[0, -1]])
