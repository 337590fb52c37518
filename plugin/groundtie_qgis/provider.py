"""The Processing provider: one algorithm per declared tool, and the models that chain them."""

from __future__ import annotations

from typing import Any

import qgis.utils
from qgis.core import QgsMessageLog, QgsProcessingProvider
from qgis.PyQt.QtGui import QIcon

from .adapter import ToolAlgorithm
from .compat import WARNING
from .dependencies import complaint, missing_packages, rasterio_env
from .library import plugin_metadata
from .shipped_models import load_models
from .styling import ICON
from .tool_loading import all_tools, named_tools
from .unavailable import UnavailableAlgorithm, broken

# Suffixes, without dot, of the tools' outputs, the usual one first. Asking the tools would import
# them all.
RASTERS = ("tif", "tiff", "vrt")
VECTORS = ("gpkg", "geojson", "csv", "points", "txt")
# The tool that runs even if packages are missing, and states which.
DOCTOR = "doctor"


def _tools_or_complaint() -> tuple[tuple[Any, ...], str]:
    """Return the tools, or no tools and one line that states what to install.

    In the desktop, a tool is imported only when it is opened, to keep the start fast.
    """
    if missing := complaint(missing_packages()):
        return (), missing
    if qgis.utils.iface is not None:
        return named_tools(), ""
    try:
        with rasterio_env():
            return all_tools(), ""
    except ImportError as error:  # a package is there, but broken
        return (), broken(error)


class GroundTieProvider(QgsProcessingProvider):
    """Offers GroundTie's tools; loads even if packages that they need are missing."""

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
        if not self._missing:
            for model in load_models():
                self.addAlgorithm(model)
        if self._missing:
            QgsMessageLog.logMessage(self._missing, "GroundTie", WARNING)
            for named in named_tools():
                if named.name == DOCTOR:
                    self.addAlgorithm(ToolAlgorithm(named))
                else:
                    self.addAlgorithm(UnavailableAlgorithm(named, self._missing))

    def supportsNonFileBasedOutput(self) -> bool:
        return False

    def supportedOutputRasterLayerExtensions(self) -> list[str]:
        return list(RASTERS)

    def supportedOutputVectorLayerExtensions(self) -> list[str]:
        return list(VECTORS)
