"""Names the Python packages that the tools need and QGIS's Python does not have."""

from __future__ import annotations

import importlib.util
import os
import re
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from .library import FOLDER

# Where a distribution's name is not the module's: module, and Debian's package.
_NAMES = {
    "opencv-python-headless": ("cv2", "python3-opencv"),
    "scikit-learn": ("sklearn", "python3-sklearn"),
}
_LOCK = threading.RLock()


# What only some of the tools need, or only some of their outputs: by the endings of files.
_NEEDED_BY_TOOL = {
    "train_feature_classifier": ("scikit-learn",),
    "coregister_series": ("shapely", "fiona"),
}
_NEEDED_BY_FILE = {
    ".html": ("jinja2", "matplotlib"),
    ".png": ("matplotlib",),
    ".gpkg": ("fiona",),
}
# rasterio needs click itself; the tools do not.
_NOT_BY_ALL = {"click", "scikit-learn", "jinja2", "matplotlib", "fiona", "shapely"}


def missing_packages() -> list[str]:
    """Return the distributions of requirements.txt that all tools need and that are not found."""
    path = FOLDER / "requirements.txt"  # made when the plugin is built
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    names = [match.group() for line in lines if (match := re.match(r"[\w.-]+", line))]
    return not_found(name for name in names if name not in _NOT_BY_ALL)


def missing_for(tool: str, paths: Iterable[Path]) -> list[str]:
    """Return the distributions that are not found of those that a call of a tool needs beside."""
    needed = [*_NEEDED_BY_TOOL.get(tool, ())]
    for path in paths:
        needed += _NEEDED_BY_FILE.get(path.suffix.lower(), ())
    return not_found(dict.fromkeys(needed))


def not_found(names: Iterable[str]) -> list[str]:
    """Return those of some distributions whose module is not found."""
    return [name for name in names if importlib.util.find_spec(_module(name)) is None]


def complaint(missing: list[str]) -> str:
    """Return one line that names what is missing and how to install it; empty if all is there."""
    if not missing:
        return ""
    noun = "package" if len(missing) == 1 else "packages"
    return (
        f"GroundTie needs the Python {noun} {', '.join(missing)}, which QGIS's Python does not "
        f"have: take Raster > GroundTie > Install what is missing, or run: "
        f"{install_command(missing)} (then restart QGIS)"
    )


def install_command(missing: list[str], debian: bool | None = None) -> str:
    """Return the command that installs `missing`: on Debian, or elsewhere; None: here."""
    if Path("/etc/debian_version").exists() if debian is None else debian:
        return "sudo apt install " + " ".join(
            _NAMES.get(name, ("", f"python3-{name}"))[1] for name in missing
        )
    return "python3 -m pip install --user " + " ".join(missing)


def _module(distribution: str) -> str:
    return _NAMES.get(distribution, (distribution, ""))[0]


@contextmanager
def rasterio_env() -> Iterator[None]:
    """Use rasterio in here, in the thread that calls it.

    A rasterio wheel brings its own PROJ and GDAL, which cannot read the data files of QGIS's,
    so the variables that lead there are out of its sight.
    """
    spec = importlib.util.find_spec("rasterio")
    origin = spec.origin if spec is not None else None
    wheel = origin is not None and (Path(origin).parent / "proj_data").is_dir()
    hidden = ("PROJ_LIB", "PROJ_DATA", "GDAL_DATA") if wheel else ()
    with _LOCK:
        saved = {name: os.environ.pop(name) for name in hidden if name in os.environ}
        try:
            import rasterio

            with rasterio.Env():
                yield
        finally:
            os.environ.update(saved)
