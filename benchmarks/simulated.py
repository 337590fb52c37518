"""Simulated pairs of 1000×1000 px, many seeds each: densities, rebuilt towns, opposite orbits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from .accuracy import CORRECT
from .attempt import Outcome, attempt, count, median_px
from .city import city
from .sar_pairs import SarPair
from .simulations import Simulation
from .suites import Case, Goal, Settings, SuiteResult, by_group, none_wrong, run_cases
from .tables import accuracy_table

SIZE_PX = 1000

_WANTED_CORRECT = 0.95

# Largest wanted median error on the ground; dense urban scenes are reported only.
_MEDIAN_ERROR_PX = {"rural": 0.3, "suburban": 0.7, "urban": None}

# Shares of the buildings that stand in only one image, in percent.
REBUILT_PERCENT = (10.0, 20.0, 30.0)

# Two radar images of one dense city, from an ascending and a descending orbit: only the ground
# is alike in them.
OPPOSITE = "city, opposite orbits"
_OPPOSITE_PX, _MOST_LOOKS = 800, 4


@dataclass(frozen=True)
class SimulatedCase:
    """A simulated pair, registered with default parameters."""

    simulation: Simulation | SarPair
    group: str
    cache: Path

    def run(self, workers: int | None) -> Outcome:
        """Make the pair if needed, register it and judge the result."""
        pair, simulation = self.simulation.pair(self.cache), self.simulation
        tool = "match_sar_sar" if isinstance(simulation, SarPair) else "coregister"
        return attempt(simulation.name, self.group, pair, workers, tool=tool)


def rebuilt(density: str, percent: float) -> str:
    """Return the name of the pairs in which a share of the buildings was rebuilt."""
    return f"{density}, {percent:g} % rebuilt"


def changes(seeds: range, cache: Path) -> list[Case]:
    """Return pairs with changes between the images, or with opposite viewing directions."""
    cases: list[Case] = []
    for seed in seeds:
        for percent in REBUILT_PERCENT:
            town = Simulation(SIZE_PX, "suburban", seed, further=(("changed", percent),))
            cases.append(SimulatedCase(town, rebuilt("suburban", percent), cache))
            cases.append(SimulatedCase(city(seed, percent), rebuilt("city", percent), cache))
        opposite = SarPair(_OPPOSITE_PX, "city", seed, 1 + seed % _MOST_LOOKS, opposite=True)
        cases.append(SimulatedCase(opposite, OPPOSITE, cache))
    return cases


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    seeds = settings.seed_numbers()
    cases: list[Case] = [
        SimulatedCase(Simulation(SIZE_PX, density, seed), density, settings.cache)
        for density in _MEDIAN_ERROR_PX
        for seed in seeds
    ]
    outcomes = run_cases(cases + changes(seeds, settings.cache), settings.jobs)
    groups = by_group(outcomes)
    return SuiteResult(
        f"Simulated pairs, {SIZE_PX}×{SIZE_PX} px",
        [goal for name, group in groups.items() for goal in goals(name, group)],
        (accuracy_table("By density", groups),),
        [outcome.record() for outcome in outcomes],
        ("The error is that at check points on open ground; the lattice covers the whole scene.",),
    )


def goals(name: str, outcomes: Sequence[Outcome]) -> tuple[Goal, ...]:
    """Return the goals for one density or one kind of change, with their results."""
    correct, median = count(outcomes, CORRECT), median_px(outcomes)
    largest = _MEDIAN_ERROR_PX.get(name)
    title = name.capitalize()
    share = f"{correct} of {len(outcomes)} ({correct / len(outcomes):.0%})"
    return (
        Goal(
            f"{title}: correct",
            "reported" if largest is None else f"at least {_WANTED_CORRECT:.0%}",
            share,
            None if largest is None else correct >= _WANTED_CORRECT * len(outcomes),
        ),
        Goal(
            f"{title}: median error of what was accepted",
            "reported" if largest is None else f"at most {largest:g} px",
            f"{median:.2f} px",
            None if largest is None else median <= largest,
        ),
        none_wrong(f"{title}: silently wrong", outcomes),
    )
