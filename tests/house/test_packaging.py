"""What is declared is what is imported, and what is installed is complete."""

from __future__ import annotations

import ast
import os
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import venv
import zipfile
from email.parser import Parser
from importlib import metadata
from pathlib import Path

import pytest
from noise_pairs import write_pair

tomllib = pytest.importorskip("tomllib", reason="reading pyproject.toml needs Python 3.11")

from groundtie.version import __version__  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
# Distributions whose modules have another name, and modules that come with a declared one.
MODULES = {"opencv-python-headless": "cv2", "pyyaml": "yaml", "scikit-learn": "sklearn"}
COMES_WITH = {"affine": "rasterio"}
# Debian 12's versions (packages.debian.org/bookworm).
DEBIAN_12 = {
    "click": "8.1.3",
    "fiona": "1.9.0",
    "jinja2": "3.1.2",
    "matplotlib": "3.6.3",
    "numpy": "1.24.2",
    "opencv-python-headless": "4.6.0",
    "rasterio": "1.3.5",
    "scikit-learn": "1.2.1",
    "scipy": "1.10.1",
    "shapely": "1.8.5",
}


def declared() -> dict[str, str]:
    """Return the lower bounds of the dependencies."""
    return dict(dependency.split(">=") for dependency in PROJECT["dependencies"])


def imported() -> set[str]:
    """Return the top-level modules of others that the package imports."""
    found = set()
    for path in (ROOT / "algorithms/groundtie").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                found |= {alias.name.split(".")[0] for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.level == 0:
                found.add(str(node.module).split(".")[0])
    return found - set(sys.stdlib_module_names)


def modules() -> set[str]:
    """Return the top-level modules of the dependencies."""
    return {MODULES.get(name, name) for name in declared()}


def extras() -> set[str]:
    """Return the modules of what only Python users may want."""
    groups = PROJECT["optional-dependencies"]
    names = [name for group in groups if group != "dev" for name in groups[group]]
    return {MODULES.get(name, name) for name in (name.split(">=")[0] for name in names)}


@pytest.mark.slow
def test_every_import_is_declared() -> None:
    undeclared = {COMES_WITH.get(name, name) for name in imported()} - modules() - extras()
    assert not undeclared, "pyproject.toml lacks a dependency with Debian 12's version as bound"


@pytest.mark.slow
def test_every_dependency_is_imported() -> None:
    assert not modules() - imported(), "pyproject.toml lists what nothing imports"


@pytest.mark.slow
def test_the_package_calls_itself_by_relative_imports() -> None:
    """Inside the plugin it has another name."""
    assert "groundtie" not in imported()


def test_the_lower_bounds_are_debian_12s() -> None:
    """The suite runs with Debian's packages: what is promised is tested."""
    for name, bound in declared().items():
        assert bound == ".".join(DEBIAN_12[name].split(".")[:2]), name


@pytest.fixture(scope="module")
def distributions(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """Return an sdist of the tree, and a wheel built from nothing but this sdist."""
    if int(metadata.version("setuptools").split(".")[0]) < 77:
        pytest.skip("building needs setuptools 77 (PEP 639 licences)")
    folder = tmp_path_factory.mktemp("dist")
    tree = folder / "tree"
    junk = shutil.ignore_patterns("*.egg-info", "__pycache__")
    shutil.copytree(ROOT / "algorithms", tree / "algorithms", ignore=junk)
    papers = ("README.md", "LICENSE", "CHANGELOG.md")
    for name in ("pyproject.toml", "MANIFEST.in", "metadata.txt", *papers):
        shutil.copy(ROOT / name, tree)
    build(tree, "build_sdist", folder)
    (sdist,) = folder.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        archive.extractall(folder / "unpacked")
    (unpacked,) = (folder / "unpacked").iterdir()
    build(unpacked, "build_wheel", folder)
    (wheel,) = folder.glob("*.whl")
    return sdist, wheel


@pytest.fixture(scope="module")
def environment(distributions: tuple[Path, Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the commands of a new virtual environment with the wheel in it.

    The dependencies are those of the Python that runs the tests: `make install` has pip resolve
    them.
    """
    folder = tmp_path_factory.mktemp("clean") / "venv"
    venv.create(folder, symlinks=True)
    commands = folder / "bin"
    pip = [sys.executable, "-m", "pip", "--python", str(commands / "python"), "install"]
    # A tree on PYTHONPATH would pass for an installed package.
    clean = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    wheel = str(distributions[1])
    subprocess.run([*pip, "-q", "--no-deps", "--no-index", wheel], check=True, env=clean)
    (packages,) = folder.glob("lib/python*/site-packages")
    # Its own .pth files are not read there: an editable install of this tree is out of sight.
    (packages / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    return commands


@pytest.mark.slow
def test_the_wheel_runs_in_a_clean_environment(environment: Path, tmp_path: Path) -> None:
    def groundtie(*words: str) -> str:
        done = subprocess.run(
            [environment / "groundtie", *words],
            cwd=tmp_path,
            env={"PATH": "/usr/bin:/bin", "HOME": str(tmp_path)},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    assert groundtie("--version") == f"groundtie {__version__}\n"
    write_pair(tmp_path, 0)
    files = ("--tie-points", "points.gpkg", "--report", "report.html")
    search = ("--model", "translation", "--search-radius", "12")
    groundtie("coregister", "reference.tif", "input.tif", "registered.tif", *search, *files)
    for name in ("registered.tif", "points.gpkg", "report.html"):
        assert (tmp_path / name).is_file()


BASH = """
eval "$(_GROUNDTIE_COMPLETE=bash_source groundtie)"
COMP_WORDS=(groundtie mask); COMP_CWORD=1
_groundtie_completion groundtie
echo "${COMPREPLY[@]}"
"""


@pytest.mark.slow
def test_bash_completes_the_installed_command(environment: Path) -> None:
    done = subprocess.run(
        ["bash", "-c", BASH],
        env={"PATH": f"{environment}:/usr/bin:/bin"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.split() == [
        "mask-surface",
        "mask-threshold",
        "mask-ground",
        "mask-regions",
    ], done.stderr


def build(tree: Path, hook: str, target: Path) -> None:
    code = f"from setuptools import build_meta; build_meta.{hook}({str(target)!r})"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tree, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.slow
def test_sdist_carries_the_version_file(distributions: tuple[Path, Path]) -> None:
    with tarfile.open(distributions[0]) as archive:
        names = {name.split("/", 1)[-1] for name in archive.getnames()}
    assert {"metadata.txt", "LICENSE", "README.md", "pyproject.toml"} <= names


@pytest.mark.slow
def test_wheel_is_complete(distributions: tuple[Path, Path]) -> None:
    with zipfile.ZipFile(distributions[1]) as archive:
        names = set(archive.namelist())
        info = f"groundtie-{__version__}.dist-info"
        about = Parser().parsestr(archive.read(f"{info}/METADATA").decode("utf-8"))
        entry_points = archive.read(f"{info}/entry_points.txt").decode("utf-8")
    assert about["Version"] == __version__
    assert about["License-Expression"] == "GPL-2.0-or-later"
    assert re.search(r"^groundtie = groundtie\.cli:main$", entry_points, re.MULTILINE)
    package = ROOT / "algorithms"
    for path in (package / "groundtie").rglob("*"):
        if path.suffix in {".py", ".j2", ".css", ".js"}:
            assert path.relative_to(package).as_posix() in names
