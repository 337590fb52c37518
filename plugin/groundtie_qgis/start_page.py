"""The dock's first page: choice of images, options of the registration, and its outcome."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from qgis.core import QgsProviderRegistry
from qgis.gui import QgsMapLayerComboBox
from qgis.PyQt import sip
from qgis.PyQt.QtCore import QTimer, QUrl
from qgis.PyQt.QtGui import QDesktopServices
from qgis.PyQt.QtWidgets import (
    QCheckBox,
    QComboBox,
    QDoubleSpinBox,
    QFormLayout,
    QHBoxLayout,
    QProgressBar,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from .compat import RASTER_LAYERS
from .library import library_module
from .preselection import proposed_pair, raster_files
from .reference_export import MAP, with_files
from .run import Outcome, Run, new_file
from .search import usual_radius_m
from .sensor_run import SensorImage, SensorRun
from .start_files import has_rpcs, is_file, points_name
from .translation import mark, tr
from .tries import BandRows, Tries, have_bands
from .verdict_label import VerdictLabel, first_lines
from .wording import choice_label

# Kinds of image pairs, by the tool for each.
PAIRS = {
    "register": mark("Decided by the images"),
    "coregister": mark("SAR and optical"),
    "match_sar_sar": mark("SAR and SAR"),
    "match_optical": mark("Optical and optical"),
}
_ANY_ROTATION_DEG = 180.0


class StartPage(QWidget):
    """Registers two layers of the project.

    Parameters
    ----------
    canvas
        The map.
    finished
        Called with the outcome of a registration and its two layers.
    """

    def __init__(self, canvas: Any, finished: Callable[[Outcome, Any, Any], None]) -> None:
        super().__init__()
        self._canvas, self._finished = canvas, finished
        self._run: Run | SensorRun | None = None
        self.sensor: SensorImage | None = None
        self.outcome: Outcome | None = None
        self._layers: tuple[Any, ...] = ()
        # In a project without layers, the box shows the map although nobody chose it.
        self._chose_map = False
        self._build()
        self.propose()

    def _build(self) -> None:
        self.reference, self.input = _raster_box(), _raster_box(files=True)
        self.reference.setAdditionalItems([tr(MAP)])
        self.reference.activated.connect(self._note_choice)
        self.pair = QComboBox()
        for tool, text in PAIRS.items():
            self.pair.addItem(tr(text), tool)
        self.radius = QDoubleSpinBox()
        self.radius.setRange(0, 1e6)
        self.radius.setDecimals(0)
        self.radius.setSuffix(" m")
        self.radius.setSpecialValueText(tr("usual"))
        self.rotated = QCheckBox(tr("rotation unknown"))
        self.dem = _raster_box(files=True)
        self.dem.setAllowEmptyLayer(True)
        self.dem.setLayer(None)
        self.datum = QComboBox()
        for datum in library_module("sensor.geoids").DATUMS:
            self.datum.addItem(choice_label(datum), datum)
        self.heights = QWidget()
        self.register = QPushButton(tr("Register"))
        self.progress = QProgressBar()
        self.progress.hide()
        self.verdict = VerdictLabel()
        self.tries, self.bands = Tries(), BandRows()
        self.report = QPushButton(tr("Open report"))
        self.report.hide()
        self._lay_out()
        self.register.clicked.connect(lambda *_: self.start_or_cancel())
        self.tries.wider.clicked.connect(self.search_farther)
        self.tries.turn.clicked.connect(self.allow_rotation)
        self.tries.bands.clicked.connect(self.choose_bands)
        self.report.clicked.connect(self.open_report)
        self.pair.currentIndexChanged.connect(self._show_options)
        # Delayed: while layers are being removed from the project, some are already deleted.
        self._apart = QTimer(self)
        self._apart.setSingleShot(True)
        self._apart.timeout.connect(self._keep_apart)
        self._changed = self.reference
        for box in (self.reference, self.input):
            box.layerChanged.connect(lambda _, box=box: self._note_change(box))
        self._show_options()

    def _lay_out(self) -> None:
        form = QFormLayout()
        form.addRow(tr("Reference"), self.reference)
        form.addRow(tr("Input"), self.input)
        form.addRow(tr("Images"), self.pair)
        options = QHBoxLayout()
        options.addWidget(self.radius)
        options.addWidget(self.rotated)
        form.addRow(tr("Search"), options)
        ground = QFormLayout(self.heights)
        ground.setContentsMargins(0, 0, 0, 0)
        ground.addRow(tr("Terrain model"), self.dem)
        ground.addRow(tr("Heights above"), self.datum)
        layout = QVBoxLayout(self)
        layout.addLayout(form)
        layout.addWidget(self.heights)
        layout.addWidget(self.bands)
        for widget in (self.register, self.progress, self.verdict, self.tries, self.report):
            layout.addWidget(widget)
        layout.addStretch()

    def propose(self) -> None:
        """Fill boxes that hold the same layer, or none, with two rasters of the project."""
        if self._chose_map and self._from_map():
            return
        if self.reference.currentLayer() not in (None, self.input.currentLayer()):
            return
        reference, input = proposed_pair(raster_files())
        if reference is not None and input is not None:
            self.reference.setLayer(reference)
            self.input.setLayer(input)

    def _note_choice(self, _: int) -> None:
        self._chose_map = self._from_map()

    def _note_change(self, box: Any) -> None:
        self._changed = box
        self._apart.start(0)

    def _keep_apart(self) -> None:
        """If both boxes hold the same layer, give another to the box that was not changed."""
        self._show_options()
        changed = self._changed
        other = self.input if changed is self.reference else self.reference
        if changed.currentLayer() is None or changed.currentLayer() != other.currentLayer():
            return
        rest = [layer for layer in raster_files() if layer != changed.currentLayer()]
        other.setLayer(rest[0] if rest else None)

    def _show_options(self) -> None:
        sensor = has_rpcs(self.input.currentLayer())
        self.heights.setVisible(sensor)
        self.pair.setEnabled(not sensor)
        self.bands.take(self.reference.currentLayer(), self.input.currentLayer())
        asked = sensor or self.pair.currentData() != "register"
        for widget in (self.radius, self.rotated):
            widget.setEnabled(asked)
            widget.setToolTip("" if asked else tr("Choose what the images are to set the search."))
        self.rotated.setEnabled(asked and not sensor)

    def start_or_cancel(self) -> None:
        """Start a registration, or cancel the running one."""
        if self._run is not None:
            self._run.cancel()
            return
        input = self.input.currentLayer()
        if input is None or (self.reference.currentLayer() is None and not self._from_map()):
            self._layers = ()
            self._state(False, tr("Choose two raster layers."))
            return
        self._begin()
        if has_rpcs(input):
            self._start_sensor(input)
            return
        reference, values = with_files(self.reference.currentLayer(), input, self._canvas)
        self._layers = (reference, input)
        names = {"OUTPUT": "registered.tif", "TIE_POINTS": points_name(), "REPORT": "report.html"}
        files = {name: new_file(file) for name, file in names.items()}
        tool = self.pair.currentData()
        values |= self.bands.values()
        if tool != "register":
            values |= self._search_radius()
            values |= {"SEARCH_ROTATION": _ANY_ROTATION_DEG} if self.rotated.isChecked() else {}
        self._run = Run(tool, values, files, ("OUTPUT",), self._end, self._show_progress)
        self._run.start()

    def take_away(self) -> None:
        """Cancel a running registration (for unloading)."""
        if self._run is not None:
            self._run.cancel()

    def _begin(self) -> None:
        self.sensor = None
        self.register.setText(tr("Cancel"))
        self.progress.setValue(0)
        self.progress.show()
        self.verdict.setText("")
        self.tries.offer(())
        self.report.hide()

    def _start_sensor(self, image: Any) -> None:
        """Refine the RPCs of an image against the reference, and orthorectify it."""
        reference = self.reference.currentLayer()
        self._layers = (reference, image)
        if not is_file(reference):
            self._end(Outcome(False, tr("An image with RPCs needs a raster file as reference.")))
            return
        self.sensor = SensorImage(image, self.dem.currentLayer(), self.datum.currentData())
        control = self._control(reference)
        self._run = SensorRun(self.sensor, reference.id(), control, self._end, self._show_progress)
        self._run.start()

    def _control(self, reference: Any) -> dict[str, Any]:
        """Return the source of ground control, which is matched in the reference."""
        return {"REFERENCE": reference.id(), **self._search_radius()}

    def _search_radius(self) -> dict[str, float]:
        return {"SEARCH_RADIUS": self.radius.value()} if self.radius.value() else {}

    def _from_map(self) -> bool:
        return bool(self.reference.currentText() == tr(MAP))

    def _show_progress(self, percent: float) -> None:
        self.progress.setValue(round(percent))

    def _end(self, outcome: Outcome) -> None:
        self._run, self.outcome = None, outcome
        heights = () if self.sensor is None else (self.sensor.dem,)
        layers = (*self._layers, *heights)
        if any(layer is not None and sip.isdeleted(layer) for layer in layers):
            self._layers = ()  # A layer was removed from the project meanwhile.
        self.register.setText(tr("Register"))
        self.progress.hide()
        report = outcome.files.get("REPORT")
        self.report.setVisible(report is not None)
        refused = not outcome.succeeded and report is not None
        self.tries.offer(self._worth_a_try() if refused else ())
        if outcome.succeeded:
            self._state(True, first_lines(outcome.lines))
        else:
            self._state(False, outcome.reason)
        if self._layers:
            self._finished(outcome, *self._layers)

    def _state(self, good: bool, text: str) -> None:
        self.verdict.state(good, text, tuple(layer for layer in self._layers if layer is not None))

    def _worth_a_try(self) -> tuple[QPushButton, ...]:
        """Return the buttons for what may help after a refusal."""
        tries = self.tries
        if self.sensor is not None:
            return (tries.wider,)
        offered = {
            tries.wider: True,
            tries.turn: not self.rotated.isChecked(),
            tries.bands: have_bands(self._layers) and self.bands.isHidden(),
        }
        return tuple(button for button, is_new in offered.items() if is_new)

    def choose_bands(self) -> None:
        """Let the user choose the bands that are matched."""
        self.bands.show()
        self.tries.offer(self._worth_a_try())

    def search_farther(self) -> None:
        """Try again with a radius twice as large."""
        searched_m = self.radius.value()
        if not searched_m and self._layers:
            searched_m = usual_radius_m(self.pair.currentData(), *self._layers)
        if self.sensor is None:
            self._ask_for_a_search()
        self.radius.setValue(math.ceil(2 * searched_m))
        self.start_or_cancel()

    def allow_rotation(self) -> None:
        """Try again with any rotation."""
        self._ask_for_a_search()
        self.rotated.setChecked(True)
        self.start_or_cancel()

    def _ask_for_a_search(self) -> None:
        if self.pair.currentData() == "register":
            self.pair.setCurrentIndex(self.pair.findData("coregister"))

    def open_report(self) -> None:
        """Open the report in the browser."""
        path = None if self.outcome is None else self.outcome.files.get("REPORT")
        if path is not None:
            QDesktopServices.openUrl(QUrl.fromLocalFile(str(path)))


def _raster_box(files: bool = False) -> QgsMapLayerComboBox:
    box = QgsMapLayerComboBox()
    box.setFilters(RASTER_LAYERS)
    if files:
        providers = QgsProviderRegistry.instance().providerList()
        box.setExcludedProviders([name for name in providers if name != "gdal"])
    return box
