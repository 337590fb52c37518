"""The version of the package, written once: in ``metadata.txt``."""

from __future__ import annotations

import configparser
from pathlib import Path

__all__ = ["__version__", "find_version"]


def find_version(package: Path) -> str:
    """Find the version of the copy of GroundTie that lies in a folder.

    Parameters
    ----------
    package : Path
        Folder of the ``groundtie`` package.

    Returns
    -------
    str
        The version in the ``metadata.txt`` that belongs to this copy (one folder up in the QGIS
        plugin, two in the source tree), otherwise that of the installed distribution.

    Raises
    ------
    importlib.metadata.PackageNotFoundError
        If there is no ``metadata.txt`` and nothing is installed.
    """
    # The file takes precedence: another version may be installed beside a checkout or a plugin.
    for folder in (package.parent, package.parent.parent):
        version = _read(folder / "metadata.txt")
        if version is not None:
            return version
    from importlib import metadata  # a third of the command line's start, and rarely needed

    return metadata.version("groundtie")


def _read(path: Path) -> str | None:
    parser = configparser.ConfigParser(interpolation=None)
    try:
        parser.read(path, encoding="utf-8")
    except (configparser.Error, UnicodeDecodeError):
        return None  # another project's file of the same name
    if parser.get("general", "name", fallback=None) != "GroundTie":
        return None
    return parser["general"]["version"]


__version__ = find_version(Path(__file__).resolve().parent)
