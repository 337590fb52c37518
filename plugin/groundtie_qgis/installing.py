"""Puts missing Python packages into a folder of the plugin's own, where QGIS's own ones win."""

from __future__ import annotations

import importlib
import re
import shlex
import sys
from pathlib import Path

from .dependencies import packages

# affine 3 needs newer attrs than a QGIS may have, and QGIS's own is found first.
_BOUNDS = ("affine<3",)


def packages_folder(settings: Path) -> Path:
    """Return the folder for packages of this Python below QGIS's folder of settings."""
    return settings / "groundtie" / "python{}.{}".format(*sys.version_info[:2])


def use_packages(folder: Path) -> None:
    """Have packages in `folder` found, after those that QGIS brings."""
    if folder.is_dir() and str(folder) not in sys.path:
        sys.path.append(str(folder))
    importlib.invalidate_caches()


def missing_requirements() -> list[str]:
    """Return the requirements, of tools and of some outputs, that are not met."""
    wanted = [package for package in packages.PACKAGES if not package.extra]
    return [package.requirement for package in wanted if not package.found()]


def pip_command(requirements: list[str], folder: Path) -> list[str]:
    """Return the command that installs `requirements` into `folder`.

    It takes wheels alone, and none that needs another numpy than QGIS's: QGIS's modules are
    compiled for theirs, which is found first.
    """
    return [
        interpreter(),
        *("-m", "pip", "install", "--only-binary=:all:", "--upgrade", "--target", str(folder)),
        *requirements,
        *numpy_bound(),
        *_BOUNDS,
    ]


def numpy_bound() -> list[str]:
    """Return the requirement of the numpy that QGIS has; none if it has none."""
    try:
        import numpy
    except ImportError:
        return []
    return [f"numpy=={numpy.__version__}"]


def interpreter() -> str:
    """Return QGIS's Python: in a QGIS that embeds it, `sys.executable` may be QGIS itself."""
    names = ("python3", "python", "python3.exe", "python.exe")
    folders = (Path(sys.exec_prefix), Path(sys.exec_prefix) / "bin", Path(sys.executable).parent)
    running = Path(sys.executable or "qgis")
    if running.stem.startswith("python") and running.is_file():
        return str(running)
    beside = [folder / name for folder in (*folders, running.parent / "bin") for name in names]
    return next((str(path) for path in beside if path.is_file()), "python3")


def as_typed(command: list[str]) -> str:
    """Return a command as one types it into a shell of this system."""
    if sys.platform == "win32":
        return " ".join(f'"{word}"' if re.search(r"[\s<>=]", word) else word for word in command)
    return shlex.join(command)
