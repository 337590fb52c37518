"""One version number, found wherever the package lies."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest

from groundtie import version

ROOT = Path(__file__).resolve().parents[2]


def write_metadata(folder: Path, number: str, name: str = "GroundTie") -> None:
    folder.mkdir(parents=True, exist_ok=True)
    text = f"[general]\nname={name}\nabout=100 %% sure\nversion={number}\n"
    (folder / "metadata.txt").write_text(text, encoding="utf-8")


def test_version_is_that_of_metadata_txt() -> None:
    text = (ROOT / "metadata.txt").read_text(encoding="utf-8")
    assert re.findall(r"^version=(.+)$", text, re.MULTILINE) == [version.__version__]


def test_version_is_written_nowhere_else() -> None:
    for path in (ROOT / "pyproject.toml", *(ROOT / "algorithms" / "groundtie").glob("*.py")):
        assert version.__version__ not in path.read_text(encoding="utf-8"), path


@pytest.mark.parametrize("package", ["groundtie_qgis/groundtie", "algorithms/groundtie"])
def test_finds_metadata_of_plugin_and_of_source_tree(tmp_path: Path, package: str) -> None:
    home = "groundtie_qgis" if package.startswith("groundtie_qgis") else "."
    write_metadata(tmp_path / home, "7.8.9")
    assert version.find_version(tmp_path / package) == "7.8.9"


def test_plugin_folder_goes_before_the_folder_around_it(tmp_path: Path) -> None:
    write_metadata(tmp_path, "1.0.0")
    write_metadata(tmp_path / "groundtie_qgis", "2.0.0")
    assert version.find_version(tmp_path / "groundtie_qgis" / "groundtie") == "2.0.0"


@pytest.mark.parametrize("foreign", [b"no section\n", b"\xff\xfe", b"[general]\nname=Other\n"])
def test_another_projects_metadata_is_passed_over(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, foreign: bytes
) -> None:
    (tmp_path / "metadata.txt").write_bytes(foreign)
    monkeypatch.setattr(metadata, "version", {"groundtie": "3.2.1"}.__getitem__)
    assert version.find_version(tmp_path / "groundtie") == "3.2.1"


def test_installed_copy_without_metadata_txt_asks_its_distribution(tmp_path: Path) -> None:
    shutil.copytree(ROOT / "algorithms/groundtie", tmp_path / "a/b/groundtie")
    dist_info = tmp_path / "a/b/groundtie-4.5.6.dist-info"
    dist_info.mkdir()
    text = "Metadata-Version: 2.1\nName: groundtie\nVersion: 4.5.6\n"
    (dist_info / "METADATA").write_text(text, encoding="utf-8")
    found = subprocess.run(
        [sys.executable, "-c", "from groundtie.version import __version__ as v; print(v)"],
        env={"PYTHONPATH": str(tmp_path / "a/b"), "PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert found.stdout.strip() == "4.5.6"


def test_unknown_version_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> str:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(metadata, "version", missing)
    with pytest.raises(metadata.PackageNotFoundError):
        version.find_version(tmp_path / "groundtie")
