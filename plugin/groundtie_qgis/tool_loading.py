"""Loads the declarations of tools, each one when QGIS first needs more than its name."""

from __future__ import annotations

import re
import warnings
from functools import cache
from typing import Any

from .dependencies import rasterio_env
from .library import library_module, library_name


def all_tools() -> tuple[Any, ...]:
    """Return the declarations of all tools."""
    # developer warnings of dependencies do not belong in QGIS's log
    warnings.filterwarnings("ignore", module=rf"{re.escape(library_name())}\b")
    return tuple(library_module("tools").load_tools())


class LazyTool:
    """A tool's declaration, imported with its dependencies at the first access beyond its name.

    Raises
    ------
    ImportError
        On that access, if a package cannot be used.
    """

    def __init__(self, name: str, title: str, group: str, summary: str) -> None:
        self.name = name
        self.title = title
        self.group = group
        self.summary = summary

    def loaded(self) -> bool:
        """Whether the declaration has been imported."""
        return self.name in _TOOLS

    def __getattr__(self, attribute: str) -> Any:
        return getattr(_tool(self.name), attribute)


@cache
def named_tools() -> tuple[LazyTool, ...]:
    """Return all tools with the texts for a list, without importing them."""
    tools = library_module("tools")
    return tuple(LazyTool(**vars(tools.named_tool(name))) for name in tools.NAMES)


_TOOLS: dict[str, Any] = {}


def _tool(name: str) -> Any:
    if name in _TOOLS:
        return _TOOLS[name]
    warnings.filterwarnings("ignore", module=rf"{re.escape(library_name())}\b")
    with rasterio_env():
        return _TOOLS.setdefault(name, library_module("tools").load_tool(name))
