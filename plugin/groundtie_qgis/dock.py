"""The dock *Raster > GroundTie*: start, verdict, look, repair."""

from __future__ import annotations

from typing import Any

from qgis.core import QgsProject
from qgis.PyQt.QtCore import Qt
from qgis.PyQt.QtWidgets import QDockWidget, QTabWidget

from .canvas_items import Overlay
from .library import errors
from .look_page import LookPage
from .reference_export import layer_of
from .repair_page import RepairPage
from .run import Outcome
from .start_page import StartPage
from .translation import tr


class GroundTieDock(QDockWidget):
    """Guides the user from two layers to a registered and inspected image.

    Parameters
    ----------
    iface
        The desktop.
    """

    def __init__(self, iface: Any) -> None:
        super().__init__("GroundTie", iface.mainWindow())
        self.setObjectName("GroundTieDock")
        canvas = iface.mapCanvas()
        self.overlay = Overlay(canvas)
        self.start = StartPage(canvas, self._registered)
        self.look = LookPage(canvas, self.overlay)
        self.repair = RepairPage(canvas, self.overlay, self.look.show_worst, self._written)
        self.tabs = QTabWidget()
        for page, title in (
            (self.start, tr("Register")),
            (self.look, tr("Look")),
            (self.repair, tr("Repair")),
        ):
            self.tabs.addTab(page, title)
        self.tabs.currentChanged.connect(self._turn_to)
        self.setWidget(self.tabs)
        self.setAllowedAreas(
            Qt.DockWidgetArea.LeftDockWidgetArea | Qt.DockWidgetArea.RightDockWidgetArea
        )
        QgsProject.instance().layersWillBeRemoved.connect(self._forget)

    def _turn_to(self, _: int) -> None:
        """Show the map items of the current page."""
        page = self.tabs.currentWidget()
        self.repair.points.setVisible(page is not self.look)
        if page is not self.look:
            self.look.stop()
        if page is not self.repair:
            self.repair.stop()

    def _registered(self, outcome: Outcome, reference: Any, input: Any) -> None:
        """Pass a registration's outcome to the other pages; a cancelled one changes nothing."""
        if not (outcome.succeeded or outcome.files.get("REPORT")):
            return
        registered = layer_of(outcome.files.get("OUTPUT"))
        self.look.show_pair(reference, registered)
        try:
            points = outcome.files.get("TIE_POINTS")
            if points is None and self.repair.has_points_of(reference, input):
                pass  # A refusal has no points: keep those that the user has edited.
            elif self.start.sensor is None:
                self.repair.open(reference, input, points)
            elif points is not None:
                self.repair.open_sensor(reference, registered, self.start.sensor, outcome)
        except errors.GroundTieError as error:
            self.repair.close_points()
            self.repair.text.setText(error.one_line())

    def _written(self, reference: Any, layer: Any) -> None:
        self.look.show_pair(reference, layer)

    def _forget(self, ids: list[str]) -> None:
        """Stop showing layers that are removed from the project; the others stay."""
        if self.look.shows(ids):
            self.look.show_pair(None, None)
        if self.repair.shows(ids):
            self.repair.close_points()

    def closeEvent(self, event: Any) -> None:
        """Leave the map as it is."""
        self.look.stop()
        self.repair.stop()
        self.repair.points.hide()
        super().closeEvent(event)

    def showEvent(self, event: Any) -> None:
        """Propose layers of the project."""
        if self.start.outcome is None:
            self.start.propose()
        self.repair.points.setVisible(self.tabs.currentWidget() is not self.look)
        super().showEvent(event)

    def take_away(self) -> None:
        """Remove all map items and signal connections (for unloading)."""
        QgsProject.instance().layersWillBeRemoved.disconnect(self._forget)
        self.start.take_away()
        self.look.take_away()
        self.repair.take_away()
        self.overlay.take_away()
