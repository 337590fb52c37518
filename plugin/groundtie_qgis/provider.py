"""The Processing provider: one algorithm per declared tool."""

from __future__ import annotations

from qgis.core import QgsMessageLog, QgsProcessingProvider
from qgis.PyQt.QtGui import QIcon

from .adapter import ICON, ToolAlgorithm
from .compat import WARNING
from .dependencies import complaint
from .library import all_tools, kinds, plugin_metadata


class GroundTieProvider(QgsProcessingProvider):
    """Offers GroundTie's tools; loads even where packages that they need are missing."""

    def id(self) -> str:
        return "groundtie"

    def name(self) -> str:
        return "GroundTie"

    def longName(self) -> str:
        return " ".join(["GroundTie", plugin_metadata().get("version", "")]).strip()

    def icon(self) -> QIcon:
        return QIcon(str(ICON))

    def svgIconPath(self) -> str:
        return str(ICON)

    def warningMessage(self) -> str:
        return complaint()

    def loadAlgorithms(self) -> None:
        if missing := complaint():
            QgsMessageLog.logMessage(missing, "GroundTie", WARNING)
        for tool in all_tools():
            self.addAlgorithm(ToolAlgorithm(tool))

    def supportsNonFileBasedOutput(self) -> bool:
        return False

    def supportedOutputRasterLayerExtensions(self) -> list[str]:
        return _extensions(kinds.RasterOut)

    def supportedOutputVectorLayerExtensions(self) -> list[str]:
        return _extensions(kinds.VectorOut)


def _extensions(kind: type) -> list[str]:
    """Return the endings, without dot, that outputs of a kind may have; the usual ones first."""
    found = [
        suffix[1:]
        for tool in all_tools()
        for parameter in tool.parameters
        if isinstance(parameter.kind, kind)
        for suffix in parameter.kind.suffixes
    ]
    return list(dict.fromkeys(found))
