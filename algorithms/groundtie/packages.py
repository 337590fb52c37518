"""The Python packages that GroundTie uses, their purpose, and whether they are installed.

Nothing is imported from them, so that missing ones can be named.
"""

from __future__ import annotations

import importlib.util
import os
import sys
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path, PurePath


@dataclass(frozen=True)
class Package:
    """A distribution on the Python Package Index.

    Parameters
    ----------
    name
        Its name there.
    oldest
        The oldest sufficient version.
    module
        The imported module, if it has another name.
    debian
        Debian's package, if it is not called `python3-NAME`.
    tools
        The tools that need it; empty, with no `files` either: all do.
    files
        Endings of the files that need it.
    use
        Its optional purpose, if GroundTie is complete without it.
    extra
        The extra of this package that then installs it.
    """

    name: str
    oldest: str
    module: str = ""
    debian: str = ""
    tools: tuple[str, ...] = ()
    files: tuple[str, ...] = ()
    use: str = ""
    extra: str = ""

    @property
    def imported(self) -> str:
        """The name of the module."""
        return self.module or self.name

    @property
    def requirement(self) -> str:
        """The requirement for pip."""
        return f"{self.name}>={self.oldest}"

    @property
    def needed_by_all(self) -> bool:
        """Whether no tool runs without it."""
        return not (self.tools or self.files or self.use)

    def found(self) -> bool:
        """Whether its module is installed; it may be broken."""
        return importlib.util.find_spec(self.imported) is not None


# A test compares them with pyproject.toml and with what is imported.
PACKAGES = (
    Package("numpy", "1.24"),
    Package("scipy", "1.10"),
    Package("rasterio", "1.3"),
    Package("opencv-python-headless", "4.6", module="cv2", debian="python3-opencv"),
    Package("click", "8.1", use="the command line"),
    Package("fiona", "1.9", tools=("coregister_series",), files=(".gpkg",)),
    Package("jinja2", "3.1", files=(".html",)),
    Package("matplotlib", "3.6", files=(".html", ".png")),
    Package(
        "scikit-learn",
        "1.2",
        module="sklearn",
        debian="python3-sklearn",
        tools=("train_feature_classifier",),
    ),
    Package("shapely", "1.8", tools=("coregister_series",)),
    Package("xarray", "2022.11", use="rasters as xarray's", extra="xarray"),
    Package("rioxarray", "0.13", use="rasters as xarray's", extra="xarray"),
    Package("geopandas", "0.12", use="tie points as a GeoDataFrame", extra="geopandas"),
    Package("dask", "2022.12", use="batch on a Dask cluster", extra="cluster"),
    Package("distributed", "2022.12", use="batch on a Dask cluster", extra="cluster"),
    Package("pyyaml", "6.0", module="yaml", use="tables of batch in YAML", extra="yaml"),
)


# Variables for the number of threads of linear algebra libraries, and of OpenCV.
_THREADS_OF = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "OPENCV_FOR_THREADS_NUM",
)


def needed_for(tool: str, paths: Iterable[PurePath]) -> list[Package]:
    """Return the further packages that a call of a tool needs: for the tool, and for its files."""
    endings = {path.suffix.lower() for path in paths}
    return [p for p in PACKAGES if tool in p.tools or endings.intersection(p.files)]


def use_one_thread() -> None:
    """Let libraries work in the calling thread, unless the environment states another number.

    For processes that do this package's work alone, before they import numpy and OpenCV, which
    read the variables once. These processes work in parallel by threads of their own; threads of
    libraries would wait in a busy loop. (OpenCV builds that share threads, as Debian's, ignore it.)
    """
    for name in _THREADS_OF:
        os.environ.setdefault(name, "1")


def interpreter() -> Path | None:
    """Return the Python interpreter; within QGIS, `sys.executable` may be QGIS itself or empty."""
    own = Path(sys.executable or sys.exec_prefix)
    named = [own] if own.stem.lower().startswith("python") else []
    beside = [
        Path(prefix) / folder / name
        for prefix in (sys.exec_prefix, sys.base_exec_prefix, own.parent)
        for folder in ("", "bin")
        for name in ("python3", "python", "python3.exe", "python.exe")
    ]
    return next((path for path in [*named, *beside] if path.is_file()), None)


def processors() -> int:
    """Return the number of processors that this process may use; the machine may have more."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
