"""The plugin as QGIS sees it: it adds and removes the Processing provider."""

from __future__ import annotations

from qgis.core import QgsApplication

from .provider import GroundTieProvider


class GroundTiePlugin:
    """Adds GroundTie's provider to Processing; works with and without a desktop."""

    def __init__(self) -> None:
        self.provider: GroundTieProvider | None = None

    def initProcessing(self) -> None:
        """Register the provider (qgis_process calls this and nothing else)."""
        self.provider = GroundTieProvider()
        QgsApplication.processingRegistry().addProvider(self.provider)

    def initGui(self) -> None:
        """Start in the desktop."""
        self.initProcessing()

    def unload(self) -> None:
        """Take the provider away again."""
        if self.provider is not None:
            QgsApplication.processingRegistry().removeProvider(self.provider)
            self.provider = None
