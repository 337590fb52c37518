"""A window with a map and the dock, as a person has them before their eyes."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock

from noise_pairs import write_pair


class Desktop:
    """A window with a map and the dock beside it."""

    def __init__(self, pictures: Path) -> None:
        from groundtie_qgis.dock import GroundTieDock
        from qgis.core import QgsCoordinateReferenceSystem
        from qgis.gui import QgsMapCanvas
        from qgis.PyQt.QtCore import Qt
        from qgis.PyQt.QtWidgets import QMainWindow

        self.window, self.iface = QMainWindow(), MagicMock()
        self.canvas = QgsMapCanvas(self.window)
        self.canvas.setDestinationCrs(QgsCoordinateReferenceSystem("EPSG:32633"))
        self.window.setCentralWidget(self.canvas)
        self.iface.mainWindow.return_value = self.window
        self.iface.mapCanvas.return_value = self.canvas
        self.window.resize(1200, 700)
        self._pictures = pictures
        self._dock = GroundTieDock
        self._right = Qt.DockWidgetArea.RightDockWidgetArea
        self.dock: Any = None

    def open(self) -> Any:
        self.dock = self._dock(self.iface)
        self.window.addDockWidget(self._right, self.dock)
        self.window.show()
        self.refresh()
        return self.dock

    def load(self, folder: Path, *names: str) -> list[Any]:
        from qgis.core import QgsProject, QgsRasterLayer

        layers = [QgsRasterLayer(str(folder / f"{name}.tif"), name) for name in names]
        for layer in layers:
            QgsProject.instance().addMapLayer(layer)
        self.canvas.setExtent(layers[0].extent())
        return layers

    def refresh(self) -> None:
        from qgis.core import QgsProject

        layers = QgsProject.instance().layerTreeRoot().checkedLayers()
        self.canvas.setLayers(layers)
        if not layers:
            return  # Nothing is drawn, and no signal comes.
        drawn: list[bool] = []

        def note() -> None:
            drawn.append(True)

        self.canvas.mapCanvasRefreshed.connect(note)
        self.canvas.refresh()
        self.wait(lambda: bool(drawn) and not self.canvas.isDrawing())
        self.canvas.mapCanvasRefreshed.disconnect(note)

    def wait(self, until: Callable[[], bool], least: float = 0.0, most: float = 120.0) -> None:
        from qgis.core import QgsApplication

        start = time.monotonic()
        while time.monotonic() - start < most:
            QgsApplication.processEvents()
            if until() and time.monotonic() - start >= least:
                return
            time.sleep(0.01)
        raise AssertionError("nothing came")

    def picture(self, name: str) -> None:
        self.refresh()
        self._pictures.mkdir(parents=True, exist_ok=True)
        assert self.window.grab().save(str(self._pictures / f"{name}.png"))

    def register(self) -> Any:
        start = self.dock.start
        start.register.click()
        self.wait(lambda: start._run is None)
        return start.outcome


def pair(folder: Path, desktop: Desktop) -> list[Any]:
    write_pair(folder, 0)
    return desktop.load(folder, "reference", "input")


def open_registered(folder: Path, desktop: Desktop, files: dict[str, Path]) -> Any:
    """Open the dock as it is after a registration."""
    from groundtie_qgis.run import Outcome
    from qgis.core import QgsProject

    reference, input = pair(folder, desktop)
    dock = desktop.open()
    desktop.load(files["OUTPUT"].parent, "registered")
    dock._registered(Outcome(True, files=files), reference, input)
    assert len(QgsProject.instance().mapLayers()) == 3
    return dock


def drag(tool: Any, start: Any, by: tuple[int, int]) -> None:
    """Press on a place of the map, move the mouse, and let go."""
    from qgis.PyQt.QtCore import QPoint

    pressed = QPoint(round(start.x()), round(start.y()))
    for name, place in (
        ("canvasPressEvent", pressed),
        ("canvasMoveEvent", pressed + QPoint(*by) / 2),
        ("canvasMoveEvent", pressed + QPoint(*by)),
        ("canvasReleaseEvent", pressed + QPoint(*by)),
    ):
        event = MagicMock()
        event.pos.return_value = place
        getattr(tool, name)(event)
