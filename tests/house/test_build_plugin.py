"""The plugin's zip keeps the rules of QGIS's plugin repository."""

from __future__ import annotations

import configparser
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

pytest.importorskip("tomllib", reason="the build needs Python 3.11")
from scripts import build_plugin

ROOT = Path(__file__).resolve().parents[2]
REQUIRED = (
    *("name", "description", "about", "version", "qgisMinimumVersion"),
    *("author", "email", "tracker", "repository"),
)
REFUSED = ("..", ".pyc", "__pycache__", ".git", "__MACOSX")
MAX_BYTES = 25 * 2**20


@pytest.fixture
def tree(tmp_path: Path) -> Path:
    """Return the root of a small source tree with junk in it."""
    root = tmp_path / "tree"
    files = {
        "plugin/groundtie_qgis/__init__.py": "def classFactory(iface): ...\n",
        "plugin/groundtie_qgis/icons/groundtie.svg": "<svg/>",
        "plugin/groundtie_qgis/__pycache__/x.cpython-311.pyc": "junk",
        "plugin/groundtie_qgis/.DS_Store": "junk",
        "plugin/groundtie_qgis/provider.py~": "junk",
        "plugin/other/__init__.py": "junk",
        "algorithms/groundtie/__init__.py": "",
        "algorithms/groundtie/quality/page.html.j2": "<html>",
        "algorithms/groundtie/.mypy_cache/y.json": "junk",
        "algorithms/groundtie/old.pyc": "junk",
        "algorithms/groundtie.egg-info/PKG-INFO": "junk",
        "metadata.txt": (ROOT / "metadata.txt").read_text(encoding="utf-8"),
        "LICENSE": "licence",
        "pyproject.toml": '[project]\ndependencies = ["numpy>=1.24", "scipy>=1.10"]\n',
    }
    for name, text in files.items():
        path = root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return root


def contents(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        assert archive.testzip() is None
        return {name: archive.read(name) for name in archive.namelist()}


def check_rules(path: Path) -> None:
    """Assert what the validator of plugins.qgis.org checks."""
    assert path.stat().st_size <= MAX_BYTES
    files = contents(path)
    assert not [name for name in files if any(part in name for part in REFUSED)]
    (top,) = {name.split("/")[0] for name in files}
    assert top.isidentifier()
    assert {f"{top}/__init__.py", f"{top}/metadata.txt", f"{top}/LICENSE"} <= files.keys()
    parser = configparser.ConfigParser()
    parser.read_string(files[f"{top}/metadata.txt"].decode("utf-8"))
    general = dict(parser["general"])
    assert all(general[key.lower()].strip() for key in REQUIRED)
    assert "/" not in general["author"]
    for link in ("tracker", "repository", "homepage"):
        assert general[link].startswith("https://")
    if "icon" in general:
        assert f"{top}/{general['icon']}" in files


def test_zip_holds_plugin_library_and_papers(tree: Path, tmp_path: Path) -> None:
    target = build_plugin.build(tree, tmp_path / "dist" / "plugin.zip")
    files = contents(target)
    assert sorted(files) == [
        "groundtie_qgis/LICENSE",
        "groundtie_qgis/__init__.py",
        "groundtie_qgis/groundtie/__init__.py",
        "groundtie_qgis/groundtie/quality/page.html.j2",
        "groundtie_qgis/icons/groundtie.svg",
        "groundtie_qgis/metadata.txt",
        "groundtie_qgis/requirements.txt",
    ]
    assert files["groundtie_qgis/requirements.txt"] == b"numpy>=1.24\nscipy>=1.10\n"
    assert files["groundtie_qgis/metadata.txt"] == (ROOT / "metadata.txt").read_bytes()
    check_rules(target)


def test_same_tree_gives_the_same_bytes(tree: Path, tmp_path: Path) -> None:
    first = build_plugin.build(tree, tmp_path / "first.zip").read_bytes()
    for path in tree.rglob("*"):
        os.utime(path, (1e9, 1e9))
        path.chmod(0o755)
    assert build_plugin.build(tree, tmp_path / "second.zip").read_bytes() == first


def test_unpacked_library_finds_the_plugins_version(tree: Path, tmp_path: Path) -> None:
    library = tree / "algorithms/groundtie"
    (library / "version.py").write_bytes((ROOT / "algorithms/groundtie/version.py").read_bytes())
    with zipfile.ZipFile(build_plugin.build(tree, tmp_path / "plugin.zip")) as archive:
        archive.extractall(tmp_path / "profile")
    code = "from groundtie_qgis.groundtie.version import __version__ as v; print(v)"
    found = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path / "profile",
        capture_output=True,
        text=True,
        check=True,
    )
    parser = configparser.ConfigParser()
    parser.read(ROOT / "metadata.txt", encoding="utf-8")
    assert found.stdout.strip() == parser["general"]["version"]


@pytest.mark.parametrize(
    "name",
    [
        "plugin/groundtie_qgis/__init__.py",
        "algorithms/groundtie/__init__.py",
        "metadata.txt",
        "LICENSE",
        "pyproject.toml",
    ],
)
def test_missing_part_leaves_the_old_zip_alone(tree: Path, tmp_path: Path, name: str) -> None:
    target = build_plugin.build(tree, tmp_path / "plugin.zip")
    before = target.read_bytes()
    (tree / name).unlink()
    with pytest.raises(FileNotFoundError, match=Path(name).parent.name or name):
        build_plugin.build(tree, target)
    assert target.read_bytes() == before
    assert [path.name for path in tmp_path.iterdir() if path.is_file()] == ["plugin.zip"]


def test_interrupted_build_leaves_no_file(
    tree: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError("no space left on device")

    monkeypatch.setattr(zipfile.ZipFile, "writestr", full)
    with pytest.raises(OSError, match="no space"):
        build_plugin.build(tree, tmp_path / "dist" / "plugin.zip")
    assert list((tmp_path / "dist").iterdir()) == []


def test_a_file_in_the_way_of_the_library_is_refused(tree: Path, tmp_path: Path) -> None:
    inside = tree / "plugin/groundtie_qgis/groundtie/__init__.py"
    inside.parent.mkdir()
    inside.write_text("", encoding="utf-8")
    with pytest.raises(ValueError, match="groundtie/__init__"):
        build_plugin.build(tree, tmp_path / "plugin.zip")


@pytest.mark.slow
def test_the_real_plugin_keeps_the_rules(tmp_path: Path) -> None:
    target = tmp_path / "groundtie_qgis.zip"
    command = [sys.executable, str(ROOT / "scripts/build_plugin.py"), str(target)]
    subprocess.run(command, cwd=tmp_path, check=True)
    check_rules(target)
    files = contents(target)
    for source in (ROOT / "algorithms/groundtie").rglob("*.py"):
        name = source.relative_to(ROOT / "algorithms").as_posix()
        assert files[f"groundtie_qgis/{name}"] == source.read_bytes()
