# ruff: noqa: N815 - the names are QGIS's
"""A program that opens the plugin's dock and dialog in PyQt6, with stand-ins for QGIS's classes.

Called with the files of a registration: reference, input, tie points, and a folder for pictures.
"""

from __future__ import annotations

import sys
import types
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock

from PyQt6 import QtCore, QtGui, QtWidgets, sip


class Place(QtCore.QPointF):
    """Stands for `QgsPointXY`."""


class Rectangle:
    """Stands for `QgsRectangle`: the map of tests/noise_pairs.py."""

    xMinimum, xMaximum = (lambda self: 500_000.0), (lambda self: 500_384.0)
    yMinimum, yMaximum = (lambda self: 4_999_616.0), (lambda self: 5_000_000.0)
    width = height = lambda self: 384.0


class Canvas(QtWidgets.QGraphicsView):
    """Stands for `QgsMapCanvas`."""

    mapCanvasRefreshed, destinationCrsChanged = QtCore.pyqtSignal(), QtCore.pyqtSignal()

    def __init__(self, parent: Any) -> None:
        super().__init__(QtWidgets.QGraphicsScene(), parent)

    mapSettings = setMapTool = unsetMapTool = setCenter = refresh = MagicMock()

    def extent(self) -> Rectangle:
        return Rectangle()

    def getCoordinateTransform(self) -> Any:
        return MagicMock(toMapCoordinates=lambda x, y: Place(500_000 + x, 5_000_000 - y))


class CanvasItem(QtWidgets.QGraphicsItem):
    """Stands for `QgsMapCanvasItem`."""

    def __init__(self, canvas: Canvas) -> None:
        super().__init__()
        canvas.scene().addItem(self)

    def boundingRect(self) -> QtCore.QRectF:
        return QtCore.QRectF(0, 0, 384, 384)

    def setRect(self, _: Any) -> None:
        self.update()

    def toCanvasCoordinates(self, place: Place) -> QtCore.QPointF:
        return QtCore.QPointF(place.x() - 500_000, 5_000_000 - place.y())


class LayerBox(QtWidgets.QComboBox):
    """Stands for `QgsMapLayerComboBox` and `QgsRasterBandComboBox`."""

    layerChanged = QtCore.pyqtSignal(object)

    def __getattr__(self, name: str) -> Any:
        if name in ("currentLayer", "layer"):
            return lambda: None
        return lambda *_: None


def install_stand_ins() -> None:
    """Make `qgis` importable: its Qt is PyQt6, where QGIS 4 puts each name."""
    for name in ("QAction", "QActionGroup", "QShortcut"):
        setattr(QtWidgets, name, getattr(QtGui, name))
    qt = types.ModuleType("qgis.PyQt")
    parts = {"QtCore": QtCore, "QtGui": QtGui, "QtWidgets": QtWidgets, "sip": sip}
    vars(qt).update(parts)
    core, gui, utils = (MagicMock(name=f"qgis.{part}") for part in ("core", "gui", "utils"))
    core.QgsPointXY, core.QgsRectangle, core.QgsRasterLayer = Place, Rectangle, MagicMock
    core.QgsCoordinateTransform = lambda *_: MagicMock(transform=lambda place: place)
    core.QgsProcessingFeedback = object
    gui.QgsMapCanvas, gui.QgsMapCanvasItem = Canvas, CanvasItem
    gui.QgsMapTool = type(
        "QgsMapTool", (QtCore.QObject,), {"setCursor": MagicMock(), "setButton": MagicMock()}
    )
    gui.QgsMapLayerComboBox = gui.QgsRasterBandComboBox = LayerBox
    package = types.ModuleType("qgis")
    vars(package).update(core=core, gui=gui, utils=utils, PyQt=qt)
    sys.modules |= {"qgis": package, "qgis.core": core, "qgis.gui": gui, "qgis.utils": utils}
    sys.modules["osgeo"] = MagicMock(
        **{"gdal.Open.return_value": None, "gdal.OpenEx.return_value": None}
    )
    sys.modules |= {"qgis.PyQt": qt} | {f"qgis.PyQt.{name}": part for name, part in parts.items()}


def main(reference: str, input: str, tie_points: str, pictures: str) -> None:
    """Open the dock, repair points, draw them, and open the dialog; keep pictures."""
    install_stand_ins()
    application = QtWidgets.QApplication([])
    window = QtWidgets.QMainWindow()
    canvas = Canvas(window)
    window.setCentralWidget(canvas)
    from groundtie_qgis.dock import GroundTieDock
    from groundtie_qgis.install_dialog import InstallDialog
    from groundtie_qgis.point_table import PointTable

    iface = MagicMock()
    iface.mainWindow.return_value, iface.mapCanvas.return_value = window, canvas
    dock = GroundTieDock(iface)
    window.addDockWidget(QtCore.Qt.DockWidgetArea.RightDockWidgetArea, dock)
    window.resize(1200, 700)
    window.show()
    dock.start.register.click()
    assert "Choose two raster layers" in dock.start.verdict.text()
    layers = [MagicMock(**{"source.return_value": path}) for path in (reference, input)]
    dock.repair.open(*layers, Path(tie_points))
    dock.tabs.setCurrentWidget(dock.repair)
    table: PointTable = dock.repair.table
    check = QtCore.Qt.ItemDataRole.CheckStateRole
    assert table.rowCount() > 10
    first, point = table.index(0, 0), table.point_at(0)
    assert first.data(check) == QtCore.Qt.CheckState.Checked
    # As a click on the box hands it over.
    delegate = dock.repair.view.itemDelegate()
    assert isinstance(delegate, QtWidgets.QAbstractItemDelegate)
    assert table.setData(first, QtCore.Qt.CheckState.Unchecked.value, check)
    assert not dock.repair.review.points.used[point]
    for column in range(table.columnCount()):
        dock.repair.view.sortByColumn(column, QtCore.Qt.SortOrder.AscendingOrder)
    dock.repair.drag.click()
    dock.repair._choose(point)
    image = QtGui.QImage(384, 384, QtGui.QImage.Format.Format_RGB32)
    image.fill(QtGui.QColor("white"))
    painter = QtGui.QPainter(image)
    dock.repair.points.paint(painter)
    painter.end()
    assert any(image.pixelColor(x, y).green() < 250 for x in range(384) for y in range(384))
    application.processEvents()
    assert window.grab().save(f"{pictures}/qt6_repair.png")
    dialog = InstallDialog(Path(pictures), lambda: None, window)
    dialog.show()
    assert dialog.grab().save(f"{pictures}/qt6_install.png")
    dialog.reject()
    dock.repair.close_points()
    assert table.rowCount() == 0
    dock.close()
    dock.take_away()
    print("done")


if __name__ == "__main__":
    main(*sys.argv[1:])
