from __future__ import annotations

import json
from pathlib import Path

import pytest
import rasterio

from groundtie.cli import main
from groundtie.errors import CancelledError, GroundTieError, OutputError, ParameterError
from groundtie.progress import Progress
from groundtie.simulation.sensor_files import NAMES
from groundtie.tools.simulate_sensor import simulate_sensor


def content(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


@pytest.mark.slow
def test_all_files_are_written_and_named(tmp_path: Path) -> None:
    result = simulate_sensor(tmp_path / "made", 96)
    assert {path.name for path in (tmp_path / "made").iterdir()} == set(NAMES.values())
    summary = json.loads(json.dumps(result.summary()))
    assert {Path(path).name for path in summary["files"].values()} == set(NAMES.values())
    assert result.lines() == [f"{k}: {v}" for k, v in summary["files"].items()]


@pytest.mark.slow
def test_the_same_seed_gives_the_same_files(tmp_path: Path) -> None:
    for name, seed in (("one", 3), ("two", 3), ("other", 4)):
        simulate_sensor(tmp_path / name, 80, seed=seed)
    assert content(tmp_path / "one") == content(tmp_path / "two")
    assert content(tmp_path / "one") != content(tmp_path / "other")


@pytest.mark.slow
def test_parameters_reach_the_image(tmp_path: Path) -> None:
    simulate_sensor(
        tmp_path,
        100,
        "city",
        relief=0.0,
        shift=30.0,
        drift=1.5,
        rotation=0.25,
        off_nadir=10.0,
        looks=3.0,
        changed=20.0,
        pixel_size=2.0,
        incidence=42.0,
        orbit="descending",
        view_azimuth=80.0,
        heading=350.0,
    )
    options = json.loads((tmp_path / "truth.json").read_text())["options"]
    assert options["scene"]["density"] == "city"
    assert options["scene"]["changed"] == 0.2
    assert options["sar"]["incidence_deg"] == 42
    assert options["sar"]["orbit"] == "descending"
    assert options["sar"]["looks"] == 3
    assert options["optical"]["off_nadir_deg"] == 10
    assert options["optical"]["view_azimuth_deg"] == 80
    assert options["attitude"] == {"shift_m": 30, "drift_px": 1.5, "rotation_deg": 0.25}
    assert options["heading_deg"] == 350
    with rasterio.open(tmp_path / "reference.tif") as reference:
        assert reference.res == (2, 2)
    with rasterio.open(tmp_path / "dem.tif") as dem:
        heights = dem.read(1)
    assert heights.min() == heights.max() > 0


@pytest.mark.parametrize(
    ("values", "error"),
    [
        ({"size": 10}, ParameterError),
        ({"density": "village"}, ParameterError),
        ({"rotation": 5.0}, ParameterError),
        ({"off_nadir": 60.0}, ParameterError),
        ({"folder": "a file"}, OutputError),
    ],
)
def test_bad_parameters_write_nothing(
    tmp_path: Path, values: dict[str, object], error: type[GroundTieError]
) -> None:
    (tmp_path / "a file").write_text("not a folder")
    folder = tmp_path / str(values.pop("folder", "made"))
    with pytest.raises(error):
        simulate_sensor(folder, **{"size": 64, **values})
    assert [path.name for path in tmp_path.iterdir()] == ["a file"]


@pytest.mark.slow
def test_cancelling_writes_nothing(tmp_path: Path) -> None:
    said: list[float] = []
    progress = Progress(lambda fraction, _: said.append(fraction), lambda: len(said) > 2)
    with pytest.raises(CancelledError):
        simulate_sensor(tmp_path / "made", 64, progress=progress)
    assert not (tmp_path / "made").exists()


@pytest.mark.slow
def test_on_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate-sensor", str(tmp_path / "made"), "--size", "64", "--json"]) == 0
    assert set(json.loads(capsys.readouterr().out)) == {"files"}
    assert main(["simulate-sensor", str(tmp_path / "made"), "--rotation", "9"]) == 2
    assert "--rotation" in capsys.readouterr().err
