"""Remedies that the dock offers after a refusal, and the choice of bands."""

from __future__ import annotations

from typing import Any

from qgis.gui import QgsRasterBandComboBox
from qgis.PyQt.QtWidgets import QFormLayout, QGridLayout, QPushButton, QSizePolicy, QWidget

from .start_files import is_file
from .translation import mark, tr

_NAMES = (
    mark("Search farther"),
    mark("Allow any rotation"),
    mark("Other bands…"),
)


class Tries(QWidget):
    """Buttons for remedies after a refused registration."""

    def __init__(self) -> None:
        super().__init__()
        self.wider, self.turn, self.bands = (QPushButton(tr(name), self) for name in _NAMES)
        self._all = (self.wider, self.turn, self.bands)
        self._grid = QGridLayout(self)
        self._grid.setContentsMargins(0, 0, 0, 0)
        self.offer(())

    def offer(self, buttons: tuple[QPushButton, ...]) -> None:
        """Show the given buttons, two per row, and hide the others."""
        for button in self._all:
            self._grid.removeWidget(button)
        for place, button in enumerate(buttons):
            self._grid.addWidget(button, place // 2, place % 2)
        for button in self._all:
            button.setVisible(button in buttons)


class BandRows(QWidget):
    """Choice of the bands of reference and input to match; not set: the tool chooses."""

    def __init__(self) -> None:
        super().__init__()
        self.boxes = {
            "REFERENCE_BAND": QgsRasterBandComboBox(),
            "INPUT_BAND": QgsRasterBandComboBox(),
        }
        layout = QFormLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        labels = tr("Band of the reference"), tr("Band of the input")
        for label, box in zip(labels, self.boxes.values(), strict=True):
            box.setShowNotSetOption(True, tr("usual"))
            # Long names of bands must not widen the dock.
            box.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
            layout.addRow(label, box)
        self.hide()

    def take(self, *layers: Any) -> None:
        """Offer the bands of the reference and of the input; new layers start with none set."""
        for box, layer in zip(self.boxes.values(), layers, strict=True):
            file = layer if is_file(layer) else None
            if box.layer() != file:
                box.setLayer(file)
                box.setBand(-1)

    def values(self) -> dict[str, int]:
        """Return the chosen bands, by parameter."""
        bands = {name: box.currentBand() for name, box in self.boxes.items()}
        return {name: band for name, band in bands.items() if band > 0}


def have_bands(layers: tuple[Any, ...]) -> bool:
    """Return whether one of the layers has several bands to choose from."""
    return any(layer.bandCount() > 1 for layer in layers if is_file(layer))
