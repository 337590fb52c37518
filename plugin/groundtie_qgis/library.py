"""Finds the GroundTie library: an installed one of the plugin's version, else the bundled copy."""

from __future__ import annotations

import configparser
import importlib
import importlib.util
import re
import warnings
from importlib import metadata
from pathlib import Path
from types import ModuleType
from typing import Any

FOLDER = Path(__file__).resolve().parent
BUNDLED = f"{__package__}.groundtie"


def plugin_metadata() -> dict[str, str]:
    """Return the plugin's metadata; empty in a source tree, where it lies elsewhere."""
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


def all_tools() -> tuple[Any, ...]:
    """Return the declarations of all tools."""
    # warnings of dependencies to the library's developers are nothing for QGIS's log
    warnings.filterwarnings("ignore", module=rf"{re.escape(library_name())}\b")
    return tuple(library_module("tools").load_tools())


class LazyTool:
    """A tool's declaration, imported with all that it needs when more than its name is asked for.

    Raises
    ------
    ImportError
        Then: a package cannot be used.
    """

    def __init__(self, name: str, title: str, group: str, summary: str) -> None:
        self.name = name
        self.title = title
        self.group = group
        self.summary = summary

    def loaded(self) -> bool:
        """Whether it is imported."""
        return self.name in _TOOLS

    def __getattr__(self, attribute: str) -> Any:
        return getattr(_tool(self.name), attribute)


_TOOLS: dict[str, Any] = {}


def _tool(name: str) -> Any:
    if name in _TOOLS:
        return _TOOLS[name]
    from .dependencies import rasterio_env

    warnings.filterwarnings("ignore", module=rf"{re.escape(library_name())}\b")
    with rasterio_env():
        return _TOOLS.setdefault(name, library_module("tools").load_tool(name))


# The light modules, which need no package beyond Python's own.
errors = library_module("errors")
kinds = library_module("kinds")
progress = library_module("progress")
