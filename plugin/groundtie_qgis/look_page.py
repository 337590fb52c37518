"""The dock's second page: compare reference and registered image at full resolution."""

from __future__ import annotations

from typing import Any

from qgis.core import QgsPointXY, QgsRectangle
from qgis.PyQt import sip
from qgis.PyQt.QtCore import Qt, QTimer
from qgis.PyQt.QtGui import QKeySequence
from qgis.PyQt.QtWidgets import (
    QGridLayout,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QShortcut,
    QVBoxLayout,
    QWidget,
)

from .canvas_items import Overlay, clearly
from .map_tools import SwipeTool
from .reference_export import any_of, between
from .translation import mark, tr

_FLICKER_MS = 600
# Side of the area shown around a place, in reference pixels, of about one screen pixel each.
_SHOWN_PX = 400
_CORNERS = (mark("Top left"), mark("Top right"), mark("Bottom left"), mark("Bottom right"))


class LookPage(QWidget):
    """Swipes and flickers between two images, and moves from place to place.

    Parameters
    ----------
    canvas
        The map.
    overlay
        Draws images over the map.
    """

    def __init__(self, canvas: Any, overlay: Overlay) -> None:
        super().__init__()
        self._canvas, self._overlay = canvas, overlay
        # The map itself may show other layers above the registered image.
        self._beneath = Overlay(canvas, 9)
        self._reference: Any = None
        self._registered: Any = None
        self._worst: list[QgsPointXY] = []
        self._at = -1
        self._timer = QTimer(self)
        self._timer.timeout.connect(self._flick)
        self._tool = SwipeTool(canvas, overlay)
        self._build()

    def _build(self) -> None:
        self.hint = QLabel()
        self.hint.setWordWrap(True)
        self.swipe, self.flicker = QPushButton(tr("Swipe")), QPushButton(tr("Flicker"))
        for button in (self.swipe, self.flicker):
            button.setCheckable(True)
        self.swipe.toggled.connect(self._swipe)
        self._tool.setButton(self.swipe)
        self.flicker.toggled.connect(self._flicker)
        self.next, self.previous = (
            QPushButton(tr(text)) for text in (mark("Next worst point (N)"), mark("Back (B)"))
        )
        self.next.clicked.connect(lambda: self.go(1))
        self.previous.clicked.connect(lambda: self.go(-1))
        self._shortcuts = [QShortcut(QKeySequence(key), self._canvas) for key in ("N", "B")]
        for shortcut, step in zip(self._shortcuts, (1, -1), strict=True):
            shortcut.setContext(Qt.ShortcutContext.WidgetWithChildrenShortcut)
            shortcut.activated.connect(lambda step=step: self.go(step))
        self.corners = [QPushButton(tr(name)) for name in _CORNERS]
        layout = QVBoxLayout(self)
        layout.addWidget(self.hint)
        for row in ((self.swipe, self.flicker), (self.previous, self.next)):
            line = QHBoxLayout()
            for button in row:
                line.addWidget(button)
            layout.addLayout(line)
        grid = QGridLayout()
        for index, button in enumerate(self.corners):
            button.clicked.connect(lambda *_, index=index: self.go_to_corner(index))
            grid.addWidget(button, index // 2, index % 2)
        layout.addLayout(grid)
        layout.addStretch()
        self._enable()

    def show_pair(self, reference: Any, registered: Any) -> None:
        """Set the two layers to compare; None: none."""
        self.stop()
        self._reference, self._registered = reference, registered
        self._enable()

    def shows(self, ids: list[str]) -> bool:
        """Return whether one of the layers with these ids is being compared."""
        return any_of(ids, self._reference, self._registered)

    def show_worst(self, places: list[QgsPointXY]) -> None:
        """Set the places to visit, in map coordinates, the worst first."""
        self._worst, self._at = places, -1
        self._enable()

    def _enable(self) -> None:
        ready = self._reference is not None and self._registered is not None
        for button in (self.swipe, self.flicker, *self.corners):
            button.setEnabled(ready)
        for button in (self.next, self.previous):
            button.setEnabled(bool(self._worst))
        how = tr(
            "Left of the line: the reference. Swipe: move the mouse over the map. Roads "
            "and shores must run on over the line."
        )
        self.hint.setText(how if ready else tr("Register two images first."))

    def stop(self) -> None:
        """Show the plain map again."""
        self.swipe.setChecked(False)
        self.flicker.setChecked(False)

    def take_away(self) -> None:
        """Remove this page's map items permanently."""
        self.stop()
        self._beneath.take_away()
        for shortcut in self._shortcuts:  # Qt runs neither of two shortcuts with the same key.
            sip.delete(shortcut)

    def _show_both(self, on: bool, share: float) -> None:
        """Draw the registered image and, over its left `share`, the reference; or neither."""
        self._beneath.show_layers([clearly(self._registered)] if on else [])
        self._overlay.show_layers([clearly(self._reference)] if on else [], share)

    def _swipe(self, on: bool) -> None:
        if on:
            self.flicker.setChecked(False)
        self._show_both(on, 0.5)
        self._canvas.setMapTool(self._tool) if on else self._canvas.unsetMapTool(self._tool)

    def _flicker(self, on: bool) -> None:
        if on:
            self.swipe.setChecked(False)
        self._show_both(on, 1.0)
        if on:
            self._name_what_is_shown()
            self._timer.start(_FLICKER_MS)
        else:
            self._timer.stop()
            self._enable()

    def _flick(self) -> None:
        self._overlay.set_share(0.0 if self._overlay.share else 1.0)
        self._name_what_is_shown()

    def _name_what_is_shown(self) -> None:
        reference, registered = tr("Shown is the reference."), tr("Shown is the registered image.")
        self.hint.setText(reference if self._overlay.share else registered)

    def go(self, step: int) -> None:
        """Go to the next or previous of the worst points."""
        if self._worst:
            self._at = (self._at + step) % len(self._worst)
            self.go_to(self._worst[self._at])

    def go_to_corner(self, index: int) -> None:
        """Go to a corner of the registered image, inset by a tenth of its sides."""
        box = self._registered.extent()
        across, down = (0.1, 0.9)[index % 2], (0.9, 0.1)[index // 2]
        place = QgsPointXY(
            box.xMinimum() + across * box.width(), box.yMinimum() + down * box.height()
        )
        self.go_to(self._on_map(place))

    def _on_map(self, place: QgsPointXY) -> QgsPointXY:
        crs = self._canvas.mapSettings().destinationCrs()
        return between(self._registered.crs(), crs).transform(place)

    def go_to(self, place: QgsPointXY) -> None:
        """Show a place of the map at full resolution."""
        layer = self._reference
        half = _SHOWN_PX / 2 * (layer.rasterUnitsPerPixelX() if layer is not None else 1.0)
        if layer is not None:
            crs = self._canvas.mapSettings().destinationCrs()
            centre = between(crs, layer.crs()).transform(place)
            box = QgsRectangle(
                centre.x() - half, centre.y() - half, centre.x() + half, centre.y() + half
            )
            self._canvas.setExtent(between(layer.crs(), crs).transformBoundingBox(box))
        else:
            self._canvas.setCenter(place)
        self._canvas.refresh()
