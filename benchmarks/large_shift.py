"""Large initial errors: found or refused, never silently wrong."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .accuracy import CORRECT, REFUSED
from .attempt import Outcome, attempt, count
from .cases import SAR_OPTICAL, RealCase, image_size, read_cases
from .real import ShiftedCase
from .simulations import Simulation
from .suites import Case, Goal, Settings, SuiteResult, by_group, run_cases
from .tables import accuracy_table

REAL_SHIFT_PX = 75.0
REAL_SHIFTS = 3
SIMULATED_SHIFT_PX = 500.0
SIMULATED_SIZE_PX = 4000
SIMULATED_SEEDS = 2

# Common ground of real pairs, on both axes, that must remain at the largest shift, so that there
# is something to match.
_COMMON_PX = 300

_SIMULATED = "simulated"


@dataclass(frozen=True)
class FarSimulation:
    """A simulated pair with a large initial error."""

    simulation: Simulation
    cache: Path

    def run(self, workers: int | None) -> Outcome:
        """Make the pair if needed, register it and judge the result."""
        pair = self.simulation.pair(self.cache)
        radius = math.ceil(self.simulation.shift) + 10.0  # and the simulated warp
        return attempt(self.simulation.name, _SIMULATED, pair, workers, search_radius=radius)


def common_px(case: RealCase) -> float:
    """Return the smaller side of the ground that both images show, in reference pixels."""
    columns, rows = image_size(case.input)
    linear, offset = case.matrix[:, :2], case.matrix[:, 2]
    corners = np.array([[0, 0], [columns, 0], [0, rows], [columns, rows]]) - 0.5
    seen = (corners - offset) @ np.linalg.inv(linear).T
    size = np.array(image_size(case.reference))
    low, high = (np.clip(end, -0.5, size - 0.5) for end in (seen.min(axis=0), seen.max(axis=0)))
    return float((high - low).min())


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    real = [
        case
        for case in read_cases(settings.data)
        if case.kind == SAR_OPTICAL and common_px(case) - REAL_SHIFT_PX >= _COMMON_PX
    ]
    cases: list[Case] = [
        ShiftedCase(case, number, REAL_SHIFT_PX) for case in real for number in range(REAL_SHIFTS)
    ]
    cases += [
        FarSimulation(
            Simulation(SIMULATED_SIZE_PX, density, seed, SIMULATED_SHIFT_PX), settings.cache
        )
        for density in ("rural", "suburban")
        for seed in range(1, SIMULATED_SEEDS + 1)
    ]
    if settings.quick:
        small = Simulation(SIMULATED_SIZE_PX // 4, "rural", 1, SIMULATED_SHIFT_PX / 4)
        cases = [*cases[: 2 * REAL_SHIFTS : REAL_SHIFTS], FarSimulation(small, settings.cache)]
    outcomes = run_cases(cases, settings.jobs)
    groups = by_group(outcomes, (SAR_OPTICAL, _SIMULATED))
    return SuiteResult(
        "Large initial errors",
        [goal for group, members in groups.items() for goal in goals(group, members)],
        (accuracy_table("By kind", groups),),
        [outcome.record() for outcome in outcomes],
        (
            f"Real pairs: components of the shift within ± {REAL_SHIFT_PX:g} px. Simulated pairs: "
            f"a shift of {SIMULATED_SHIFT_PX:g} px in a drawn direction.",
        ),
    )


def goals(group: str, outcomes: Sequence[Outcome]) -> tuple[Goal, ...]:
    """Return the goals for one group, with their results."""
    found, refused = count(outcomes, CORRECT), count(outcomes, REFUSED)
    right = found + refused
    return (
        Goal(
            f"{group}: found or refused",
            "all",
            f"{right} of {len(outcomes)} ({found} found, {refused} refused)",
            right == len(outcomes),
        ),
    )
