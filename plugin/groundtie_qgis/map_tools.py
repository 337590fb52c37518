"""Mouse tools on the map for comparing images and repairing points."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from qgis.core import QgsPointXY
from qgis.gui import QgsMapCanvas, QgsMapTool
from qgis.PyQt.QtCore import Qt

from .canvas_items import Overlay, PointsItem

# Largest distance of a click that grabs a point, in screen pixels.
_REACH_PX = 10


class SwipeTool(QgsMapTool):
    """Moves the line between two images with the mouse."""

    def __init__(self, canvas: QgsMapCanvas, overlay: Overlay) -> None:
        super().__init__(canvas)
        self._overlay = overlay
        self.setCursor(Qt.CursorShape.SplitHCursor)

    def canvasMoveEvent(self, event: Any) -> None:
        self._overlay.set_share(event.pos().x() / max(self.canvas().viewport().width(), 1))


class DragTool(QgsMapTool):
    """Grabs tie points and moves them.

    Parameters
    ----------
    moved
        Called with the index, the end (0: in the input, 1: on the reference) and the new map
        position.
    chosen
        Called with the index of a clicked point.
    """

    def __init__(
        self,
        canvas: QgsMapCanvas,
        points: PointsItem,
        moved: Callable[[int, int, QgsPointXY], None],
        chosen: Callable[[int], None],
    ) -> None:
        super().__init__(canvas)
        self._points, self._moved, self._chosen = points, moved, chosen
        self._held: tuple[int, int] | None = None
        self._pressed: Any = None

    def canvasPressEvent(self, event: Any) -> None:
        self._held, self._pressed = self._nearest(event.pos()), event.pos()
        if self._held is not None:
            self._chosen(self._held[0])

    def canvasMoveEvent(self, event: Any) -> None:
        if self._held is None:
            return
        index, end = self._held
        row = list(self._points.rows[index])
        row[end] = self.toMapCoordinates(event.pos())
        self._points.rows[index] = tuple(row)  # type: ignore[assignment, call-overload]
        self._points.update()

    def canvasReleaseEvent(self, event: Any) -> None:
        if self._held is not None and event.pos() != self._pressed:
            self._moved(*self._held, self.toMapCoordinates(event.pos()))
        self._held = None

    def _nearest(self, position: Any) -> tuple[int, int] | None:
        off = self._points.on_screen() - (position.x(), position.y())
        # The mark comes first, so that it wins for lines of zero length.
        squared = (off[:, ::-1] ** 2).sum(-1)
        if not (squared <= _REACH_PX**2).any():
            return None
        index, end = np.unravel_index(squared.argmin(), squared.shape)
        return int(index), 1 - int(end)


class ClickTool(QgsMapTool):
    """Passes on every click."""

    def __init__(self, canvas: QgsMapCanvas, clicked: Callable[[QgsPointXY], None]) -> None:
        super().__init__(canvas)
        self._clicked = clicked
        self.setCursor(Qt.CursorShape.CrossCursor)

    def canvasReleaseEvent(self, event: Any) -> None:
        self._clicked(self.toMapCoordinates(event.pos()))
