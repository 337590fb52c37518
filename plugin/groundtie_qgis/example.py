"""Simulates an example SAR–optical pair and loads it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from qgis.core import QgsProject

from .compat import WARNING
from .run import Outcome, Run, new_file

# As in README: registers in seconds, and its misregistration is visible.
_VALUES = {"SIZE": 500, "DENSITY": "rural", "LOOKS": 4, "SEED": 1}


class Example:
    """Simulates a pair in the background.

    Parameters
    ----------
    iface
        The desktop.
    loaded
        Called when the images have been added to the project.
    """

    def __init__(self, iface: Any, loaded: Callable[[], None]) -> None:
        self._iface, self._loaded = iface, loaded
        self._run: Run | None = None

    def make(self) -> None:
        """Start the simulation, unless one is already running."""
        if self._run is None:
            values = {"FOLDER": str(new_file("example")), **_VALUES}
            self._run = Run("simulate", values, {}, (), self._end, lambda _: None)
            self._run.start()

    def _end(self, outcome: Outcome) -> None:
        self._run = None
        if not outcome.succeeded:
            self._iface.messageBar().pushMessage("GroundTie", outcome.reason, WARNING, 0)
            return
        layers = list(QgsProject.instance().mapLayers().values())
        canvas = self._iface.mapCanvas()
        if len(layers) == 2:  # the project was empty before
            canvas.setDestinationCrs(layers[0].crs())
            canvas.setExtent(layers[0].extent())
            canvas.refresh()
        self._loaded()
