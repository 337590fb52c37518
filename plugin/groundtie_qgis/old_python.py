"""Replacement for the plugin in a QGIS whose Python is too old: one clear sentence."""

from __future__ import annotations

import sys
from typing import Any

from qgis.core import Qgis, QgsMessageLog


def which_qgis(platform: str) -> str:
    """Return which QGIS has a newer Python on a platform, as `sys.platform` has it."""
    if platform == "darwin":  # github.com/qgis/QGIS/issues/59321
        return "QGIS from conda-forge or MacPorts; the installer of QGIS 3.40 has Python 3.9, too"
    if platform == "win32":  # github.com/qgis/QGIS-Mac-Packager/issues/179
        return "QGIS 3.34.10 or newer, best the current long-term release"
    return "a newer QGIS, best the current long-term release"


class OldPython:
    """States the Python version that QGIS has and the one that is needed; offers nothing else."""

    def __init__(self, iface: Any, oldest: tuple[int, int]) -> None:
        self._iface = iface
        found = ".".join(map(str, sys.version_info[:3]))
        self.complaint = (
            f"GroundTie needs Python {oldest[0]}.{oldest[1]} or newer, and this QGIS "
            f"({Qgis.QGIS_VERSION}) has Python {found}: install {which_qgis(sys.platform)}"
        )

    def initProcessing(self) -> None:
        """Write the sentence to the log."""
        QgsMessageLog.logMessage(self.complaint, "GroundTie", Qgis.MessageLevel.Warning)

    def initGui(self) -> None:
        """Show the sentence."""
        self.initProcessing()
        warning = Qgis.MessageLevel.Warning
        self._iface.messageBar().pushMessage("GroundTie", self.complaint, warning, 0)

    def unload(self) -> None:
        """Do nothing: there is nothing to remove."""
