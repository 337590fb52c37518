"""Flat, hilly and mountainous country: wrong heights, and terrain as the reference."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from groundtie.rasters.rendered import RADAR, SUN
from groundtie.simulation.files import NAMES

from .attempt import Outcome, Pair, accepted, attempt
from .simulations import Simulation
from .suites import Goal, Settings, SuiteResult, Table, by_group, none_wrong, run_cases
from .tables import accuracy_table

SIZE_PX = 600
PIXEL_M = 10.0
ERROR_M = 30.0


@dataclass(frozen=True)
class Country:
    """A kind of terrain, and the largest wanted mean error there."""

    relief_m: float
    slope_deg: float | None
    rmse_px: float


COUNTRIES = {
    "flat": Country(20.0, None, 1.0),
    "hilly": Country(300.0, 25.0, 1.2),
    "mountains": Country(1500.0, 45.0, 1.8),
}
# The camera looks as far off nadir as agile satellites do: 30 m of height error displace by 14 m.
VIEWS: dict[str, tuple[tuple[str, float | str], ...]] = {
    "optical": (("input", "optical"), ("off_nadir", 25.0)),
    "SAR": (("input", "sar"), ("off_nadir", 0.0)),
}
# Heights that are used: none, both terrain models, and one where the input's was right. Further
# ways register right inputs by `register` to the terrain model, and to that of another scene.
WITHOUT, WITH, NEEDLESS = "without heights", "with heights", "with needless heights"
LIT, ELSEWHERE = "to the terrain", "to another terrain"
# An input with wrong heights, registered to the right terrain model.
DISPLACED = "to the terrain, without heights"
_TO_TERRAIN = (LIT, ELSEWHERE, DISPLACED)
WAYS = (WITHOUT, WITH, NEEDLESS, *_TO_TERRAIN)
_WRONG_WAYS = (WITHOUT, WITH, DISPLACED)
_LIT_PX = 1.0


@dataclass(frozen=True)
class MountainCase:
    """A scene of one kind of country, with one image made from wrong heights."""

    country: str
    view: str
    way: str
    seed: int
    cache: Path

    def run(self, workers: int | None) -> Outcome:
        """Make the pair if needed, register it and judge the result."""
        pair = self._scene(self.seed)
        of = pair
        if self.way in _TO_TERRAIN:
            of = replace(pair, reference=pair.reference.with_name(NAMES["dem"]))
        if self.way == ELSEWHERE:
            dem = self._scene(self.seed + 1).reference.with_name(NAMES["dem"])
            of = Pair(dem, pair.input)
        return attempt(
            f"{group(self.country, self.view, self.way)}, seed {self.seed}",
            group(self.country, self.view, self.way),
            of,
            workers,
            tool="register" if self.way in _TO_TERRAIN else "coregister",
            **further(pair, self.view, self.way),
        )

    def _scene(self, seed: int) -> Pair:
        return mountain(self.country, self.view, self.way, seed).pair(self.cache)


def further(pair: Pair, view: str, way: str) -> dict[str, Any]:
    """Return the parameters of a pair's registration besides its images."""
    dem = pair.reference.with_name(NAMES["dem"])
    if way == WITHOUT:
        return {}
    if way in _TO_TERRAIN:
        return {"views": f"terrain {RADAR if view == 'SAR' else SUN}"}
    return {"dem": dem, "input_dem": dem.with_name(NAMES["input_dem"]) if way == WITH else None}


def group(country: str, view: str, way: str) -> str:
    """Return the name of a group of cases."""
    return f"{country}, {view} {'wrong' if way in _WRONG_WAYS else 'right'}, {way}"


def mountain(country: str, view: str, way: str, seed: int) -> Simulation:
    """Return a scene of 6 km; the radar looks from alternate sides."""
    terrain = COUNTRIES[country]
    further: tuple[tuple[str, float | str], ...] = (
        ("pixel_size", PIXEL_M),
        ("looks", 4.0),
        ("warp", 2.0),
        ("relief", terrain.relief_m),
        ("terrain_error", ERROR_M if way in _WRONG_WAYS else 0.0),
        ("orbit", "ascending" if seed % 2 else "descending"),
        ("view_azimuth", 100.0 * seed % 360),
        *VIEWS[view],
        *(() if terrain.slope_deg is None else (("slope", terrain.slope_deg),)),
    )
    return Simulation(SIZE_PX, "rural", seed, 4.0, further)


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    kinds = [(c, view, way) for c in COUNTRIES for view in VIEWS for way in WAYS]
    scenes = [(*kind, seed) for kind in kinds for seed in settings.seed_numbers()]
    # In sequence, so that no two processes make the same pair at the same time.
    for scene in scenes:
        mountain(*scene).pair(settings.cache)
    outcomes = run_cases([MountainCase(*scene, settings.cache) for scene in scenes], settings.jobs)
    groups = by_group(outcomes, (group(*kind) for kind in kinds))
    return SuiteResult(
        f"Terrain wrong by {ERROR_M:g} m, or the reference: {SIZE_PX}² px of {PIXEL_M:g} m",
        [goal for kind in kinds for goal in goals(*kind, groups[group(*kind)])],
        (models_table(groups), accuracy_table("By country", groups)),
        [outcome.record() for outcome in outcomes],
        ("The RMSE is the mean of those at check points on open ground, of what was accepted.",),
    )


def goals(country: str, view: str, way: str, outcomes: Sequence[Outcome]) -> tuple[Goal, ...]:
    """Return the goals for one kind of scene, with their results."""
    title = group(country, view, way)
    errors = [outcome.error_px for outcome in accepted(outcomes)]
    mean = float(np.mean(errors)) if errors else float("nan")
    if way == ELSEWHERE or (way == LIT and country == "flat"):
        found = f"{len(errors)} of {len(outcomes)}"
        return (Goal(f"{title}: accepted", "none", found, not errors),)
    largest = _LIT_PX if way == LIT else COUNTRIES[country].rmse_px
    largest = None if way in (WITHOUT, DISPLACED) else largest
    return (
        Goal(
            f"{title}: RMSE",
            "reported" if largest is None else f"below {largest:g} px",
            f"{mean:.2f} px ({len(errors)} of {len(outcomes)} accepted)",
            None if largest is None else mean < largest,
        ),
        none_wrong(f"{title}: silently wrong", outcomes),
    )


def models_table(groups: dict[str, list[Outcome]]) -> Table:
    """Return a table of the models that were chosen, one row for each kind of scene."""
    names = sorted({o.model for outcomes in groups.values() for o in accepted(outcomes)})
    rows = [
        [name, *(str(sum(o.model == model for o in accepted(found))) for model in names)]
        for name, found in groups.items()
    ]
    return Table("Models", ("pairs", *names), rows)
