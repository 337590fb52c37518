"""`doctor` tries what is installed: what is missing, old or broken is named with what needs it."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import rasterio.warp

import groundtie
from groundtie import installation
from groundtie.cli import main
from groundtie.installation import MISSING, OK, OPTIONAL

ROOT = Path(__file__).resolve().parents[2]


def found(name: str) -> installation.Finding:
    return next(one for one in groundtie.doctor().findings if one.name == name)


def test_here_is_all_that_is_needed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith(f"GroundTie {groundtie.__version__} in ")
    assert lines[-1] == "nothing is missing"
    assert f"ok        numpy: {np.__version__}" in lines
    assert f"ok        GDAL: {rasterio.__gdal_version__}" in [line.split(",")[0] for line in lines]


def test_what_is_missing_is_named_with_what_cannot_run(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for module in ("sklearn", "fiona", "distributed"):
        monkeypatch.setitem(sys.modules, module, None)
    assert main(["doctor"]) == 2
    lines = capsys.readouterr().out.splitlines()
    assert "missing   scikit-learn: not installed; without it: train_feature_classifier" in lines
    expected = "coregister_series, files that end in .gpkg"
    assert f"missing   fiona: not installed; without it: {expected}" in lines
    assert "not here  distributed: not installed; without it: batch on a Dask cluster" in lines
    assert lines[-1] == 'to install what is missing: pip install "fiona>=1.9" "scikit-learn>=1.2"'


@pytest.mark.slow
def test_it_runs_where_no_tool_can() -> None:
    code = (
        "import sys; sys.modules.update(dict.fromkeys(('numpy', 'rasterio', 'cv2', 'scipy')));"
        "from groundtie.cli import main; sys.exit(main(['doctor']))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code],
        env={"PYTHONPATH": str(ROOT / "algorithms"), "PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    assert "missing   numpy: not installed; without it: every tool" in done.stdout
    assert "GDAL:" not in done.stdout


def test_a_broken_package_is_named_with_its_reason(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    (tmp_path / "jinja2.py").write_text("raise AttributeError('_ARRAY_API\\nnot found')\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "jinja2", raising=False)
    jinja2 = found("jinja2")
    assert jinja2.state == MISSING
    assert jinja2.text == "broken: AttributeError: _ARRAY_API not found"
    assert jinja2.without == ("files that end in .html",)


@pytest.mark.parametrize(
    ("version", "state"), [("3.0.9", MISSING), ("3.1", OK), ("3.10.dev1", OK), ("4.0rc1", OK)]
)
def test_versions_are_compared_as_numbers(
    monkeypatch: pytest.MonkeyPatch, version: str, state: str
) -> None:
    monkeypatch.setattr(installation.metadata, "version", lambda name: version)
    jinja2 = found("jinja2")
    assert jinja2.state == state
    assert ("is too old, 3.1 is needed" in jinja2.text) == (state == MISSING)


def test_proj_without_its_data_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    assert found("PROJ's data").state == OK
    with monkeypatch.context() as wrong:
        wrong.setattr(rasterio.warp, "transform", lambda *_: ([500_001.0], [0.0]))
        assert found("PROJ's data").state == MISSING
    with monkeypatch.context() as without:

        def no_data(*_: Any) -> Any:
            raise rasterio.errors.CRSError("no proj.db")

        without.setattr(rasterio.warp, "transform", no_data)
        assert found("PROJ's data").text == "broken: CRSError: no proj.db"
        assert groundtie.doctor().exit_code == 2


def test_a_format_that_is_written_must_be_there(monkeypatch: pytest.MonkeyPatch) -> None:
    drivers = rasterio.Env.drivers

    def without(*names: str) -> Any:
        return lambda self: {k: v for k, v in drivers(self).items() if k not in names}

    monkeypatch.setattr(rasterio.Env, "drivers", without("JP2OpenJPEG"))
    assert found("GDAL").state == OK
    assert "without JP2OpenJPEG" in found("GDAL").text
    monkeypatch.setattr(rasterio.Env, "drivers", without("COG"))
    assert found("GDAL").state == MISSING


def test_grids_of_geoids_are_looked_for(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    grid = tmp_path / "egm08_25.gtx"
    grid.touch()
    monkeypatch.setenv("PROJ_DATA", str(tmp_path))
    assert found("Geoid EGM2008").text == str(grid)
    monkeypatch.setattr("groundtie.sensor.geoids._proj_folders", lambda: [])
    geoid = found("Geoid EGM96")
    assert geoid.state == OPTIONAL
    assert "projsync" in geoid.text
    assert "orthorectify" in geoid.without[0]
