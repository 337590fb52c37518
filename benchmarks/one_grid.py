"""Real pairs on one grid, as most products have: aligned, and displaced by known shifts."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .accuracy import FloatArray
from .attempt import Outcome, attempt
from .cases import read_cases, search_radius_m
from .offsets import Scene, write_offset
from .real import by_kind
from .suites import Settings, SuiteResult, none_wrong, run_cases
from .tables import accuracy_table

_LARGEST_PX = 20.0

# The images have 141 rows in common; 144 are needed.
_TOO_SMALL = "oo-lake-bands"

# Displacements (col, row) derived from a drawn shift.
PLACES: dict[str, Callable[[FloatArray], FloatArray]] = {
    "where they belong": np.zeros_like,
    "off by whole pixels": np.rint,
    "off by fractions": np.copy,
}


@dataclass(frozen=True)
class OneGridCase:
    """A real pair with the input resampled onto the reference's grid, displaced by a shift."""

    scene: Scene
    place: str

    @property
    def shift_px(self) -> FloatArray:
        """Displacement of the input, (col, row)."""
        return PLACES[self.place](self.scene.offset_px((_LARGEST_PX / 2, _LARGEST_PX)))

    def run(self, workers: int | None) -> Outcome:
        """Write the pair, register it and judge the result."""
        with tempfile.TemporaryDirectory() as folder:
            return attempt(
                f"{self.scene.name}, {self.place}",
                self.scene.group,
                write_offset(self.scene.pair(Path(folder)), self.shift_px, Path(folder)),
                workers,
                search_radius=search_radius_m(_LARGEST_PX),
            )


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    real = [case for case in read_cases(settings.data) if case.name != _TOO_SMALL]
    scenes = [Scene(case, settings.cache) for case in real]
    if settings.quick:
        scenes = list({scene.group: scene for scene in scenes}.values())
    cases = [OneGridCase(scene, place) for place in PLACES for scene in scenes]
    outcomes = run_cases(cases, settings.jobs)
    by_place = {
        place: [o for case, o in zip(cases, outcomes, strict=True) if case.place == place]
        for place in PLACES
    }
    by_pair = {
        scene.name: [o for case, o in zip(cases, outcomes, strict=True) if case.scene is scene]
        for scene in scenes
    }
    return SuiteResult(
        "Real pairs on one grid",
        (none_wrong("Pairs on one grid silently wrong", outcomes),),
        (
            accuracy_table("By place", by_place),
            accuracy_table("By kind", by_kind(outcomes)),
            accuracy_table("By pair", by_pair),
        ),
        [outcome.record() for outcome in outcomes],
    )
