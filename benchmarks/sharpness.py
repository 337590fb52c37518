"""How sharply edges coincide: of ground at its place, and of what is drawn over other ground."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from groundtie.context import threads
from groundtie.geometry.models import shift_model
from groundtie.geometry.transform import Transform
from groundtie.matching.locked import LEAST_SHARPNESS, Sameness, find_locked_content
from groundtie.matching.survey import survey_places
from groundtie.rasters.pair import Image, make_pair
from groundtie.rasters.reading import open_raster

from .attacks.cases import AttackCase, all_scenes, cases
from .attacks.catalogue import LOCKED
from .attacks.examples import is_example
from .attacks.pairs import Pair
from .attacks.suite import sample
from .suites import Goal, Settings, SuiteResult, Table, run_cases

_QUICK, _SAMPLE = 4, 60


@dataclass(frozen=True)
class Measured:
    """What two arrays have the same where they lie on one another.

    Parameters
    ----------
    name
        Scene and seed, or attack.
    group
        With which others it is counted.
    is_drawn
        Whether something is drawn over ground that lies elsewhere.
    sameness
        What they have the same.
    """

    name: str
    group: str
    is_drawn: bool
    sameness: Sameness

    def line(self) -> str:
        """Return what was measured as a line of text."""
        return f"{self.name} ({self.group}): {self.sameness.sharpness:.2f}"

    def record(self) -> dict[str, Any]:
        """Return what was measured as values that JSON can carry."""
        return asdict(self)


@dataclass(frozen=True)
class Case:
    """A pair whose arrays are laid on one another."""

    name: str
    group: str
    is_drawn: bool
    make: Callable[[], Pair]

    def run(self, workers: int | None) -> Measured:
        """Make the pair and measure."""
        with tempfile.TemporaryDirectory() as folder:
            self.make().save(Path(folder))
            return Measured(self.name, self.group, self.is_drawn, _sameness(Path(folder), workers))


def _sameness(folder: Path, workers: int | None) -> Sameness:
    with (
        open_raster(folder / "r.tif") as one,
        open_raster(folder / "i.tif") as other,
        threads(workers) as context,
    ):
        pair = make_pair(Image(one), Image(other))
        nowhere = Transform(shift_model(0.0, 0.0), pair.grid.crs, other.grid)
        locked = find_locked_content(pair, nowhere, survey_places(pair.grid), context)
    if locked is None:
        raise ValueError("the arrays do not lie on one another")
    return locked.sameness


def run(settings: Settings) -> SuiteResult:
    """Measure all scenes of the red team at their places, and `--sample` drawn ones."""
    seeds = range(settings.first_seed, settings.first_seed + settings.seeds)
    scenes = [
        Case(f"{name} {seed}", scene.kind, False, partial(scene.pair, seed, settings.cache))
        for name, scene in all_scenes(settings.data).items()
        if not is_example(scene)
        for seed in seeds
    ]
    drawn = [
        case
        for case in cases(seeds, settings.data, settings.cache)
        if isinstance(case, AttackCase) and case.group == LOCKED and case.tool == "coregister"
    ]
    wanted = _QUICK if settings.quick else settings.sample or _SAMPLE
    attacked = [
        Case(case.name, case.attack, True, case.make)
        for case in sample(drawn, wanted)
        if isinstance(case, AttackCase)
    ]
    every: list[Measured] = list(
        run_cases(scenes[:: len(scenes) // _QUICK] if settings.quick else scenes, settings.jobs)
    )
    every += run_cases(attacked, settings.jobs)
    found = [one for one in every if one.is_drawn]
    ground = [one for one in every if not one.is_drawn and not one.sameness.is_explained]
    most = max((one.sameness.sharpness for one in ground), default=0.0)
    return SuiteResult(
        "How sharply edges coincide",
        (
            Goal(
                "Ground at its place, but of one sensor",
                f"below {LEAST_SHARPNESS:g}",
                f"at most {most:.2f}",
                most < LEAST_SHARPNESS,
            ),
        ),
        (_table("Ground at its place", ground), _table("Drawn over other ground", found)),
        [one.record() for one in every],
    )


def _table(title: str, some: list[Measured]) -> Table:
    rows = []
    for group in sorted({one.group for one in some}):
        values = [one.sameness.sharpness for one in some if one.group == group]
        above = sum(value >= LEAST_SHARPNESS for value in values)
        evident = sum(one.sameness.is_evident for one in some if one.group == group)
        low, middle, high = np.percentile(values, [0, 50, 100])
        numbers = f"{low:.2f}", f"{middle:.2f}", f"{high:.2f}", str(above), str(evident)
        rows.append([group, str(len(values)), *numbers])
    columns = ("", "pairs", "least", "median", "most", "at the limit or above", "evident in all")
    return Table(title, columns, rows)
