"""How much results depend on constants: registrations with about half and twice their values.

A constant whose comment names no other source is listed here. Runs of one constant differ in
nothing else.
"""

from __future__ import annotations

import importlib
import math
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .accuracy import CORRECT
from .attempt import Outcome, count
from .cases import SAR_OPTICAL, read_cases
from .real import ShiftedCase
from .simulated import SimulatedCase
from .simulations import Simulation
from .suites import Settings, SuiteResult, Table, by_group, none_wrong, run_cases

USUAL = "as it is"

# One of so many real pairs, and the simulated ones.
_EVERY, _SIZE_PX, _DENSITIES = 5, 500, ("rural", "suburban")


@dataclass(frozen=True)
class Constant:
    """A constant of a module of the package, and values around it.

    Parameters
    ----------
    module, name
        The module below `groundtie`, and the constant's name in it.
    low, high
        Values on either side.
    """

    module: str
    name: str
    low: Any
    high: Any

    @property
    def value(self) -> Any:
        """The value as it is."""
        return getattr(importlib.import_module(f"groundtie.{self.module}"), self.name)

    @contextmanager
    def replaced(self, value: Any) -> Iterator[None]:
        """Give the constant another value, in all modules that import it, for a while."""
        usual = self.value
        holders = [
            module
            for name, module in tuple(sys.modules.items())
            if name.startswith("groundtie.") and getattr(module, self.name, None) is usual
        ]
        for module in holders:
            setattr(module, self.name, value)
        try:
            yield
        finally:
            for module in holders:
                setattr(module, self.name, usual)


CONSTANTS = (
    Constant("matching.alignment", "_BLURS_PX", (0.75, 0.0), (3.0, 0.0)),
    Constant("matching.alignment", "_SLOPE_PER_PX", 0.002, 0.05),
    Constant("matching.belief_propagation", "_DIFFERENCE_PX", 1.0, 4.0),
    Constant("matching.belief_propagation", "_NO_EVIDENCE", 0.5, 0.85),
    Constant("matching.belief_propagation", "_UNRELATED", 0.05, 0.2),
    Constant("matching.belief_propagation", "_PASSES", 4, 16),
    Constant("matching.coarse_shift", "LEVEL_SIDE_PX", 256, 1024),
    Constant("matching.coarse_shift", "MOST_CANDIDATES", 2, 8),
    Constant("matching.coarse_shift", "_LOW", 0.2, 0.8),
    Constant("matching.level_fit", "_CHIPS_PER_SIDE", 5, 10),
    Constant("matching.level_fit", "_CHIP_RANGE_PX", (34, 57), (68, 113)),
    Constant("matching.pyramid", "_CERTAIN", -3.0, -12.0),
    Constant("matching.pyramid", "_RIVAL_EVIDENCE", 0.25, 0.75),
    Constant("matching.pyramid", "_RADIUS_PX", 6, 24),
    Constant("matching.pyramid", "_LEVEL_ERROR_PX", 1.0, 4.0),
    # With more, the search radius of tie points never covers the error of a level.
    Constant("matching.pyramid", "_DISTORTION_PX", 2, 6),
    Constant("matching.pyramid", "_STEP", 2.0, 8.0),
    Constant("matching.chips", "_LEAST_VALID", 0.2, 0.6),
    Constant("matching.chips", "_FAR_PX", 1.25, 5.0),
    Constant("matching.surface_fit", "_NEAR_PX", 2, 6),
    Constant("matching.surface_fit", "FIT_RADIUS_PX", 6, 12),
    Constant("matching.layout", "_HELD_OUT", 0.45, 0.75),
    Constant("matching.layout", "_CELL_PX", 200, 450),
    Constant("matching.check", "CHECK_RADIUS_PX", 8, 18),
    Constant("geometry.robust", "_SAMPLES", 150, 2400),
    Constant("geometry.robust", "CONSENSUS_PX", 1.5, 6.0),
    Constant("geometry.robust", "_SIGMA_RANGE_PX", (0.1, 1.5), (0.4, 5.0)),
    Constant("geometry.robust", "_FIRST_SIGMA", 0.5, 2.0),
    Constant("geometry.robust", "_LARGEST_DISTORTION", 0.1, 0.5),
    Constant("similarity.orientation", "_LOG_OFFSET", 0.03, 0.3),
    Constant("similarity.surface", "TREND_PX", 3.0, 10.0),
)


@dataclass(frozen=True)
class ChangedCase:
    """A registration with another value of a constant; None: with all as they are."""

    case: ShiftedCase | SimulatedCase
    constant: Constant | None = None
    value: Any = None

    def run(self, workers: int | None) -> Outcome:
        """Register and judge."""
        if self.constant is None:
            return replace(self.case.run(workers), group=USUAL)
        with self.constant.replaced(self.value):
            found = self.case.run(workers)
        return replace(found, group=group_of(self.constant, self.value))


def group_of(constant: Constant, value: Any) -> str:
    """Return the name of the group of a constant's value."""
    return f"{constant.module}.{constant.name} = {value}"


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    real = [case for case in read_cases(settings.data) if case.kind == SAR_OPTICAL]
    pairs: list[ShiftedCase | SimulatedCase] = [ShiftedCase(case, 0) for case in real[::_EVERY]]
    pairs += [
        SimulatedCase(Simulation(_SIZE_PX, density, seed), density, settings.cache)
        for density in _DENSITIES
        for seed in settings.seed_numbers(2)
    ]
    constants = CONSTANTS
    if settings.quick:
        pairs, constants = pairs[-1:], CONSTANTS[:1]
    cases = [ChangedCase(pair) for pair in pairs]
    cases += [
        ChangedCase(pair, constant, value)
        for constant in constants
        for value in (constant.low, constant.high)
        for pair in pairs
    ]
    outcomes = run_cases(cases, settings.jobs)
    return SuiteResult(
        "How much results depend on constants",
        (none_wrong("Silently wrong with any value", outcomes),),
        (table(constants, by_group(outcomes)),),
        [outcome.record() for outcome in outcomes],
        ("Median errors are those of the pairs that all runs of a constant accept.",),
    )


def table(constants: Sequence[Constant], groups: dict[str, list[Outcome]]) -> Table:
    """Return the table of all constants."""
    usual = groups[USUAL]
    rows = [["all", USUAL, f"{count(usual, CORRECT)} of {len(usual)}", "", "", ""]]
    for constant in constants:
        low, high = (groups[group_of(constant, v)] for v in (constant.low, constant.high))
        errors = np.array([[one.error_px for one in of] for of in (usual, low, high)])
        shared = errors[:, np.isfinite(errors).all(axis=0)]
        medians = np.median(shared, axis=1) if shared.size else [math.nan] * 3
        rows.append(
            [
                f"{constant.module}.{constant.name.strip('_')}",
                str(constant.value),
                *(
                    f"{value}: {count(of, CORRECT)} of {len(of)}"
                    for value, of in ((constant.low, low), (constant.high, high))
                ),
                f"{medians[0]:.2f}",
                f"{medians[1]:.2f}, {medians[2]:.2f}",
            ]
        )
    head = ["constant", "value", "correct, low", "correct, high", "median (px)", "low, high"]
    return Table("Registrations with other values", head, rows)
