"""The dock's third page: tie points in a table and on the map, refitted after every change."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from qgis.core import QgsCoordinateReferenceSystem, QgsPointXY, QgsRasterLayer
from qgis.PyQt.QtWidgets import (
    QCheckBox,
    QComboBox,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from .canvas_items import Overlay, PointsItem, clearly
from .dependencies import rasterio_env
from .library import errors, library_module
from .map_tools import ClickTool, DragTool
from .model_list import BIASES, FIRST_POINTS, model_text, points_text
from .point_table import PointTable, PointView
from .reference_export import any_of, between, layer_of
from .run import Outcome
from .sensor_run import SensorImage
from .start_files import file_name
from .translation import tr
from .writer import Writer


class RepairPage(QWidget):
    """Switches points on and off, moves and adds them, and writes the resulting image.

    Parameters
    ----------
    canvas
        The map.
    overlay
        Draws images over the map.
    changed
        Called after every fit with the map positions of the points, the worst first.
    written
        Called with the reference and the written layer.
    """

    def __init__(
        self,
        canvas: Any,
        overlay: Overlay,
        changed: Callable[[list[QgsPointXY]], None],
        written: Callable[[Any, Any], None],
    ) -> None:
        super().__init__()
        self._canvas, self._overlay = canvas, overlay
        self._changed, self._written = changed, written
        self.review: Any = None
        # States of the points before each edit, the newest last.
        self._past: list[Any] = []
        self.fits: dict[str, Any] = {}
        self._reference: Any = None
        self._input: Any = None
        self._clicked: tuple[float, float] | None = None
        self.writer = Writer(self._end_writing)
        # The image with RPCs, if any, which is then written in place of the input.
        self._sensor: SensorImage | None = None
        self.points = PointsItem(canvas)
        self._drag = DragTool(canvas, self.points, self._moved_on_map, self._choose)
        self._click = ClickTool(canvas, self._clicked_on_map)
        self._build()
        canvas.destinationCrsChanged.connect(self._show_fit)

    def _build(self) -> None:
        self.text = QLabel(tr("Register two images first."))
        self.text.setWordWrap(True)
        self.model = QComboBox()
        self.model.currentIndexChanged.connect(lambda *_: self._show_fit())
        self.table = PointTable(self)
        self.table.switched.connect(self._switch)
        self.view = PointView(self.table)
        self.view.point_clicked.connect(self._zoom)
        self.drag, self.add = QPushButton(tr("Move points")), QPushButton(tr("Add a point"))
        self.drag.setCheckable(True)
        self.add.setCheckable(True)
        self.drag.toggled.connect(self._set_dragging)
        self.add.toggled.connect(self._set_adding)
        # The buttons are released when another map tool, of this page or of QGIS, is chosen.
        self._drag.setButton(self.drag)
        self._click.setButton(self.add)
        self.undo = QPushButton(tr("Undo"))
        self.undo.clicked.connect(lambda *_: self._undo())
        self.match = QCheckBox(tr("refine clicks by similarity"))
        self.match.setChecked(True)
        self.write = QPushButton(tr("Write image"))
        self.write.clicked.connect(self.start_writing)
        layout = QVBoxLayout(self)
        layout.addWidget(self.model)
        tools = QHBoxLayout()
        tools.addWidget(self.drag)
        tools.addWidget(self.add)
        tools.addWidget(self.undo)
        layout.addLayout(tools)
        for widget in (self.match, self.view, self.text, self.write):
            layout.addWidget(widget)
        self._enable()

    def _enable(self) -> None:
        for widget in (self.drag, self.add, self.match, self.model):
            widget.setEnabled(self.review is not None)
        self.undo.setEnabled(bool(self._past))
        self.write.setEnabled(bool(self.fits) and self.writer.run is None)

    def open_sensor(self, reference: Any, ortho: Any, image: SensorImage, outcome: Outcome) -> None:
        """Load the ground control of an image with RPCs, which `ortho` shows on the map."""
        review = library_module("review")
        files, dem = outcome.files, image.dem
        with rasterio_env():
            opened = review.of_sensor_image(
                file_name(reference),
                file_name(image.layer),
                files["RPC"],
                None if dem is None else Path(file_name(dem)),
                None if dem is None else image.datum,
                files["TIE_POINTS"],
            )
        self._reference, self._input, self._sensor = reference, ortho, image
        self.change(opened, "translation")

    def open(self, reference: Any, input: Any, path: Any) -> None:
        """Load the tie points of a registration; None: start without points."""
        review = library_module("review")
        self._reference, self._input, self._sensor = reference, input, None
        with rasterio_env():
            if path is not None:
                opened = review.Review.open(path, file_name(input))
            else:
                opened = review.without_points(file_name(reference), file_name(input))
        self.change(opened, "affine")
        self.text.setText(self._summary() if path is not None else tr(FIRST_POINTS))

    def close_points(self) -> None:
        """Discard the points."""
        self.stop()
        self.review, self.fits, self._past = None, {}, []
        self._reference = self._input = self._sensor = None
        self.model.clear()
        self.table.show_review(None, np.zeros(0))
        self.points.show_points([])
        self._changed([])
        self.text.setText(tr("Register two images first."))
        self._enable()

    def shows(self, ids: list[str]) -> bool:
        """Return whether the points belong to one of the layers with these ids."""
        image = () if self._sensor is None else (self._sensor.layer, self._sensor.dem)
        return any_of(ids, self._reference, self._input, *image)

    def take_away(self) -> None:
        """Remove this page's map items permanently."""
        self.stop()
        if self.writer.run is not None:
            self.writer.run.cancel()
        self._canvas.destinationCrsChanged.disconnect(self._show_fit)
        self._canvas.scene().removeItem(self.points)

    def has_points_of(self, reference: Any, input: Any) -> bool:
        """Return whether this page has points between two layers."""
        mine = self._reference is reference and self._input is input
        return mine and self.review is not None and len(self.review.points) > 0

    def stop(self) -> None:
        """Release the map tools."""
        self.drag.setChecked(False)
        self.add.setChecked(False)

    def kind(self) -> str:
        """Return the chosen model."""
        return str(self.model.currentData() or "")

    def change(self, review: Any, kind: str | None = None) -> None:
        """Show edited points, or other ones with a `kind` of model, and refit them."""
        self._past = [] if kind else [*self._past, self.review]
        self._refit(review, kind)

    def _undo(self) -> None:
        *self._past, before = self._past
        self._refit(before)

    def _refit(self, review: Any, kind: str | None = None) -> None:
        wanted = kind or self.kind() or "affine"
        self.review = review
        self.fits = review.fits() if self._sensor is None else review.fits([*BIASES])
        self.model.blockSignals(True)
        self.model.clear()
        for name, fit in self.fits.items():
            self.model.addItem(model_text(name, fit), name)
        kinds = [*self.fits]
        self.model.setCurrentIndex(kinds.index(wanted) if wanted in kinds else len(kinds) - 1)
        self.model.blockSignals(False)
        self._show_fit()
        self._enable()

    def _show_fit(self) -> None:
        if self.review is None:
            return
        fit = self.fits.get(self.kind())
        count = len(self.review.points)
        residuals = np.full(count, np.nan) if fit is None else fit.residuals_px
        self.table.show_review(self.review, residuals)
        nominal = self._on_map(self.review.nominal_xy)
        places = self._on_map(self.review.points.reference_xy)
        used, check = self.review.points.used, self.review.points.is_check
        self.points.show_points(
            [*zip(nominal, places, residuals.tolist(), used.tolist(), check.tolist(), strict=True)]
        )
        self._changed([places[index] for index in self.review.worst(residuals)])
        self.text.setText(self._summary())

    def _summary(self) -> str:
        return points_text(self.review, self.fits.get(self.kind()))

    def _switch(self, row: int, on: bool) -> None:
        self.change(self.review.switch([row], on))

    def _zoom(self, row: int) -> None:
        self._choose(row)
        self._canvas.setCenter(self.points.rows[row][1])
        self._canvas.refresh()

    def _choose(self, row: int) -> None:
        self.points.chosen = row
        self.points.update()
        self.view.show_point(row)

    def _set_dragging(self, on: bool) -> None:
        self._set_tool(self._drag, on)
        if on:
            self.text.setText(
                tr("Pull a mark to its place on the reference, or a line's other end.")
            )

    def _set_adding(self, on: bool) -> None:
        self._clicked = None
        self._set_tool(self._click, on)
        self._overlay.show_layers([clearly(self._reference)] if on else [])
        if on:
            self.text.setText(tr("Shown is the reference: click a place that both images have."))

    def _set_tool(self, tool: Any, on: bool) -> None:
        self._canvas.setMapTool(tool) if on else self._canvas.unsetMapTool(tool)

    def _moved_on_map(self, index: int, end: int, place: QgsPointXY) -> None:
        xy = self._on_reference(place)
        if end == 1:
            self.change(self.review.move(index, reference_xy=xy))
        else:
            self.change(self.review.move(index, input_px=self.review.input_px(xy)))
        self._choose(index)

    def _clicked_on_map(self, place: QgsPointXY) -> None:
        if self._clicked is None:
            self._clicked = self._on_reference(place)
            self._overlay.show_layers([clearly(self._input)])
            self.text.setText(
                tr("Shown is the input where its own georeferencing has it: click there.")
            )
            return
        first, self._clicked = self._clicked, None
        self._overlay.show_layers([clearly(self._reference)])
        self.add_point(first, self.review.input_px(self._on_reference(place)))

    def add_point(self, reference_xy: Any, input_px: Any) -> None:
        """Add a point, refined by similarity if that is requested."""
        score, note = float("nan"), ""
        if self.match.isChecked():
            review = library_module("review")
            fit = self.fits.get(self.kind())
            transform = self.review.nominal if fit is None else fit.transform
            seen = self._input if self._sensor is None else self._sensor.layer
            images = file_name(self._reference), file_name(seen)
            try:
                with rasterio_env():
                    input_px, peak = review.refine_click(*images, reference_xy, input_px, transform)
                score = peak.height
            except errors.GroundTieError as error:
                note = " " + tr("It stays where you clicked: {}.").format(error.one_line())
        self.change(self.review.add(reference_xy, input_px, score))
        self._choose(len(self.review.points) - 1)
        self.text.setText(self._summary() + note)

    def start_writing(self) -> None:
        """Write the image by the model fitted to the points."""
        fit = self.fits[self.kind()]
        layers = self._reference, self._input
        if refusal := self.writer.start(self.review, fit, *layers, self._sensor):
            self.text.setText(tr("Not written: {}.").format(refusal))
            return
        self._enable()

    def _end_writing(self, outcome: Outcome) -> None:
        self._enable()
        if self.review is None:
            return  # One of the layers was removed from the project meanwhile.
        if not outcome.succeeded:
            self.text.setText(tr("Not written: {}.").format(outcome.reason.rstrip(".")))
            return
        path = outcome.files["OUTPUT"]
        self.text.setText(tr("Written: {}.").format(path) + f" {self._summary()}")
        self._written(self._reference, layer_of(path) or QgsRasterLayer(str(path)))

    def _crs(self) -> Any:
        return self._reference.crs() if self._reference else QgsCoordinateReferenceSystem()

    def _on_map(self, places: Any) -> list[QgsPointXY]:
        transform = between(self._crs(), self._canvas.mapSettings().destinationCrs())
        drawn = (places + 0.5) * [1, -1] if self._is_on_pixels() else places
        return [transform.transform(QgsPointXY(x, y)) for x, y in drawn.tolist()]

    def _on_reference(self, place: QgsPointXY) -> tuple[float, float]:
        transform = between(self._canvas.mapSettings().destinationCrs(), self._crs())
        found = transform.transform(place)
        x, y = found.x(), found.y()
        return (x - 0.5, -y - 0.5) if self._is_on_pixels() else (x, y)

    def _is_on_pixels(self) -> bool:
        """Whether positions are pixels; QGIS draws them downwards from 0, centres at halves."""
        review = self.review
        return review.points.crs is None and not review.input_grid.is_georeferenced
