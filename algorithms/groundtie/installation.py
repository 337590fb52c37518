"""The installation that GroundTie runs in: packages, GDAL, PROJ, geoids; and what cannot run.

Everything is tried, not only looked for: an installed package may be broken.
"""

from __future__ import annotations

import importlib
import platform
import re
import sys
from dataclasses import asdict, dataclass
from importlib import metadata
from pathlib import Path
from typing import Any

from .errors import one_line
from .packages import PACKAGES, Package
from .version import __version__

OK, MISSING, OPTIONAL = "ok", "missing", "not here"
# Formats that missions deliver, and formats that are written.
_FORMATS = ("GTiff", "COG", "JP2OpenJPEG", "NITF", "HDF5", "netCDF")
# EPSG's own definition: the central meridian of UTM's zone 33 meets the equator there.
_LON_LAT, _UTM_33 = (15.0, 0.0), (500_000.0, 0.0)
_WITH_HEIGHTS = ("orthorectify", "extract_gcps", "refine_rpc")


@dataclass(frozen=True)
class Finding:
    """The result of checking one component.

    Parameters
    ----------
    name
        Name of the component.
    state
        `OK`, `MISSING` (or broken, or too old), or `OPTIONAL`: not installed, and GroundTie is
        complete without it.
    text
        Version and place, or the reason.
    without
        What does not work without it.
    """

    name: str
    state: str
    text: str
    without: tuple[str, ...] = ()

    def line(self) -> str:
        """Return the finding as a line of text."""
        without = f"; without it: {', '.join(self.without)}" if self.without else ""
        return f"{self.state:<8}  {self.name}: {self.text}{without}"


@dataclass(frozen=True)
class Installation:
    """All findings."""

    findings: tuple[Finding, ...]
    requirements: tuple[str, ...]

    @property
    def missing(self) -> tuple[str, ...]:
        """Names of the missing components."""
        return tuple(finding.name for finding in self.findings if finding.state == MISSING)

    @property
    def exit_code(self) -> int:
        """2 if something is missing."""
        return 2 if self.missing else 0

    def summary(self) -> dict[str, Any]:
        """Return the result as JSON values."""
        return {
            "missing": list(self.missing),
            "missing_count": len(self.missing),
            "version": __version__,
            "python": platform.python_version(),
            "findings": [asdict(finding) for finding in self.findings],
            "install": list(self.requirements),
        }

    def lines(self) -> list[str]:
        """Return the result as lines of text."""
        here = f"GroundTie {__version__} in {Path(__file__).parent}"
        system = f"Python {platform.python_version()} in {sys.prefix}, {platform.platform()}"
        lines = [here, system, *(finding.line() for finding in self.findings)]
        if self.requirements:
            return [*lines, f"to install what is missing: pip install {self._quoted()}"]
        return lines if self.missing else [*lines, "nothing is missing"]

    def _quoted(self) -> str:
        return " ".join(f'"{requirement}"' for requirement in self.requirements)


def examine() -> Installation:
    """Check all components."""
    packages = [(package, _package(package)) for package in PACKAGES]
    wanted = tuple(p.requirement for p, found in packages if found.state == MISSING)
    return Installation((*(found for _, found in packages), *_gdal()), wanted)


def _package(package: Package) -> Finding:
    """Import a package, and compare its version with the required one."""
    without = _without(package)
    absent = OPTIONAL if package.use else MISSING
    if not package.found():
        return Finding(package.name, absent, "not installed", without)
    try:
        module = importlib.import_module(package.imported)
    except Exception as error:  # any error is a finding
        return Finding(package.name, absent, f"broken: {_in_a_line(error)}", without)
    version = _version(package, module)
    if _numbers(version) < _numbers(package.oldest):
        text = f"{version} is too old, {package.oldest} is needed"
        return Finding(package.name, absent, text, without)
    return Finding(package.name, OK, version)


def _without(package: Package) -> tuple[str, ...]:
    if package.needed_by_all:
        return ("every tool",)
    files = (f"files that end in {' or '.join(package.files)}",) if package.files else ()
    return (*package.tools, *files, *([package.use] if package.use else []))


def _version(package: Package, module: Any) -> str:
    try:
        return metadata.version(package.name)
    except metadata.PackageNotFoundError:  # a system's package, under another name
        return str(module.__version__)


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(map(int, re.findall(r"\d+", version)[:2]))


def _in_a_line(error: Exception) -> str:
    return one_line(f"{type(error).__name__}: {error}")


def _gdal() -> list[Finding]:
    """Try GDAL, PROJ and the geoids' grids; nothing if rasterio cannot be imported."""
    try:
        import rasterio
    except Exception:  # stated as the package's finding
        return []
    with rasterio.Env() as env:
        drivers = env.drivers()
    lacking = [name for name in _FORMATS if name not in drivers]
    text = rasterio.__gdal_version__ + (f", without {', '.join(lacking)}" if lacking else "")
    written = {"GTiff", "COG"}.isdisjoint(lacking)
    gdal = Finding("GDAL", OK if written else MISSING, text, () if written else ("every tool",))
    return [gdal, _proj(), *map(_geoid, ("EGM96", "EGM2008"))]


def _proj() -> Finding:
    """Convert a position between EPSG codes, for which PROJ reads its data."""
    from rasterio.warp import transform

    try:
        x, y = (values[0] for values in transform("EPSG:4326", "EPSG:32633", *zip(_LON_LAT)))
    except Exception as error:  # see `_package`
        return Finding("PROJ's data", MISSING, f"broken: {_in_a_line(error)}", ("every tool",))
    if abs(x - _UTM_33[0]) + abs(y - _UTM_33[1]) > 1e-3:
        text = f"wrong: {_LON_LAT} in EPSG:32633 is {x:.3f}, {y:.3f} by them"
        return Finding("PROJ's data", MISSING, text, ("every tool",))
    return Finding("PROJ's data", OK, "EPSG's codes are known")


def _geoid(datum: str) -> Finding:
    from .errors import GeoreferencingError
    from .sensor.geoids import find_geoid

    try:
        return Finding(f"Geoid {datum}", OK, str(find_geoid(datum)))
    except GeoreferencingError as error:
        tools = f"{', '.join(_WITH_HEIGHTS)} with terrain models above {datum}"
        return Finding(f"Geoid {datum}", OPTIONAL, error.one_line(), (tools,))
