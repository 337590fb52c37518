"""Whether double bounce makes a rendered surface model more similar to the radar image.

A wall that faces the radar and the ground before it reflect twice, which gives a bright line at the
foot of the wall. The suite adds this line with several weights, one of them the product's.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from groundtie.context import threads
from groundtie.geometry.views import View
from groundtie.kinds import plain
from groundtie.masks.object_heights import RasterModel
from groundtie.masks.scene import Scene
from groundtie.masks.surface_model import DOUBLE_BOUNCE, SurfaceGround, write_image
from groundtie.rasters.atomic import scratch_folder
from groundtie.rasters.pair import Image
from groundtie.rasters.reading import open_raster
from groundtie.registration.opening import pair_images
from groundtie.registration.pipeline import run as run_pipeline
from groundtie.registration.specification import BOTH, COREGISTER
from groundtie.simulation import files

from .accuracy import SILENTLY_WRONG_PX
from .attempt import on_pixels
from .suites import Goal, Settings, SuiteResult, Table, run_cases
from .towns import rough, seen_by_radar, to_model

# Echoes added per pixel of the wall's height; 0: no double bounce.
WEIGHTS = (0.0, 1.0, DOUBLE_BOUNCE, 10.0)


@dataclass(frozen=True)
class Bounce:
    """The result of one weight on one city.

    Parameters
    ----------
    name, weight
        The city, and one of `WEIGHTS`.
    is_accepted, reason
        The verdict on the registration of the radar image to the rendered model.
    error_px
        Error of the transform, whatever the verdict, in pixels of the model.
    correlation
        Correlation of the registered radar image with the rendered model; NaN: no transform.
    """

    name: str
    weight: float
    is_accepted: bool
    reason: str
    error_px: float
    correlation: float

    def record(self) -> dict[str, Any]:
        """Return the result as values that JSON can carry."""
        return plain(asdict(self))

    def line(self) -> str:
        """Return the result as a line of text."""
        found = f"{self.error_px:.2f} px, correlation {self.correlation:.3f}"
        return f"{self.name}, weight {self.weight:g}: {found}; {self.reason}"


@dataclass(frozen=True)
class BounceCase:
    """A radar image of a city, registered to its rough surface model, rendered with one weight."""

    seed: int
    weight: float
    cache: Path

    def run(self, workers: int | None) -> Bounce:
        """Render the model and register the radar image to it, as the product does."""
        pair = seen_by_radar(self.seed).pair(self.cache)
        view = View.of(pair.input, None)
        assert view is not None
        model = rough(pair.reference.parent / files.NAMES["dsm"], is_reference=True)
        spec = replace(COREGISTER, surface_view=view, radar=BOTH)
        with threads(workers) as context, ExitStack() as stack:
            rendered = stack.enter_context(scratch_folder()) / "rendered.tif"
            write_rendered(model, view, self.weight, rendered)
            images = [Image(stack.enter_context(open_raster(p))) for p in (rendered, pair.input)]
            started = time.perf_counter()
            opened = pair_images(*images, spec, context, (None, None), stack, started)
            found = run_pipeline(opened, spec, context)
        truth, error_px, correlation = to_model(pair, model).truth, math.inf, math.nan
        if found.transform is not None and truth is not None:
            error_px = truth.error_px(on_pixels(found.transform, model))
        if found.evidence is not None and found.evidence.input_fit is not None:
            correlation = found.evidence.input_fit.correlation
        verdict = found.verdict
        return Bounce(
            f"city, seed {self.seed}",
            self.weight,
            verdict.accepted,
            verdict.reason,
            error_px,
            correlation,
        )


def write_rendered(model: Path, view: View, weight: float, path: Path) -> None:
    """Render a surface model with a weight, otherwise as the product does."""
    with open_raster(model) as source:
        ground = SurfaceGround(Scene.of(source), RasterModel(source), (view,))
        write_image(ground, view, path, bounce=weight)


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    numbers = settings.seed_numbers()
    for seed in numbers:
        seen_by_radar(seed).pair(settings.cache)
    cases = [BounceCase(seed, weight, settings.cache) for seed in numbers for weight in WEIGHTS]
    found: list[Bounce] = list(run_cases(cases, settings.jobs))  # type: ignore[arg-type]
    wrong = sum(one.is_accepted and one.error_px > SILENTLY_WRONG_PX for one in found)
    return SuiteResult(
        "Double bounce in what is rendered of rough surface models of dense cities",
        (Goal("silently wrong", "none", f"{wrong} of {len(found)}", wrong == 0),),
        (weights_table(found),),
        [one.record() for one in found],
        (f"The product has {DOUBLE_BOUNCE:g}. Errors are in pixels of the rough model.",),
    )


def weights_table(found: Sequence[Bounce]) -> Table:
    """Return a table of the results of each weight."""
    rows = []
    for weight in WEIGHTS:
        of_weight = [one for one in found if one.weight == weight]
        errors = [one.error_px for one in of_weight if one.is_accepted]
        correlation = np.nanmean([one.correlation for one in of_weight])
        median = float(np.median(errors)) if errors else math.nan
        counts = f"{len(errors)} of {len(of_weight)}"
        rows.append([f"{weight:g}", f"{correlation:.3f}", counts, f"{median:.2f}"])
    head = ("weight", "correlation, mean", "accepted", "median error (px)")
    return Table("By weight", head, rows)
