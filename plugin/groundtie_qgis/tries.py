"""What the dock offers to try after a refusal, and the bands that it registers."""

from __future__ import annotations

from typing import Any

from qgis.gui import QgsRasterBandComboBox
from qgis.PyQt import sip
from qgis.PyQt.QtWidgets import QFormLayout, QGridLayout, QPushButton, QSizePolicy, QWidget

from .translation import mark, tr

_NAMES = (
    mark("Search farther"),
    mark("Allow any rotation"),
    mark("Other bands…"),
)


class Tries(QWidget):
    """Buttons for what may help where a registration was refused."""

    def __init__(self) -> None:
        super().__init__()
        self.wider, self.turn, self.bands = (QPushButton(tr(name), self) for name in _NAMES)
        self._all = (self.wider, self.turn, self.bands)
        self._grid = QGridLayout(self)
        self._grid.setContentsMargins(0, 0, 0, 0)
        self.offer(())

    def offer(self, buttons: tuple[QPushButton, ...]) -> None:
        """Show some of the buttons, two a row; the others are hidden."""
        for button in self._all:
            self._grid.removeWidget(button)
        for place, button in enumerate(buttons):
            self._grid.addWidget(button, place // 2, place % 2)
        for button in self._all:
            button.setVisible(button in buttons)


class BandRows(QWidget):
    """Which band of the reference and of the input is matched; not set: as the tool chooses."""

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
            # The names of bands may be long: they must not make the dock wide.
            box.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Fixed)
            layout.addRow(label, box)
        self.hide()

    def take(self, *layers: Any) -> None:
        """Offer the bands of the reference and of the input; of new layers none is set."""
        for box, layer in zip(self.boxes.values(), layers, strict=True):
            file = layer if is_file(layer) else None
            if box.layer() != file:
                box.setLayer(file)
                box.setBand(-1)

    def values(self) -> dict[str, int]:
        """Return the bands that are set, by parameter."""
        bands = {name: box.currentBand() for name, box in self.boxes.items()}
        return {name: band for name, band in bands.items() if band > 0}


def is_file(layer: Any) -> bool:
    """Return whether a layer of the project is a raster file, whose bands can be chosen."""
    gone = layer is None or sip.isdeleted(layer)
    return not gone and layer.providerType() == "gdal"


def have_bands(layers: tuple[Any, ...]) -> bool:
    """Return whether one of the layers has several bands to choose from."""
    return any(layer.bandCount() > 1 for layer in layers if is_file(layer))
