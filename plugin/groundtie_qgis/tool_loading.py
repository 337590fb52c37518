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
    _ignore_warnings()
    return tuple(library_module("tools").load_tools())


def _ignore_warnings() -> None:
    """Keep developer warnings of dependencies out of QGIS's log."""
    warnings.filterwarnings("ignore", module=rf"{re.escape(library_name())}\b")


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
        self._declared: Any = None

    def loaded(self) -> bool:
        """Whether the declaration has been imported."""
        return self._declared is not None

    def __getattr__(self, attribute: str) -> Any:
        if self._declared is None:
            _ignore_warnings()
            with rasterio_env():
                self._declared = library_module("tools").load_tool(self.name)
        return getattr(self._declared, attribute)


@cache
def named_tools() -> tuple[LazyTool, ...]:
    """Return all tools with the texts for a list, without importing them."""
    tools = library_module("tools")
    return tuple(LazyTool(**vars(tools.named_tool(name))) for name in tools.NAMES)
