"""What stands in for the plugin in a QGIS whose Python is too old: one clear sentence."""

from __future__ import annotations

import sys
from typing import Any

from qgis.core import Qgis, QgsMessageLog


class OldPython:
    """States which Python QGIS has and which one is needed; offers nothing."""

    def __init__(self, iface: Any, oldest: tuple[int, int]) -> None:
        self._iface = iface
        found = ".".join(map(str, sys.version_info[:3]))
        self.complaint = (
            f"GroundTie needs Python {oldest[0]}.{oldest[1]} or newer, and this QGIS "
            f"({Qgis.QGIS_VERSION}) has Python {found}: install a newer QGIS, best the current "
            "long-term release"
        )

    def initProcessing(self) -> None:
        """Leave the sentence in the log."""
        QgsMessageLog.logMessage(self.complaint, "GroundTie", Qgis.Warning)

    def initGui(self) -> None:
        """Show the sentence."""
        self.initProcessing()
        self._iface.messageBar().pushMessage("GroundTie", self.complaint, Qgis.Warning, 0)

    def unload(self) -> None:
        """Leave nothing behind."""
