"""One registration by a tool's public function, judged and timed."""

from __future__ import annotations

import math
import tempfile
import time
import traceback
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

import groundtie
from groundtie.errors import NotRegisteredError
from groundtie.geometry.transform import Transform
from groundtie.kinds import plain
from groundtie.rasters.grid import PointFunction
from groundtie.rasters.reading import open_raster
from groundtie.registration.specification import Specification

from .accuracy import CRASHED, REFUSED, FloatArray, Truth, classify
from .pipeline_runs import register_specified


@dataclass(frozen=True)
class Pair:
    """Two georeferenced images and their truth.

    Parameters
    ----------
    reference, input
        The files.
    truth
        The best known truth: check points where there are some, else the lattice. None: the images
        show different places, so that every registration is wrong.
    lattice
        The truth over the whole reference; equal to `truth` where there are no check points.
    sigma_px
        Uncertainty of the truth, in reference pixels.
    """

    reference: Path
    input: Path
    truth: Truth | None = None
    lattice: Truth | None = None
    sigma_px: float = 0.0


@dataclass(frozen=True)
class Outcome:
    """The outcome of one registration.

    Parameters
    ----------
    name, group
        The case, and the group it is counted in.
    verdict, lattice_verdict
        One of `accuracy.VERDICTS`, by `error_px` and `lattice_error_px`.
    error_px, lattice_error_px
        Errors against `Pair.truth` and `Pair.lattice`; NaN for refused registrations.
    sigma_px
        Uncertainty of the truth.
    seconds
        Wall-clock time of the call.
    claimed_rmse_px
        The tool's own estimate of the error.
    model, reason
        The model that the tool chose, and its message.
    claimed_ce90_px
        Radius within which the tool expects 90 % of the errors.
    """

    name: str
    group: str
    verdict: str
    lattice_verdict: str
    error_px: float
    lattice_error_px: float
    sigma_px: float
    seconds: float
    claimed_rmse_px: float
    model: str
    reason: str
    claimed_ce90_px: float = math.nan

    def record(self) -> dict[str, Any]:
        """Return the outcome as values that JSON can carry."""
        return plain(asdict(self))

    def line(self) -> str:
        """Return the outcome as a line of text."""
        error = "" if not self.model else f" {self.error_px:.2f} px ({self.model})"
        return f"{self.name}: {self.verdict}{error} in {self.seconds:.1f} s; {self.reason}"


@dataclass(frozen=True)
class Try:
    """The result of a tool's call before it is judged.

    Parameters
    ----------
    result
        The tool's result; None if there is nothing to judge.
    verdict, reason
        Without a result, `REFUSED` or `CRASHED` and the message; else empty.
    seconds
        Wall-clock time of the call.
    """

    result: Any
    verdict: str
    reason: str
    seconds: float

    def unregistered(self, name: str, group: str, sigma_px: float) -> Outcome:
        """Return the outcome of a call without a result."""
        verdict, nan = self.verdict, math.nan
        return Outcome(
            name, group, verdict, verdict, nan, nan, sigma_px, self.seconds, nan, "", self.reason
        )


def tried(call: Callable[[], Any]) -> Try:
    """Call a tool, which may refuse or crash."""
    started = time.perf_counter()
    result, verdict, reason = None, "", ""
    try:
        result = call()
    except NotRegisteredError as refusal:
        verdict = REFUSED
        reason = str(refusal) if refusal.verdict is None else refusal.verdict.reason
    except Exception as error:
        # A crash is a finding, too: it is counted, and `run.py` exits with 1.
        traceback.print_exc()
        verdict, reason = CRASHED, repr(error)
    return Try(result, verdict, reason, time.perf_counter() - started)


def attempt(
    name: str,
    group: str,
    pair: Pair,
    workers: int | None = None,
    *,
    tool: str = "coregister",
    spec: Specification | None = None,
    **parameters: Any,
) -> Outcome:
    """Register a pair by a tool, with its `parameters`, and compare the result with the truth.

    A specification, if given, decides how the pair is registered, whatever the tool.
    """
    with tempfile.TemporaryDirectory() as folder:
        files = pair.reference, pair.input, Path(folder) / "registered.tif"

        def call() -> Any:
            if spec is not None:
                return register_specified(spec, *files, workers=workers)
            return getattr(groundtie, tool)(*files, workers=workers, **parameters)

        one = tried(call)
    if one.result is None:
        return one.unregistered(name, group, pair.sigma_px)
    result = one.result
    found = on_pixels(result.transform, pair.reference)
    errors = [
        math.inf if truth is None else truth.error_px(found) for truth in (pair.truth, pair.lattice)
    ]
    return Outcome(
        name,
        group,
        classify(True, errors[0], pair.sigma_px),
        classify(True, errors[1], pair.sigma_px),
        errors[0],
        errors[1],
        pair.sigma_px,
        one.seconds,
        result.verdict.check_rmse_px,
        result.transform.model.kind,
        result.verdict.reason,
        result.verdict.accuracy.ce90_px,
    )


def on_pixels(transform: Transform, reference: Path) -> PointFunction:
    """Return the function from reference pixels to input pixels of a transform."""
    with open_raster(reference) as source:
        grid = source.grid

    def mapping(px: FloatArray) -> FloatArray:
        return transform(grid.pixel_to_map(px))

    return mapping


def accepted(outcomes: Iterable[Outcome]) -> list[Outcome]:
    """Return the outcomes of the registrations that the tool accepted."""
    return [outcome for outcome in outcomes if outcome.verdict not in (REFUSED, CRASHED)]


def median_px(outcomes: Sequence[Outcome]) -> float:
    """Return the median error of the accepted registrations; NaN if there are none."""
    errors = [outcome.error_px for outcome in accepted(outcomes)]
    return float(np.median(errors)) if errors else float("nan")


def count(outcomes: Iterable[Outcome], verdict: str, on_lattice: bool = False) -> int:
    """Return the number of outcomes with a verdict, by the error against one truth or the other."""
    return sum((o.lattice_verdict if on_lattice else o.verdict) == verdict for o in outcomes)
