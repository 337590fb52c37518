"""Stands in for the tools where packages are missing that they need: it states what to install."""

from __future__ import annotations

import ast
import importlib.util
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from qgis.core import (
    QgsProcessingAlgorithm,
    QgsProcessingContext,
    QgsProcessingException,
    QgsProcessingFeedback,
)
from qgis.PyQt.QtGui import QIcon

from .library import library_name
from .pages import help_url
from .styling import icon_of
from .translation import tr


@dataclass(frozen=True)
class NamedTool:
    """What can be given of a tool without importing it."""

    name: str
    title: str
    group: str
    summary: str


@cache
def named_tools() -> list[NamedTool]:
    """Read names, titles and groups of the tools from their source."""
    spec = importlib.util.find_spec(f"{library_name()}.tools")
    folders = spec.submodule_search_locations if spec is not None else None
    sources = sorted(path for folder in folders or () for path in Path(folder).glob("*.py"))
    return [tool for path in sources for tool in _declared(path.read_text(encoding="utf-8"))]


def broken(error: ImportError) -> str:
    """Return one line that states which package cannot be used."""
    return tr("GroundTie cannot use a Python package: {}").format(" ".join(str(error).split()))


def _declared(source: str) -> list[NamedTool]:
    functions = [node for node in ast.parse(source).body if isinstance(node, ast.FunctionDef)]
    return [
        NamedTool(
            function.name,
            **_texts(decorator),
            summary=(ast.get_docstring(function) or "").partition("\n")[0],
        )
        for function in functions
        for decorator in function.decorator_list
        if isinstance(decorator, ast.Call) and ast.unparse(decorator.func) == "tool"
    ]


def _texts(decorator: ast.Call) -> dict[str, str]:
    return {
        keyword.arg: ast.literal_eval(keyword.value)
        for keyword in decorator.keywords
        if keyword.arg in ("title", "group")
    }


class UnavailableAlgorithm(QgsProcessingAlgorithm):
    """A tool that cannot run, and reports why.

    Parameters
    ----------
    tool
        Which tool.
    reason
        What is missing, in one line.
    """

    def __init__(self, tool: NamedTool, reason: str) -> None:
        super().__init__()
        self._tool = tool
        self._reason = reason

    def createInstance(self) -> UnavailableAlgorithm:
        return UnavailableAlgorithm(self._tool, self._reason)

    def name(self) -> str:
        return self._tool.name

    def displayName(self) -> str:
        return tr(self._tool.title)

    def group(self) -> str:
        return tr(self._tool.group)

    def groupId(self) -> str:
        return self._tool.group.lower().replace(" ", "_")

    def shortHelpString(self) -> str:
        return self._reason

    def helpUrl(self) -> str:
        return help_url("qgis")

    def icon(self) -> QIcon:
        return QIcon(str(icon_of(self.name())))

    def initAlgorithm(self, configuration: dict[str, Any] | None = None) -> None:
        """Declare nothing: the parameters are in what cannot be imported."""

    def canExecute(self) -> tuple[bool, str]:
        return False, self._reason

    def checkParameterValues(
        self, parameters: dict[str, Any], context: QgsProcessingContext
    ) -> tuple[bool, str]:
        # qgis_process and models do not ask canExecute
        return False, self._reason

    def processAlgorithm(
        self,
        parameters: dict[str, Any],
        context: QgsProcessingContext,
        feedback: QgsProcessingFeedback,
    ) -> dict[str, Any]:
        raise QgsProcessingException(self._reason)
