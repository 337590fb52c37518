"""Map items that the dock draws: images over the map, up to a swipe line, and tie points."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from qgis.core import (
    QgsMapRendererParallelJob,
    QgsMapSettings,
    QgsPointXY,
    QgsRasterLayer,
    QgsRectangle,
)
from qgis.gui import QgsMapCanvas, QgsMapCanvasItem
from qgis.PyQt.QtCore import QLineF, QPointF, QRectF, Qt
from qgis.PyQt.QtGui import QColor, QImage, QPen, QPolygonF

from .compat import STRETCH, WITHOUT_EXTREMES

# Residuals up to 1 px, up to 2 px and above, as in styles/tie_points.qml.
_COLOURS = ((1.0, QColor("#1a9850")), (2.0, QColor("#f59b00")), (float("inf"), QColor("#d73027")))
_OFF = QColor("#8c8c8c")


def clearly(layer: Any) -> Any:
    """Return a layer for viewing; a single grey band is stretched without its extremes.

    Stretched from minimum to maximum, a radar image would be almost black.
    """
    if not isinstance(layer, QgsRasterLayer) or layer.renderer().type() != "singlebandgray":
        return layer
    copy = layer.clone()
    copy.setContrastEnhancement(STRETCH, WITHOUT_EXTREMES)
    return copy


def top_left(canvas: QgsMapCanvas) -> QgsPointXY:
    """Return the map position of the top left corner, also where the map is rotated."""
    return canvas.getCoordinateTransform().toMapCoordinates(0, 0)


class Overlay(QgsMapCanvasItem):
    """Draws layers over the map, left of a swipe line or everywhere.

    Parameters
    ----------
    canvas
        The map.
    height
        Stacking order among the items that are drawn over the map.
    """

    def __init__(self, canvas: QgsMapCanvas, height: float = 10) -> None:
        super().__init__(canvas)
        self._canvas = canvas
        self._layers: list[Any] = []
        self._image = QImage()
        self._extent, self._corner = QgsRectangle(), QgsPointXY()
        self._job: QgsMapRendererParallelJob | None = None
        self.share = 1.0
        self.setZValue(height)
        canvas.mapCanvasRefreshed.connect(self.render)

    def show_layers(self, layers: list[Any], share: float = 1.0) -> None:
        """Draw layers over the left `share` of the map; an empty list draws nothing."""
        self._layers, self.share = layers, share
        self.render()

    def take_away(self) -> None:
        """Remove this item from the map permanently."""
        self.show_layers([])
        if self._job is not None:
            # A rendering job that outlives QGIS crashes it.
            self._job.cancel()
        self._canvas.mapCanvasRefreshed.disconnect(self.render)
        self._canvas.scene().removeItem(self)

    def set_share(self, share: float) -> None:
        """Move the line to a share of the map's width."""
        self.share = min(max(share, 0.0), 1.0)
        self.update()

    def render(self) -> None:
        """Redraw the layers for the current map view."""
        self.setVisible(bool(self._layers))
        if not self._layers:
            return
        settings = QgsMapSettings(self._canvas.mapSettings())
        settings.setLayers(self._layers)
        self._job = QgsMapRendererParallelJob(settings)
        self._job.finished.connect(self._drawn)
        self._job.start()

    def _drawn(self) -> None:
        if self._job is None or not self._layers:
            return
        self._image = self._job.renderedImage()
        self._extent, self._corner = self._canvas.extent(), top_left(self._canvas)
        self.updatePosition()
        self.update()

    def updatePosition(self) -> None:
        """Move to where the image was drawn (called by QGIS when the map moves)."""
        self.setRect(self._extent)
        self.setPos(self.toCanvasCoordinates(self._corner))

    def paint(self, painter: Any, option: Any = None, widget: Any = None) -> None:
        if self._image.isNull() or not self._layers:
            return
        # The viewport excludes the map's frame, which would stretch the image by two pixels.
        size = self._canvas.viewport().size()
        width = size.width() * self.share
        painter.save()
        painter.setClipRect(QRectF(0, 0, width, size.height()))
        painter.drawImage(QRectF(0, 0, size.width(), size.height()), self._image)
        painter.restore()
        if self.share < 1.0:
            painter.setPen(QPen(QColor("white"), 3))
            painter.drawLine(QPointF(width, 0), QPointF(width, size.height()))
            painter.setPen(QPen(QColor("black"), 1))
            painter.drawLine(QPointF(width, 0), QPointF(width, size.height()))


class PointsItem(QgsMapCanvasItem):
    """Draws tie points: lines from nominal to reference positions, with marks at the latter."""

    def __init__(self, canvas: QgsMapCanvas) -> None:
        super().__init__(canvas)
        self._canvas = canvas
        self.rows: list[tuple[QgsPointXY, QgsPointXY, float, bool, bool]] = []
        self.chosen = -1
        self.setZValue(20)

    def show_points(self, rows: list[tuple[QgsPointXY, QgsPointXY, float, bool, bool]]) -> None:
        """Draw rows of nominal position, reference position, residual, and flags used and check."""
        self.rows = rows
        self.updatePosition()

    def updatePosition(self) -> None:
        """Cover the map (called by QGIS when the map moves)."""
        self.setRect(self._canvas.extent())
        self.setPos(self.toCanvasCoordinates(top_left(self._canvas)))
        self.update()

    def on_screen(self) -> NDArray[np.float64]:
        """Return the screen pixels of nominal and reference positions, shape (n, 2, 2).

        The mapping from map to screen is affine, so QGIS is asked for three positions only.
        """
        if not self.rows:
            return np.zeros((0, 2, 2))
        map_xy = np.array([[(end.x(), end.y()) for end in row[:2]] for row in self.rows])
        extent = self._canvas.extent()
        x, y = extent.xMinimum(), extent.yMinimum()
        corners = (x, y), (extent.xMaximum(), y), (x, extent.yMaximum())
        seen = [self.toCanvasCoordinates(QgsPointXY(*corner)) for corner in corners]
        first, *others = np.array([(one.x(), one.y()) for one in seen])
        share = (map_xy.reshape(-1, 2, 2) - (x, y)) / (extent.width(), extent.height())
        return np.asarray(first + share @ (np.array(others) - first))

    def paint(self, painter: Any, option: Any = None, widget: Any = None) -> None:
        """Draw points of equal appearance together, as there may be thousands."""
        painter.setRenderHint(painter.RenderHint.Antialiasing)
        alike: dict[tuple[int, bool, bool], list[int]] = {}
        for index, (_, _, residual, used, check) in enumerate(self.rows):
            colour = sum(residual > limit for limit, _ in _COLOURS) if used else -1
            alike.setdefault((colour, check, index == self.chosen), []).append(index)
        places = self.on_screen()
        for (colour, check, chosen), indices in alike.items():
            pen = QPen(_OFF if colour < 0 else _COLOURS[colour][1], 3 if chosen else 1.5)
            ends = places[indices].reshape(-1, 4).tolist()
            painter.setPen(pen)
            painter.drawLines([QLineF(*four) for four in ends])
            pen.setWidthF((12 if chosen else 8) if colour >= 0 else 5)
            pen.setCapStyle(Qt.PenCapStyle.SquareCap if check else Qt.PenCapStyle.RoundCap)
            painter.setPen(pen)
            painter.drawPoints(QPolygonF([QPointF(*four[2:]) for four in ends]))
