"""The models that the plugin ships: chains of tools to run or to base own models on."""

from __future__ import annotations

from pathlib import Path

from qgis.core import QgsProcessingModelAlgorithm
from qgis.PyQt.QtGui import QIcon

from .library import FOLDER
from .pages import help_url
from .styling import icon_of
from .translation import tr

MODELS = FOLDER / "models"


class ShippedModel(QgsProcessingModelAlgorithm):
    """A model from a file; its tools are looked up only when a copy is made for a run.

    QGIS has one text for a model's name and title, so the title is kept in its help.
    """

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._path = path
        self.fromFile(str(path))

    def createInstance(self) -> ShippedModel:
        return ShippedModel(self._path)

    def displayName(self) -> str:
        return tr(str(self.helpContent()["TITLE"]))

    def group(self) -> str:
        return tr(super().group())

    def shortDescription(self) -> str:
        return tr(super().shortDescription())

    def helpUrl(self) -> str:
        return help_url("models")

    def icon(self) -> QIcon:
        return QIcon(self.svgIconPath())

    def svgIconPath(self) -> str:
        return str(icon_of("models"))


def load_models() -> list[ShippedModel]:
    """Return all shipped models."""
    return [ShippedModel(path) for path in sorted(MODELS.glob("*.model3"))]
