"""Speed is compared with peers that are there, and those that are not are named."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import numpy as np
import pytest
import rasterio
from benchmark_cases import MATRIX

from benchmarks import speed
from benchmarks.attempt import Pair
from benchmarks.cases import RealCase, write_case
from benchmarks.speed import (
    AROSICS_LOCAL,
    OWN,
    SIMPLEITK_AFFINE,
    SIMPLEITK_METRIC,
    Record,
    affine_goals,
    describe_found,
    measurements,
    peer_python,
    read_window,
    surface_goal,
    surface_shifts,
)
from groundtie.geometry.transform import Transform
from groundtie.rasters.grid import Grid


def record(program: str, seconds: float, **more: object) -> Record:
    return Record("something", program, seconds, **more)  # type: ignore[arg-type]


@pytest.fixture
def pair(cases: dict[str, RealCase], tmp_path: Path) -> Pair:
    return write_case(cases["plain"], (3.0, 4.0), tmp_path)


@pytest.mark.parametrize(("peer", "reached"), [(60.0, True), (59.9, False), (200.0, True)])
def test_the_surface_must_be_sixty_times_faster(peer: float, reached: bool) -> None:
    goal = surface_goal([record(OWN, 1.0), record(SIMPLEITK_METRIC, peer)])
    assert goal.reached is reached


def test_a_peer_that_is_missing_is_neither_beaten_nor_lost_to() -> None:
    goals = [surface_goal([record(OWN, 1.0)]), *affine_goals([record(OWN, 1.0)])]
    assert [goal.reached for goal in goals] == [None] * 3
    assert all("not installed" in goal.found for goal in goals)


def test_affine_registrations_are_compared_with_each_peer() -> None:
    records = [record(OWN, 4.0), record(SIMPLEITK_AFFINE, 5.0), record(AROSICS_LOCAL, 3.0)]
    assert [goal.reached for goal in affine_goals(records)] == [True, False]
    assert affine_goals(records)[0].found == "4.0 s against 5.0 s"


def test_missing_peers_stand_in_the_table() -> None:
    rows = measurements([record(OWN, 1.0), record(AROSICS_LOCAL, 2.0, peak_bytes=3_000_000)]).rows
    assert [row[1] for row in rows] == [OWN, AROSICS_LOCAL, SIMPLEITK_METRIC, SIMPLEITK_AFFINE]
    assert [row[2] for row in rows] == ["1.00", "2.00", "not installed", "not installed"]
    assert [row[3] for row in rows[:2]] == ["–", "3"]


def test_shifts_of_the_surface_are_counted() -> None:
    assert surface_shifts(1) == 41 * 41
    # -18, -15, … 18 in both directions.
    assert surface_shifts(3) == 13 * 13


def test_windows_are_cut_from_the_centre(tmp_path: Path) -> None:
    image = np.arange(2 * 10 * 12, dtype=np.uint16).reshape(2, 10, 12)
    path = tmp_path / "image.tif"
    profile = {"driver": "GTiff", "count": 2, "height": 10, "width": 12, "dtype": "uint16"}
    with rasterio.open(path, "w", **profile) as target:
        target.write(image)
    np.testing.assert_array_equal(read_window(path, 4), image[:, 3:7, 4:8].mean(axis=0))


def test_the_own_result_is_compared_with_the_truth(pair: Pair) -> None:
    with rasterio.open(pair.input) as source:
        grid = Grid(source.transform, source.crs, source.width, source.height)
    transform = Transform.nominal(grid.crs, grid).to_json()
    output = json.dumps({"verdict": {"accepted": True}, "transform": transform})
    assert describe_found(OWN, output, pair) == "error 5.00 px"


def test_a_refusal_is_told(pair: Pair) -> None:
    assert describe_found(OWN, json.dumps({"verdict": {"accepted": False}}), pair) == "refused"


def test_a_peers_matrix_is_compared_with_the_truth(pair: Pair) -> None:
    off = MATRIX.copy()
    off[:, 2] += MATRIX[:, :2] @ [6.0, 8.0]
    output = f"Optimizer stopped.\n{json.dumps(off.tolist())}\n"
    assert describe_found(SIMPLEITK_AFFINE, output, pair) == "error 10.00 px"


def test_a_peers_tie_points_are_told(pair: Pair) -> None:
    output = json.dumps({"tie_points": 7, "of": 100})
    assert describe_found(AROSICS_LOCAL, output, pair) == "7 tie points of 100 kept"


def test_a_peer_is_there_once_its_installation_is_complete(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(speed, "ENVIRONMENTS", tmp_path)
    (tmp_path / "simpleitk" / "bin").mkdir(parents=True)
    assert peer_python("simpleitk") is None
    (tmp_path / "simpleitk" / ".installed").touch()
    assert peer_python("simpleitk") == tmp_path / "simpleitk" / "bin" / "python"


def test_scripts_are_where_they_are_looked_for() -> None:
    for name in ("simpleitk_affine.py", "simpleitk_surface.py", "arosics_local.py"):
        compile((speed.PEERS / name).read_text(), name, "exec")
    script = speed.PEERS.parent / "make_peers_env.sh"
    subprocess.run(["bash", "-n", script], check=True)
    assert ".peers" in script.read_text()


def test_the_own_surface_is_timed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(speed, "WINDOW_PX", 48)
    monkeypatch.setattr(speed, "RADIUS_PX", 3)
    side = 48 + 2 * speed.BORDER_PX
    noise = np.random.default_rng(0).normal(size=(side + 6, side + 6)).astype(np.float32)
    assert speed._own_surface_seconds(noise[3:-3, 3:-3], noise) > 0
