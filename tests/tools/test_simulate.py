from __future__ import annotations

import csv
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import rasterio
from raster_files import full_disk

from groundtie import load_transform
from groundtie.cli import main
from groundtie.errors import CancelledError, GroundTieError, OutputError, ParameterError
from groundtie.progress import Progress
from groundtie.tools.simulate import simulate
from groundtie.tools.simulate_sensor import simulate_sensor

NAMES = [
    "check_points.csv",
    "dem.tif",
    "dsm.tif",
    "input.json",
    "input.tif",
    "reference.json",
    "reference.tif",
    "roof_points.csv",
    "truth.json",
]


def content(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def test_all_files_are_written_and_named(tmp_path: Path) -> None:
    result = simulate(tmp_path / "made", 96)
    assert sorted(path.name for path in (tmp_path / "made").iterdir()) == NAMES
    summary = json.loads(json.dumps(result.summary()))
    assert sorted(Path(path).name for path in summary["files"].values()) == NAMES
    assert all(Path(path).is_file() for path in summary["files"].values())
    assert result.lines() == [f"{k}: {v}" for k, v in summary["files"].items()]


@pytest.mark.slow
def test_the_same_seed_gives_the_same_pair(tmp_path: Path) -> None:
    for name, seed in (("one", 3), ("two", 3), ("other", 4)):
        simulate(tmp_path / name, 80, seed=seed)
    assert content(tmp_path / "one") == content(tmp_path / "two")
    one, other = content(tmp_path / "one"), content(tmp_path / "other")
    assert all(one[name] != other[name] for name in NAMES)


@pytest.mark.parametrize("size", [0.0, 5.0, 12.0])
@pytest.mark.slow
def test_the_shift_is_as_long_as_asked_for(tmp_path: Path, size: float) -> None:
    simulate(tmp_path, 96, distortion="shift", shift=size, pixel_size=2.0)
    truth = load_transform(tmp_path / "truth.json")
    with rasterio.open(tmp_path / "reference.tif") as reference:
        assert reference.res == (2, 2)
        assert reference.shape == (96, 96)
        xy = np.array([reference.xy(10, 20), reference.xy(70, 50)])
    off = truth(xy) - [[20, 10], [50, 70]]
    np.testing.assert_allclose(np.hypot(*off.T), size, atol=1e-6)


def test_the_smallest_scene_is_warped_by_what_it_can_bear(tmp_path: Path) -> None:
    simulate(tmp_path, 64, shift=0.0)
    truth = load_transform(tmp_path / "truth.json")
    with rasterio.open(tmp_path / "reference.tif") as reference:
        corners = [(0, 0), (0, 63), (63, 0), (63, 63)]
        xy = np.array([reference.xy(row, col) for row, col in corners])
    off = truth(xy) - [[col, row] for row, col in corners]
    assert 2.5 < np.hypot(*off.T).max() < 3.2


def test_parameters_reach_the_pair(tmp_path: Path) -> None:
    simulate(
        tmp_path,
        96,
        "rural",
        "similarity",
        rotation=3.0,
        scale=1.05,
        input_pixel_size=2.0,
        relief=0.0,
    )
    truth = json.loads((tmp_path / "truth.json").read_text())
    matrix = np.array(truth["reference_to_input"])[:, :2]
    # Two reference pixels are one of the input's; the content is 1.05 times as large and turned.
    assert np.sqrt(np.linalg.det(matrix)) == pytest.approx(1.05 / 2)
    assert abs(np.rad2deg(np.arctan2(matrix[1, 0], matrix[0, 0]))) == pytest.approx(3)
    with rasterio.open(tmp_path / "input.tif") as image, rasterio.open(tmp_path / "dem.tif") as dem:
        assert image.shape == (48, 48)
        assert np.ptp(dem.read()) == 0


@pytest.mark.slow
def test_views_reach_the_pair(tmp_path: Path) -> None:
    simulate(
        tmp_path,
        200,
        "city",
        relief=0.0,
        changed=25.0,
        incidence=45.0,
        orbit="descending",
        off_nadir=20.0,
        view_azimuth=90.0,
    )
    options = json.loads((tmp_path / "truth.json").read_text())["options"]
    assert options["scene"]["changed"] == 0.25
    assert options["optical"]["view_azimuth_deg"] == 90
    assert options["optical"]["off_nadir_deg"] == 20
    with (tmp_path / "roof_points.csv").open(newline="", encoding="utf-8") as stream:
        roofs = list(csv.DictReader(stream))
    assert roofs
    with rasterio.open(tmp_path / "reference.tif") as reference:
        west = reference.bounds.left + 0.5
    for roof in roofs:
        layover = float(roof["reference_col"]) - (float(roof["x"]) - west)
        # The tangent of 45° is 1, and the radar looks west.
        assert layover == pytest.approx(float(roof["height_m"]), abs=1e-5)


def test_more_looks_are_less_speckle(tmp_path: Path) -> None:
    roughness = []
    for looks in (1.0, 16.0):
        simulate(tmp_path, 96, "rural", looks=looks)
        with rasterio.open(tmp_path / "reference.tif") as reference:
            amplitude = reference.read(1).astype(float)
        roughness.append(np.median(np.abs(np.diff(np.log(amplitude + 1), axis=1))))
    assert roughness[1] < 0.5 * roughness[0]


@pytest.mark.parametrize(
    ("values", "error"),
    [
        ({"size": 10}, ParameterError),
        ({"density": "village"}, ParameterError),
        ({"distortion": "none"}, ParameterError),
        ({"size": 96, "input_pixel_size": 20.0}, ParameterError),
        ({"size": 96, "warp": 40.0}, ParameterError),
        ({"size": 96, "distortion": "shift", "warp": 4.0}, ParameterError),
        ({"size": 96, "distortion": "scale", "rotation": 1.0}, ParameterError),
        ({"size": 96, "scale": 1.1}, ParameterError),
        ({"folder": "a file"}, OutputError),
    ],
)
def test_bad_parameters_write_nothing(
    tmp_path: Path, values: dict[str, object], error: type[GroundTieError]
) -> None:
    (tmp_path / "a file").write_text("not a folder")
    before = content(tmp_path)
    folder = tmp_path / str(values.pop("folder", "made"))
    with pytest.raises(error):
        simulate(folder, **values)
    assert {p.name for p in tmp_path.iterdir()} == set(before)


def test_cancelling_writes_nothing(tmp_path: Path) -> None:
    said: list[float] = []
    progress = Progress(lambda fraction, _: said.append(fraction), lambda: len(said) > 2)
    with pytest.raises(CancelledError):
        simulate(tmp_path / "made", 96, progress=progress)
    assert not (tmp_path / "made").exists()


@pytest.mark.parametrize("is_there", [False, True])
@pytest.mark.parametrize(("make", "free_bytes"), [(simulate, 4000), (simulate_sensor, 0)])
@pytest.mark.slow
def test_a_full_disk_leaves_nothing(
    tmp_path: Path, make: Callable[[Path, int], object], free_bytes: int, is_there: bool
) -> None:
    folder = tmp_path / "above" / "made"
    if is_there:
        folder.mkdir(parents=True)
    with pytest.raises(OutputError, match=r"cannot write|no space"), full_disk(free_bytes):
        make(folder, 80)
    assert [*tmp_path.rglob("*")] == ([tmp_path / "above", folder] if is_there else [])


def test_on_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", str(tmp_path / "made"), "--size", "80", "--json"]) == 0
    assert set(json.loads(capsys.readouterr().out)) == {"files"}
    assert main(["simulate", str(tmp_path / "made"), "--size", "1"]) == 2
    assert "--size" in capsys.readouterr().err
