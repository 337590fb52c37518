"""Writes the image that results from the points edited by the user."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from .library import errors
from .model_list import BIASES
from .reference_export import named
from .run import Outcome, Run, new_file
from .sensor_run import SensorImage, SensorRun
from .start_files import points_name


class Writer:
    """Runs *Warp a raster*, or the steps for an image with RPCs.

    Parameters
    ----------
    done
        Called with the outcome, whose `OUTPUT` is the image.
    """

    def __init__(self, done: Callable[[Outcome], None]) -> None:
        self._done = done
        self.run: Run | SensorRun | None = None
        self.outcome: Outcome | None = None

    def start(
        self, review: Any, fit: Any, reference: Any, input: Any, sensor: SensorImage | None
    ) -> str:
        """Start writing; return the reason if that is not possible, otherwise an empty text.

        Parameters
        ----------
        review, fit
            The points and the model fitted to them.
        reference, input
            The layers.
        sensor
            The image with RPCs that is written in place of the input; None: write the input.
        """
        points = new_file(points_name())
        try:
            objection = "" if sensor else review.objection(fit.kind)
            if objection:
                return str(objection)
            review.write(points, fit.transform)
        except errors.GroundTieError as error:
            return str(error.one_line())
        if sensor is not None:
            control = {"GCPS": str(points), "MODEL": BIASES[fit.kind]}
            self.run = SensorRun(sensor, named(reference), control, self._end, lambda _: None)
        else:
            values = {
                "INPUT": named(input),
                "REFERENCE": named(reference),
                "TRANSFORM": str(points),
                "MODEL": fit.kind,
            }
            files = {"OUTPUT": new_file("registered_by_hand.tif")}
            self.run = Run("warp", values, files, ("OUTPUT",), self._end, lambda _: None)
        self.run.start()
        return ""

    def _end(self, outcome: Outcome) -> None:
        self.run, self.outcome = None, outcome
        self._done(outcome)
