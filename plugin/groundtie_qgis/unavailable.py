"""A tool's entry in the toolbox, and the replacement for a tool that lacks packages."""

from __future__ import annotations

from typing import Any

from qgis.core import (
    QgsProcessingAlgorithm,
    QgsProcessingContext,
    QgsProcessingException,
    QgsProcessingFeedback,
)
from qgis.PyQt.QtGui import QIcon

from .pages import help_url
from .styling import icon_of
from .translation import tr


def broken(error: ImportError) -> str:
    """Return one line that names the package that cannot be used."""
    return tr("GroundTie cannot use a Python package: {}").format(" ".join(str(error).split()))


class NamedAlgorithm(QgsProcessingAlgorithm):
    """The name, group and other toolbox texts of a tool's algorithm.

    Parameters
    ----------
    tool
        The tool, which need not be imported.
    """

    def __init__(self, tool: Any) -> None:
        super().__init__()
        self._tool = tool

    def name(self) -> str:
        return str(self._tool.name)

    def displayName(self) -> str:
        return tr(self._tool.title)

    def group(self) -> str:
        return tr(self._tool.group)

    def groupId(self) -> str:
        return str(self._tool.group).lower().replace(" ", "_")

    def icon(self) -> QIcon:
        return QIcon(str(icon_of(self.name())))


class UnavailableAlgorithm(NamedAlgorithm):
    """A tool that cannot run, and reports why.

    Parameters
    ----------
    tool
        The tool.
    reason
        What is missing, in one line.
    """

    def __init__(self, tool: Any, reason: str) -> None:
        super().__init__(tool)
        self._reason = reason

    def createInstance(self) -> UnavailableAlgorithm:
        return UnavailableAlgorithm(self._tool, self._reason)

    def shortHelpString(self) -> str:
        return self._reason

    def helpUrl(self) -> str:
        return help_url("qgis")

    def initAlgorithm(self, configuration: dict[str, Any] | None = None) -> None:
        """Declare nothing, as the parameters are in a module that cannot be imported."""

    def canExecute(self) -> tuple[bool, str]:
        return False, self._reason

    def checkParameterValues(
        self, parameters: dict[str, Any], context: QgsProcessingContext
    ) -> tuple[bool, str]:
        # qgis_process and models do not call canExecute
        return False, self._reason

    def processAlgorithm(
        self,
        parameters: dict[str, Any],
        context: QgsProcessingContext,
        feedback: QgsProcessingFeedback,
    ) -> dict[str, Any]:
        raise QgsProcessingException(self._reason)
