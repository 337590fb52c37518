"""The plugin as QGIS sees it: the Processing provider, and the menu *Raster > GroundTie*."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from qgis.core import QgsApplication
from qgis.PyQt.QtCore import Qt, QUrl
from qgis.PyQt.QtGui import QDesktopServices, QIcon
from qgis.PyQt.QtWidgets import QAction

from .compat import WARNING
from .install_dialog import InstallDialog
from .pages import help_url
from .provider import GroundTieProvider
from .styling import ICON
from .translation import tr

MENU = "GroundTie"


class GroundTiePlugin:
    """Adds GroundTie's provider to Processing, and its menu to a desktop.

    Parameters
    ----------
    iface
        The desktop; None without one.
    packages
        Folder of the packages that the plugin may install.
    """

    def __init__(self, iface: Any, packages: Path) -> None:
        self.provider: GroundTieProvider | None = None
        self._iface = iface
        self._packages = packages
        self.actions: list[QAction] = []
        self.dock: Any = None
        self._example: Any = None

    def initProcessing(self) -> None:
        """Register the provider (qgis_process calls this and nothing else)."""
        self.provider = GroundTieProvider()
        QgsApplication.processingRegistry().addProvider(self.provider)

    def initGui(self) -> None:
        """Start in the desktop."""
        self.initProcessing()
        self._add_action(tr("Register and review…"), self.toggle_dock)
        self._iface.addToolBarIcon(self.actions[0])
        self._add_action(tr("Load an example"), self.load_example)
        self._add_action(tr("Install what is missing…"), self.install)
        self._add_action(tr("Help"), self.show_help)
        if self.provider is not None and self.provider.warningMessage():
            message = tr(
                "Python packages are missing: Raster > GroundTie > Install what is missing"
            )
            self._iface.messageBar().pushMessage("GroundTie", message, WARNING, 0)

    def unload(self) -> None:
        """Remove the provider and the menu."""
        for action in self.actions:
            self._iface.removePluginRasterMenu(MENU, action)
        if self.actions:
            self._iface.removeToolBarIcon(self.actions[0])
        if self.dock is not None:
            self.dock.take_away()
            self._iface.removeDockWidget(self.dock)
            self.dock = None
        self.actions = []
        self._remove_provider()

    def toggle_dock(self) -> None:
        """Open or close the dock."""
        if self.dock is not None and self.dock.isVisible():
            self.dock.close()
        else:
            self.open_dock()

    def open_dock(self) -> None:
        """Show the dock; if packages are missing, offer to install them instead."""
        if self._lacks_packages():
            return
        if self.dock is None:
            from .dock import GroundTieDock

            self.dock = GroundTieDock(self._iface)
            self._iface.addDockWidget(Qt.DockWidgetArea.RightDockWidgetArea, self.dock)
        self.dock.show()

    def load_example(self) -> None:
        """Simulate a pair of images, load it, and open the dock."""
        if self._lacks_packages():
            return
        if self._example is None:
            from .example import Example

            self._example = Example(self._iface, self.open_dock)
        self._example.make()

    def _lacks_packages(self) -> bool:
        """Return whether packages are missing, and offer to install them if so."""
        if self.provider is None or not self.provider.warningMessage():
            return False
        self.install()
        return True

    def install(self) -> None:
        """Offer to install missing packages."""
        dialog = InstallDialog(self._packages, self._start_again, self._iface.mainWindow())
        dialog.exec()

    def show_help(self) -> None:
        """Open the plugin's documentation page."""
        QDesktopServices.openUrl(QUrl(help_url("qgis")))

    def _start_again(self) -> None:
        self._remove_provider()
        self.initProcessing()

    def _remove_provider(self) -> None:
        if self.provider is not None:
            QgsApplication.processingRegistry().removeProvider(self.provider)
            self.provider = None

    def _add_action(self, text: str, does: Any) -> None:
        action = QAction(QIcon(str(ICON)), text, self._iface.mainWindow())
        action.triggered.connect(lambda *_: does())
        self._iface.addPluginToRasterMenu(MENU, action)
        self.actions.append(action)
