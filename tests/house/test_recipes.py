"""The Dockerfile and conda-forge's recipe install what pyproject.toml declares, in its version."""

from __future__ import annotations

import re
import shutil
import subprocess
import sysconfig
import venv
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest

from groundtie.version import __version__

tomllib = pytest.importorskip("tomllib", reason="reading pyproject.toml needs Python 3.11")
yaml = pytest.importorskip("yaml")

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
BUILD = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["build-system"]
# Where conda-forge calls a package otherwise, or has a part of it without what nobody needs here.
CONDA = {"opencv-python-headless": "py-opencv", "matplotlib": "matplotlib-base"}
DOCKERFILE = ROOT / "packaging/Dockerfile"
INSTRUCTIONS = {"FROM", "WORKDIR", "COPY", "RUN", "ENV", "USER", "ENTRYPOINT", "CMD"}


@pytest.fixture(scope="module")
def recipe() -> dict[str, Any]:
    """Return the recipe with its context's values filled in."""
    text = (ROOT / "packaging/recipe.yaml").read_text(encoding="utf-8")
    for name, value in yaml.safe_load(text)["context"].items():
        text = text.replace("${{ " + name + " }}", value)
    found: dict[str, Any] = yaml.safe_load(text)
    return found


def plain(requirements: list[str]) -> set[str]:
    """Return requirements as pip and conda both write them, without spaces."""
    return {requirement.replace(" ", "") for requirement in requirements}


def as_conda(requirements: list[str]) -> set[str]:
    named = (requirement.partition(">=") for requirement in requirements)
    return {f"{CONDA.get(name, name)}{mark}{bound}" for name, mark, bound in named}


def test_the_recipe_has_the_version_and_the_licence(recipe: dict[str, Any]) -> None:
    assert recipe["package"] == {"name": PROJECT["name"], "version": __version__}
    assert recipe["about"]["license"] == PROJECT["license"]
    assert (ROOT / recipe["about"]["license_file"]).is_file()
    assert recipe["about"]["summary"].startswith(PROJECT["description"][:28])


def test_the_recipe_installs_what_is_declared(recipe: dict[str, Any]) -> None:
    python = "python" + PROJECT["requires-python"]
    expected = {python, *as_conda(PROJECT["dependencies"])}
    assert plain(recipe["requirements"]["run"]) == expected
    assert plain(recipe["requirements"]["host"]) >= plain(BUILD["requires"])
    oldest = PROJECT["requires-python"].removeprefix(">=")
    assert f"python {oldest}.*" in recipe["requirements"]["host"]


def test_the_recipe_makes_the_command(recipe: dict[str, Any]) -> None:
    scripts = [f"{name} = {target}" for name, target in PROJECT["scripts"].items()]
    assert recipe["build"]["python"]["entry_points"] == scripts
    assert "${{ PYTHON }}" in recipe["build"]["script"]
    text = (ROOT / "packaging/recipe.yaml").read_text(encoding="utf-8")
    assert set(re.findall(r"\${{ (\w+) }}", text)) <= {*recipe["context"], "PYTHON"}


def instructions() -> list[tuple[str, str]]:
    """Return the Dockerfile's instructions with what follows, a line each."""
    text = re.sub(r"^#.*\n", "", DOCKERFILE.read_text(encoding="utf-8"), flags=re.MULTILINE)
    lines = text.replace("\\\n", " ").splitlines()
    return [(line.split()[0], line.partition(" ")[2]) for line in lines if line]


def test_the_dockerfile_is_read_line_by_line() -> None:
    assert {name for name, _ in instructions()} <= INSTRUCTIONS
    assert instructions()[0][0] == "FROM"
    assert ("ENTRYPOINT", '["groundtie"]') in instructions()
    assert ("USER", "65534") in instructions()


def test_the_image_has_a_python_that_will_do() -> None:
    oldest = tuple(map(int, PROJECT["requires-python"].removeprefix(">=").split(".")))
    for name, rest in instructions():
        if name == "FROM":
            version = re.match(r"python:(\d+)\.(\d+)-", rest)
            assert version is not None and tuple(map(int, version.groups())) >= oldest


def test_the_image_is_built_from_what_an_sdist_needs() -> None:
    """What is copied is there, is not kept away by .dockerignore, and is all that a build reads."""
    copied = [
        word
        for name, rest in instructions()
        if name == "COPY" and not rest.startswith("--from")
        for word in rest.split()[:-1]
    ]
    assert all((ROOT / path).exists() for path in copied)
    manifest = (ROOT / "MANIFEST.in").read_text(encoding="utf-8").split()[1:]
    needed = {"pyproject.toml", "algorithms", PROJECT["readme"], *PROJECT["license-files"]}
    assert set(copied) == needed | {*manifest, "MANIFEST.in"}
    ignore = (ROOT / ".dockerignore").read_text(encoding="utf-8").split()
    assert {line[1:] for line in ignore if line.startswith("!")} == set(copied)


@pytest.mark.slow
def test_what_the_dockerfile_runs_does_run(tmp_path: Path) -> None:
    """Its instructions one after the other, in folders in place of images.

    apt-get is a stand-in, and the dependencies are those of the Python that runs the tests.
    """
    if int(metadata.version("setuptools").split(".")[0]) < 77:
        pytest.skip("building needs setuptools 77 (PEP 639 licences)")
    images: dict[str, Path] = {}
    image, folder, variables = tmp_path, tmp_path, {"PATH": ""}
    for name, rest in instructions():
        if name == "FROM":
            image = images[rest.partition(" AS ")[2]] = tmp_path / f"image{len(images)}"
            folder, variables = image, {"PATH": f"{bare_python(image)}:/usr/bin:/bin"}
        elif name == "WORKDIR":
            folder = image / rest.lstrip("/")
            folder.mkdir(parents=True, exist_ok=True)
        elif name == "COPY":
            copy(rest, images, image, folder)
        elif name == "ENV":
            variables |= dict([rest.split("=")])
        elif name == "RUN":
            shell = ["bash", "-euo", "pipefail", "-c", within(rest, image)]
            offline = {"PIP_NO_DEPS": "1", "PIP_NO_INDEX": "1", "PIP_NO_BUILD_ISOLATION": "0"}
            subprocess.run(shell, cwd=folder, env=variables | offline, check=True)
    assert not (image / "wheels").exists()
    command = [image / "venv/bin/groundtie", "--version"]
    done = subprocess.run(command, cwd=folder, env=variables, capture_output=True, check=True)
    assert done.stdout.decode() == f"groundtie {__version__}\n"


def bare_python(image: Path) -> Path:
    """Make an image's Python with what its wheels would bring; return its commands."""
    image.mkdir()
    venv.create(image / "venv", symlinks=True)
    (packages,) = image.glob("venv/lib/python*/site-packages")
    for path in Path(sysconfig.get_path("purelib")).iterdir():
        # What is installed of this tree would pass for what the Dockerfile installs.
        if "groundtie" not in path.name and path.suffix != ".pth":
            (packages / path.name).symlink_to(path)
    commands = image / "venv/bin"
    (commands / "apt-get").write_text("#!/bin/sh\n", encoding="utf-8")
    (commands / "apt-get").chmod(0o755)
    return commands


def within(command: str, image: Path) -> str:
    """Return a command with its absolute paths in the folder of an image."""
    return re.sub(r"(?<=\s)/(?=\w)", f"{image}/", command)


def copy(rest: str, images: dict[str, Path], image: Path, folder: Path) -> None:
    """Do what COPY does: several files into a folder, or one folder's content into another."""
    words = rest.split()
    here = ROOT
    if words[0].startswith("--from="):
        here = images[words.pop(0).partition("=")[2]]
    *sources, target = words
    to = (image if target.startswith("/") else folder) / target.lstrip("/")
    for source in sources:
        path = here / source.lstrip("/")
        if path.is_dir():
            junk = shutil.ignore_patterns("__pycache__", "*.egg-info")
            shutil.copytree(path, to, ignore=junk, dirs_exist_ok=True)
        else:
            shutil.copy(path, to)
