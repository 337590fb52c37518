"""Installs missing Python packages into the plugin's own folder; QGIS's packages have priority."""

from __future__ import annotations

import importlib
import re
import shlex
import sys
from pathlib import Path

from .dependencies import packages

# affine 3 needs a newer attrs than QGIS may have, and QGIS's own attrs is found first.
_BOUNDS = ("affine<3",)


def packages_folder(settings: Path) -> Path:
    """Return the folder for packages of this Python version, in QGIS's settings folder."""
    return settings / "groundtie" / "python{}.{}".format(*sys.version_info[:2])


def use_packages(folder: Path) -> None:
    """Add `folder` to the module search path, after the packages of QGIS."""
    if folder.is_dir() and str(folder) not in sys.path:
        sys.path.append(str(folder))
    importlib.invalidate_caches()


def missing_requirements() -> list[str]:
    """Return the unmet requirements of tools and of some outputs."""
    wanted = [package for package in packages.PACKAGES if not package.extra]
    return [package.requirement for package in wanted if not package.found()]


def pip_command(requirements: list[str], folder: Path) -> list[str]:
    """Return the command that installs `requirements` into `folder`.

    It accepts only wheels, and none that needs another numpy than QGIS's: QGIS's modules are
    compiled for their own numpy, which is found first.
    """
    return [
        str(packages.interpreter() or "python3"),
        *("-m", "pip", "install", "--only-binary=:all:", "--upgrade", "--target", str(folder)),
        *requirements,
        *numpy_bound(),
        *_BOUNDS,
    ]


def numpy_bound() -> list[str]:
    """Return a requirement that pins QGIS's numpy; empty if QGIS has none."""
    try:
        import numpy
    except ImportError:
        return []
    return [f"numpy=={numpy.__version__}"]


def as_typed(command: list[str]) -> str:
    """Return a command as typed into a shell of this system."""
    if sys.platform == "win32":
        return " ".join(f'"{word}"' if re.search(r"[\s<>=]", word) else word for word in command)
    return shlex.join(command)
