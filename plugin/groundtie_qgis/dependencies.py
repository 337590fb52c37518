"""Finds the Python packages that the tools need and QGIS's Python lacks."""

from __future__ import annotations

import importlib.util
import os
import threading
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

from .library import library_module
from .translation import tr

packages = library_module("packages")
_LOCK = threading.RLock()


def missing_packages() -> list[str]:
    """Return the missing distributions that all tools need."""
    return [p.name for p in packages.PACKAGES if p.needed_by_all and not p.found()]


def missing_for(tool: str, paths: Iterable[Path]) -> list[str]:
    """Return the missing distributions that a specific call of a tool needs in addition."""
    return [p.name for p in packages.needed_for(tool, paths) if not p.found()]


def complaint(missing: list[str]) -> str:
    """Return one line on what is missing and how to install it; empty if nothing is missing."""
    if not missing:
        return ""
    one = tr(
        "GroundTie needs the Python package {names}, which QGIS's Python does not have: take "
        "Raster > GroundTie > Install what is missing, or run: {command} (then restart QGIS)"
    )
    several = tr(
        "GroundTie needs the Python packages {names}, which QGIS's Python does not have: take "
        "Raster > GroundTie > Install what is missing, or run: {command} (then restart QGIS)"
    )
    text = one if len(missing) == 1 else several
    return text.format(names=", ".join(missing), command=install_command(missing))


def install_command(missing: list[str], debian: bool | None = None) -> str:
    """Return the command that installs `missing`, on Debian or elsewhere; None: this system."""
    if Path("/etc/debian_version").exists() if debian is None else debian:
        names = {package.name: package.debian for package in packages.PACKAGES}
        return "sudo apt install " + " ".join(names[name] or f"python3-{name}" for name in missing)
    return "python3 -m pip install --user " + " ".join(missing)


@contextmanager
def rasterio_env() -> Iterator[None]:
    """Provide an environment for rasterio in the calling thread.

    A rasterio wheel brings its own PROJ and GDAL, which cannot read the data files of QGIS's
    versions, so the environment variables that point there are hidden.
    """
    spec = importlib.util.find_spec("rasterio")
    if spec is None:  # then nothing inside this context needs it
        yield
        return
    origin = spec.origin
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
