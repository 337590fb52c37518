"""The Processing provider: one algorithm per declared tool."""

from __future__ import annotations

from typing import Any

from qgis.core import QgsMessageLog, QgsProcessingProvider
from qgis.PyQt.QtGui import QIcon

from .adapter import ToolAlgorithm
from .compat import WARNING
from .dependencies import complaint, rasterio_env
from .library import all_tools, kinds, plugin_metadata
from .styling import ICON
from .unavailable import UnavailableAlgorithm, unavailable_tools


def _tools_or_complaint() -> tuple[tuple[Any, ...], str]:
    """Return the tools, or none of them and one line that states what to install."""
    if missing := complaint():
        return (), missing
    try:
        with rasterio_env():
            return all_tools(), ""
    except ImportError as error:  # a package is there, but broken
        return (), f"GroundTie cannot use a Python package: {' '.join(str(error).split())}"


class GroundTieProvider(QgsProcessingProvider):
    """Offers GroundTie's tools; loads even where packages that they need are missing."""

    def __init__(self) -> None:
        super().__init__()
        self._tools, self._missing = _tools_or_complaint()

    def id(self) -> str:
        return "groundtie"

    def name(self) -> str:
        return "GroundTie"

    def versionInfo(self) -> str:
        return plugin_metadata().get("version", "")

    def icon(self) -> QIcon:
        return QIcon(str(ICON))

    def svgIconPath(self) -> str:
        return str(ICON)

    def warningMessage(self) -> str:
        return self._missing

    def loadAlgorithms(self) -> None:
        for tool in self._tools:
            self.addAlgorithm(ToolAlgorithm(tool))
        if self._missing:
            QgsMessageLog.logMessage(self._missing, "GroundTie", WARNING)
            for unavailable in unavailable_tools():
                self.addAlgorithm(UnavailableAlgorithm(unavailable, self._missing))

    def supportsNonFileBasedOutput(self) -> bool:
        return False

    def supportedOutputRasterLayerExtensions(self) -> list[str]:
        return self._extensions(kinds.RasterOut) or super().supportedOutputRasterLayerExtensions()

    def supportedOutputVectorLayerExtensions(self) -> list[str]:
        return self._extensions(kinds.VectorOut) or super().supportedOutputVectorLayerExtensions()

    def _extensions(self, kind: type) -> list[str]:
        """Return the endings, without dot, that outputs of a kind may have, the usual first."""
        found = [
            suffix[1:]
            for tool in self._tools
            for parameter in tool.parameters
            if isinstance(parameter.kind, kind)
            for suffix in parameter.kind.suffixes
        ]
        return list(dict.fromkeys(found))
