"""The command line with the tools themselves, in processes of their own."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import rasterio
from noise_pairs import ORIGIN, POINTS, true_input_px, write_pair, write_raster
from own_processes import ENVIRONMENT, interrupted

from groundtie import load_transform


@pytest.fixture(autouse=True)
def _folder(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)


class TestRealTools:
    """The tools themselves, in processes of their own."""

    QUICK = "--model translation --search-radius 12"

    @pytest.fixture(autouse=True)
    def _pairs(self, tmp_path: Path) -> None:
        for seed, name in enumerate(("here", "there")):
            (tmp_path / name).mkdir()
            write_pair(tmp_path / name, seed)
        (tmp_path / "out").mkdir()

    def run(self, words: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "groundtie", *words.split()]
        return subprocess.run(
            command, env=ENVIRONMENT, text=True, capture_output=True, timeout=300, check=False
        )

    @pytest.mark.slow
    def test_an_accepted_registration(self) -> None:
        files = "--transform out/t.json --tie-points out/p.gpkg --report out/r.html"
        done = self.run(
            f"coregister here/reference.tif here/input.tif out/o.tif {self.QUICK} {files} --json"
        )
        assert (done.returncode, done.stderr) == (0, "")
        assert json.loads(done.stdout)["verdict"]["accepted"] is True
        names = sorted(path.name for path in Path("out").iterdir())
        assert names == ["o.tif", "p.gpkg", "r.html", "r.json", "t.json"]
        reference_xy = ORIGIN + np.array([[50, -50], [50, -330], [330, -50]])
        found = load_transform(Path("out/t.json"))(reference_xy)
        np.testing.assert_allclose(found, true_input_px(reference_xy), atol=0.3)

    @pytest.mark.slow
    def test_a_refused_registration(self) -> None:
        done = self.run(
            f"coregister here/reference.tif there/input.tif out/o.tif {self.QUICK} --json"
        )
        assert done.returncode == 3
        assert done.stderr.startswith("groundtie: error: there/input.tif was not registered to")
        assert done.stderr.count("\n") == 1
        assert json.loads(done.stdout)["verdict"]["accepted"] is False
        assert list(Path("out").iterdir()) == []

    @pytest.mark.slow
    @pytest.mark.parametrize(
        ("images", "named"),
        [
            ("here/reference.tif here/no.tif", "here/no.tif"),
            ("here/reference.tif broken.tif", "broken.tif"),
            ("here/reference.tif here/input.tif --input-band 7", "here/input.tif"),
            ("here/reference.tif here/reference.tif", "here/reference.tif"),
        ],
    )
    def test_bad_input_names_its_file(self, images: str, named: str) -> None:
        Path("broken.tif").write_bytes(Path("here/input.tif").read_bytes()[:1000])
        reference, input, *more = images.split()
        done = self.run(f"coregister {reference} {input} out/o.tif {' '.join(more)}")
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr.startswith("groundtie: error: ")
        assert named in done.stderr
        assert done.stderr.count("\n") == 1
        assert list(Path("out").iterdir()) == []

    @pytest.mark.slow
    def test_images_without_georeferencing_raise_no_other_voices(self) -> None:
        for name in ("reference", "input"):
            with rasterio.open(f"here/{name}.tif") as raster:
                bands = raster.read()
            write_raster(Path(f"{name}.tif"), bands, None)
        done = self.run(f"coregister reference.tif input.tif out/o.tif {self.QUICK}")
        assert (done.returncode, done.stderr) == (0, "")

    @pytest.mark.slow
    def test_warp_and_simulate(self) -> None:
        Path("truth.points").write_text(POINTS)
        done = self.run("warp here/input.tif out/w.tif --transform truth.points")
        assert (done.returncode, done.stderr) == (0, "")
        done = self.run("simulate out/pair --size 128 --json")
        assert (done.returncode, done.stderr) == (0, "")
        assert Path(json.loads(done.stdout)["files"]["reference"]).exists()

    @pytest.mark.slow
    @pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
    def test_a_signal_in_the_middle_leaves_nothing(self, number: signal.Signals) -> None:
        words = "coregister here/reference.tif here/input.tif out/o.tif --report out/r.html"
        command = [sys.executable, "-m", "groundtie", *words.split()]
        code, out, rest = interrupted(command, "matching tie points\x1b[K", number)
        assert (code, out) == (128 + number, "")
        assert rest.endswith("\r\x1b[Kgroundtie: error: cancelled; nothing was written\r\n")
        assert list(Path("out").iterdir()) == []


def test_python_m_groundtie() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "groundtie", "no-such-tool"],
        env=ENVIRONMENT,
        text=True,
        capture_output=True,
        check=False,
    )
    assert done.returncode == 2
    assert (
        done.stderr == "groundtie: error: No such command 'no-such-tool' (see groundtie --help)\n"
    )
