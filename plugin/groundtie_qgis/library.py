"""Finds the GroundTie library: an installed copy of the plugin's version, else the bundled one."""

from __future__ import annotations

import configparser
import importlib
import importlib.util
from importlib import metadata
from pathlib import Path
from types import ModuleType

FOLDER = Path(__file__).resolve().parent
BUNDLED = f"{__package__}.groundtie"


def plugin_metadata() -> dict[str, str]:
    """Return the plugin's metadata; empty in a source tree, where the file lies elsewhere."""
    parser = configparser.ConfigParser(interpolation=None)
    parser.read(FOLDER / "metadata.txt", encoding="utf-8")
    return dict(parser["general"]) if parser.has_section("general") else {}


def library_name() -> str:
    """Return the name to import the library by."""
    if importlib.util.find_spec(BUNDLED) is None:
        return "groundtie"
    try:
        installed = metadata.version("groundtie")
    except metadata.PackageNotFoundError:
        return BUNDLED
    same = installed == plugin_metadata()["version"]
    return "groundtie" if same and importlib.util.find_spec("groundtie") else BUNDLED


def library_module(name: str) -> ModuleType:
    """Import the module `name` of the library."""
    return importlib.import_module(f"{library_name()}.{name}")


# Light modules, which need only Python's standard library.
errors = library_module("errors")
kinds = library_module("kinds")
progress = library_module("progress")
