"""Chips that are matched at the truth, and what becomes of their shares."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from benchmark_cases import MATRIX
from benchmark_scenes import textured_scene

from benchmarks import fusion
from benchmarks.fusion import (
    FUSED,
    SINGLE,
    FusionCase,
    FusionShare,
    goals,
    share_within,
    shares_table,
    true_shifts,
    wave,
)
from benchmarks.offsets import OffsetPair, apply_matrix, open_offset

REAL, SIMULATED = "real SAR pairs", "simulated pairs"


@pytest.fixture(autouse=True)
def small_chips(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fusion, "CHIP_PX", 41)


def shares(name: str, group: str, fused: float, singles: tuple[float, ...]) -> list[FusionShare]:
    """Shares without support; with it they are 0.1 higher, distorted 0.05 lower."""
    values = zip((FUSED, *SINGLE), (fused, *singles), strict=True)
    made = [FusionShare(name, group, s, 10, False, v, v, v + 0.1) for s, v in values]
    return [*made, FusionShare(name, group, FUSED, 10, True, fused, fused - 0.05, fused + 0.05)]


@pytest.mark.slow
def test_all_chips_of_the_same_ground_are_matched(tmp_path: Path) -> None:
    found = FusionCase(textured_scene(tmp_path)).run(1)
    assert [(r.similarity, r.distorted) for r in found.records] == [
        (FUSED, False),
        *((single, False) for single in SINGLE),
        (FUSED, True),
    ]
    for record in found.records:
        assert (record.one_way, record.alone, record.supported) == (1.0, 1.0, 1.0)
        assert record.chips > 0
        assert record.group == REAL
    assert "fused (distorted) 100%, 100%" in found.line()


@pytest.mark.slow
def test_peaks_beside_the_truth_do_not_count(tmp_path: Path) -> None:
    off = MATRIX.copy()
    off[:, 2] += off[:, :2] @ [4.0, 0.0]
    found = FusionCase(textured_scene(tmp_path, off)).run(1)
    plain = [r for r in found.records if not r.distorted]
    assert {(r.one_way, r.alone, r.supported) for r in plain} == {(0.0, 0.0, 0.0)}


@pytest.mark.parametrize(("shift", "share"), [((2.0, 1.0), 1.0), ((6.0, 1.0), 0.0)])
def test_chips_within_three_pixels_count(shift: tuple[float, float], share: float) -> None:
    y, x = np.mgrid[-12:13, -12:13]
    surface = np.exp(-((x - 1) ** 2 + (y - 2) ** 2) / 4).astype(np.float32)
    assert share_within(np.stack([surface] * 3), np.tile(shift, (3, 1))) == share


def test_true_shifts_are_where_the_distorted_input_shows_a_chip(tmp_path: Path) -> None:
    scene = textured_scene(tmp_path)
    offset = np.array([3.0, -4.0])
    with open_offset(scene.pair(tmp_path), offset) as pair:
        centres = np.array([[40.0, 60.0], [90.0, 100.0], [150.0, 30.0]])
        shown_at = centres + true_shifts(pair, centres, distorted=True)
        to_px = distorting(pair)
        # There the distorted input shows the input pixel that belongs to the chip's centre.
        found = to_px(pair.images.grid.pixel_to_map(shown_at))
        np.testing.assert_allclose(found, apply_matrix(pair.matrix, centres), atol=1e-6)
        np.testing.assert_array_equal(true_shifts(pair, centres, False), np.tile(offset, (3, 1)))


def distorting(pair: OffsetPair) -> fusion.ToPixel:
    return fusion._distorting(pair)


def test_the_wave_is_no_model_of_degree_1() -> None:
    px = np.stack(np.meshgrid(np.arange(0, 600, 30.0), np.arange(0, 600, 30.0)), -1).reshape(-1, 2)
    design = np.column_stack([px, np.ones(len(px))])
    shifts = wave(px)
    left = shifts - design @ np.linalg.lstsq(design, shifts, rcond=None)[0]
    assert np.abs(shifts).max() <= fusion.WAVE_PX
    assert np.hypot(*left.T).max() > fusion.WAVE_PX / 2


def test_goals_are_the_mean_and_the_largest_deficit() -> None:
    records = [
        *shares("a", REAL, 0.80, (0.60, 0.82, 0.5, 0.3)),
        *shares("b", REAL, 0.74, (0.78, 0.70, 0.5, 0.2)),
        *shares("c", SIMULATED, 0.70, (0.60, 0.60, 0.5, 0.3)),
    ]
    found = goals(records, quick=False)
    assert [goal.found for goal in found[:4]] == ["77.0%", "4.0%", "87.0%", "4.0%"]
    assert [goal.reached for goal in found] == [True, False, False, False, *[False, True] * 2]
    assert {goal.reached for goal in goals(records, quick=True)} == {None}


def test_the_table_has_every_pair_and_the_means() -> None:
    records = [
        *shares("a", REAL, 0.80, (0.60, 0.82, 0.5, 0.3)),
        *shares("b", REAL, 0.74, (0.78, 0.70, 0.5, 0.2)),
        *shares("c", SIMULATED, 0.50, (0.60, 0.60, 0.5, 0.3)),
    ]
    table = shares_table(records, "alone")
    assert table.head == ("pair", "chips", FUSED, *SINGLE, "fused, distorted")
    assert [row[0] for row in table.rows] == [
        "a",
        "b",
        f"mean of {REAL}",
        "c",
        f"mean of {SIMULATED}",
    ]
    assert table.rows[0][1:] == ["10", "80%", "60%", "82%", "50%", "30%", "75%"]
    assert table.rows[2][1:] == ["20", "77.0%", "69.0%", "76.0%", "50.0%", "25.0%", "72.0%"]
    assert shares_table(records, "supported").rows[0][2] == "90%"
