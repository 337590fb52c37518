"""A simulated dense city: whether layover biases a registration against the ground."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from groundtie.registration.specification import COREGISTER, Specification

from .accuracy import REFUSED, SILENTLY_WRONG
from .attempt import Outcome, accepted, attempt, count, median_px
from .simulations import Simulation
from .suites import Goal, Settings, SuiteResult, Table, by_group, none_wrong, run_cases
from .tables import accuracy_table

SIZE_PX = 1000
CHANGED_PERCENT = 10.0
WITHIN_PX = 1.0


@dataclass(frozen=True)
class Setting:
    """Settings for the registration of cities, and the wanted accuracy.

    Parameters
    ----------
    spec
        As in `coregister`, except for the similarity.
    median_px
        Largest wanted median error on the ground; None: reported only.
    share_within
        Smallest wanted share of seeds within `WITHIN_PX`; None: reported only.
    """

    spec: Specification = COREGISTER
    median_px: float | None = None
    share_within: float | None = None


SETTINGS: dict[str, Setting] = {
    "NMI": Setting(replace(COREGISTER, similarity="nmi")),
    "orientation": Setting(replace(COREGISTER, similarity="orientation")),
    "fused": Setting(median_px=1.0, share_within=0.8),
}


@dataclass(frozen=True)
class CityCase:
    """A city, registered with one of the settings."""

    seed: int
    setting: str
    cache: Path

    def run(self, workers: int | None) -> Outcome:
        """Make the pair if needed, register it and judge the result."""
        pair = city(self.seed).pair(self.cache)
        spec = SETTINGS[self.setting].spec
        return attempt(f"city, seed {self.seed}", self.setting, pair, workers, spec=spec)


def city(seed: int, changed_percent: float = CHANGED_PERCENT) -> Simulation:
    """Return the city of a seed, which also sets the views: 35–47° radar, 5–25° camera."""
    generator = np.random.default_rng((35, 47, seed))
    further = (
        ("changed", changed_percent),
        ("looks", float(generator.choice([1, 2, 4]))),
        ("incidence", round(generator.uniform(35, 47), 1)),
        ("orbit", str(generator.choice(["ascending", "descending"]))),
        ("off_nadir", round(generator.uniform(5, 25), 1)),
        ("view_azimuth", round(generator.uniform(0, 360), 1)),
    )
    return Simulation(SIZE_PX, "city", seed, further=further)


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    seeds = settings.seed_numbers()
    # Seed by seed, so that no two processes make the same pair at the same time.
    for seed in seeds:
        city(seed).pair(settings.cache)
    cases = [CityCase(seed, setting, settings.cache) for seed in seeds for setting in SETTINGS]
    outcomes = run_cases(cases, settings.jobs)
    groups = by_group(outcomes, SETTINGS)
    return SuiteResult(
        f"Simulated dense city, {SIZE_PX}×{SIZE_PX} px",
        [goal for name, group in groups.items() for goal in goals(name, group)],
        (ground_table(groups), accuracy_table("By setting", groups)),
        [outcome.record() for outcome in outcomes],
        ("The error is that at check points on open ground; roofs are elsewhere in both images.",),
    )


def goals(name: str, outcomes: Sequence[Outcome]) -> tuple[Goal, ...]:
    """Return the goals of one setting, with their results."""
    setting, median, share = SETTINGS[name], median_px(outcomes), share_within(outcomes)
    wanted, at_least = setting.median_px, setting.share_within
    return (
        Goal(
            f"{name}: median error on the ground",
            "reported" if wanted is None else f"at most {wanted:g} px",
            f"{median:.2f} px",
            None if wanted is None else median <= wanted,
        ),
        Goal(
            f"{name}: within {WITHIN_PX:g} px",
            "reported" if at_least is None else f"at least {at_least:.0%}",
            f"{share:.0%}",
            None if at_least is None else share >= at_least,
        ),
        none_wrong(f"{name}: silently wrong", outcomes),
    )


def ground_table(groups: Mapping[str, Sequence[Outcome]]) -> Table:
    """Return a table of the errors on the ground, one row for each setting."""
    head = ("setting", "median error (px)", "within 1 px", "refused", "silently wrong", "seeds")
    rows = [
        [
            name,
            f"{median_px(group):.2f}",
            f"{share_within(group):.0%}",
            str(count(group, REFUSED)),
            str(count(group, SILENTLY_WRONG)),
            str(len(group)),
        ]
        for name, group in groups.items()
    ]
    return Table("On the ground", head, rows)


def share_within(outcomes: Sequence[Outcome]) -> float:
    """Return the share of all cases, also refused ones, that are accepted within `WITHIN_PX`."""
    return sum(o.error_px <= WITHIN_PX for o in accepted(outcomes)) / len(outcomes)
