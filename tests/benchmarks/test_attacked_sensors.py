"""Attacks on RPCs: where content moved, the truth moved with it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import groundtie
from benchmarks.attacks import sensors
from benchmarks.attacks.sensors import SensorCase, errors_px, lower_part, sensor_cases
from groundtie.sensor.rpc_files import read_rpc, write_rpc

MOVE = np.array([3.0, -4.0])


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("sensor") / "scene"
    groundtie.simulate_sensor(folder, size=64, density="suburban", looks=4.0, seed=3)
    return folder


def everywhere(px: np.ndarray) -> np.ndarray:
    return np.broadcast_to(MOVE, px.shape)


@pytest.mark.parametrize("seed", range(4))
def test_a_part_moves_by_what_its_truth_states(seed: int) -> None:
    image = np.random.default_rng(9).integers(1, 250, (1, 120, 100)).astype(np.uint16)
    made, moved = lower_part(image, np.random.default_rng(seed))
    px = np.stack(np.meshgrid(np.arange(30, 70), np.arange(30, 90)), axis=-1).reshape(-1, 2)
    # What is covered by what moved has no place.
    px = px[np.isfinite(moved(px)).all(axis=1)]
    assert len(px) > 1900
    to = px + moved(px).astype(int)
    np.testing.assert_array_equal(made[0, to[:, 1], to[:, 0]], image[0, px[:, 1], px[:, 0]])
    lengths = np.unique(np.hypot(*moved(px).T))
    assert lengths[0] == 0 and 5 <= lengths[-1] <= 21 and len(lengths) == 2


@pytest.mark.slow
def test_rpcs_that_follow_what_moved_are_right(scene: Path, tmp_path: Path) -> None:
    exact, output = read_rpc(scene / "exact_rpc.txt"), tmp_path / "refined_RPC.TXT"
    write_rpc(output, exact.shifted(MOVE))
    assert np.abs(errors_px(scene, output, everywhere)).max() < 1e-3
    write_rpc(output, exact)
    np.testing.assert_allclose(errors_px(scene, output, everywhere) - MOVE, 0, atol=1e-3)


@pytest.mark.slow
def test_ground_control_that_follows_what_moved_is_right(scene: Path, tmp_path: Path) -> None:
    head, *rows = (scene / "check_points.csv").read_text().split()
    columns = [head.split(",").index(name) for name in ("input_col", "input_row")]
    lines = [f"{head},role,state"]
    for row in rows:
        cells = row.split(",")
        for column, by in zip(columns, MOVE, strict=True):
            cells[column] = str(float(cells[column]) + by)
        lines.append(",".join([*cells, "fit", "used"]))
    points = tmp_path / "points.csv"
    points.write_text("\n".join(lines))
    assert np.abs(errors_px(scene, points, everywhere)).max() < 0.01
    off = errors_px(scene, points, np.zeros_like)
    np.testing.assert_allclose(off, np.broadcast_to(-MOVE, off.shape), atol=0.01)


def test_every_attack_is_tried_on_both_tools() -> None:
    every = sensor_cases([2, 3], Path())
    assert len({case.name for case in every}) == len(every) == 2 * 2 * len(sensors._ATTACKS)


@pytest.mark.slow
def test_labels_and_noise_keep_what_holds_no_data() -> None:
    image = np.random.default_rng(5).integers(1, 4000, (1, 150, 160)).astype(np.uint16)
    image[:, :20] = 0
    for change in (sensors.noisy, sensors.labelled):
        made, moved = change(image, np.random.default_rng(1))
        assert made.dtype == image.dtype and not made[:, :20].any() and made[:, 20:].all()
        assert np.mean(made[:, 20:] != image[:, 20:]) > 0.05
        assert not moved(np.ones((3, 2))).any()


def test_a_scene_has_its_own_folder_by_what_it_is_made_from(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made: list[dict[str, object]] = []

    def simulate(folder: Path, **options: object) -> None:
        folder.mkdir()
        made.append(options)

    monkeypatch.setattr(groundtie, "simulate_sensor", simulate)
    case = SensorCase("RPCs in a dense city", "-", "refine_rpc", 1, tmp_path)
    first = case._simulated("city", 0.0, 500, 2.0)
    assert case._simulated("city", 0.0, 500, 2.0) == first
    assert case._simulated("city", 30.0, 500, 2.0) != first
    assert [options["changed"] for options in made] == [0.0, 30.0]
