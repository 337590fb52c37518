"""Runs the steps for an image with RPCs: refinement of the RPCs and orthorectification."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from .run import Outcome, Run, new_file
from .start_files import points_name

# Share of the run time for the refinement.
_FIRST = 0.8


@dataclass(frozen=True)
class SensorImage:
    """An image with RPCs and its terrain model.

    Parameters
    ----------
    layer
        The image's layer.
    dem
        The terrain model's layer; None: one constant height.
    datum
        Vertical datum of the terrain model.
    """

    layer: Any
    dem: Any
    datum: str

    def values(self) -> dict[str, Any]:
        """Return the parameter values that all tools for images with RPCs share."""
        heights = {} if self.dem is None else {"DEM": self.dem.id(), "DEM_DATUM": self.datum}
        return {"IMAGE": self.layer.id(), **heights}


class SensorRun:
    """Refines the RPCs of an image and orthorectifies it to the reference's pixels.

    The outcome's files are `RPC`, `TIE_POINTS` (the ground control), `REPORT` and `OUTPUT` (the
    orthoimage, which is loaded).

    Parameters
    ----------
    image
        The image.
    reference
        Identifier of the reference for an algorithm.
    control
        Values for `refine_rpc` that give the source of ground control and the model.
    done, progress
        As in `Run`.
    """

    def __init__(
        self,
        image: SensorImage,
        reference: str,
        control: dict[str, Any],
        done: Callable[[Outcome], None],
        progress: Callable[[float], None],
    ) -> None:
        # Read now, as layers may be removed from the project meanwhile.
        self._values, self._reference = image.values(), reference
        self._done, self._progress = done, progress
        files = {
            "OUTPUT": new_file("refined_RPC.TXT"),
            "RESIDUALS": new_file(points_name()),
            "REPORT": new_file("refined.html"),
        }
        values = {**self._values, **control}
        self._run = Run("refine_rpc", values, files, (), self._refined, self._first)
        self._lines: tuple[str, ...] = ()

    def start(self) -> None:
        """Start if the values are valid; otherwise the outcome states the error."""
        self._run.start()

    def cancel(self) -> None:
        """Stop at the next step."""
        self._run.cancel()

    def _first(self, percent: float) -> None:
        self._progress(_FIRST * percent)

    def _second(self, percent: float) -> None:
        self._progress(100 * _FIRST + (1 - _FIRST) * percent)

    def _refined(self, outcome: Outcome) -> None:
        if not outcome.succeeded:
            report = {k: path for k, path in outcome.files.items() if k == "REPORT"}
            self._done(replace(outcome, files=report))
            return
        files = outcome.files
        self._lines = outcome.lines
        self._files = {
            "RPC": files["OUTPUT"],
            "TIE_POINTS": files["RESIDUALS"],
            "REPORT": files["REPORT"],
        }
        values = {**self._values, "REFERENCE": self._reference, "RPC": str(files["OUTPUT"])}
        ortho = {"OUTPUT": new_file("orthoimage.tif")}
        self._run = Run("orthorectify", values, ortho, ("OUTPUT",), self._projected, self._second)
        self._run.start()

    def _projected(self, outcome: Outcome) -> None:
        self._done(replace(outcome, lines=self._lines, files={**self._files, **outcome.files}))
