"""Radar images registered to radar images: real and simulated pairs, crossings, features."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import groundtie

from . import feature_counts
from .accuracy import CORRECT, REFUSED
from .attempt import Outcome, accepted, attempt, count
from .cases import SAR_SAR, RealCase, read_cases
from .crossings import Crossing, crossings
from .real import SHIFTS, FreeCase, ShiftedCase
from .sar_pairs import CHANGED_BUILDINGS, INCIDENCES_DEG, SarPair
from .suites import Case, Goal, Settings, SuiteResult, Table, by_group, none_wrong, run_cases
from .tables import accuracy_table

TOOL = "match_sar_sar"

# Cases whose images are rotated by 18°: they are also matched without georeferencing.
_TURNED = ("ss-ponds", "ss-meander")
FREE = "without georeferencing"

# The larger images are also matched in pixels of four times as many looks.
_MANY_LOOKS_M = 2.0

# Masks of simulated pairs: the simulator's ground, homogeneous regions of the reference, none.
_TRUE, _REGIONS, _NO_MASK = "true ground", "mask_regions", "no mask"
MASKS = (_TRUE, _REGIONS, _NO_MASK)

_SIZE_PX = 800
_LARGE_PX = 2000
_DENSITIES = ("rural", "suburban")
_MOST_LOOKS = 4
_QUICK_CROSSINGS = 20

_WANTED_CORRECT = 0.95
_LARGEST_ERROR_PX = {False: 1.0, True: 2.0}
_LONGEST_S = 15.0


@dataclass(frozen=True)
class SimulatedAttempt:
    """A simulated pair with one of `MASKS`."""

    simulation: SarPair
    mask: str
    cache: Path

    @property
    def group(self) -> str:
        """Name of the cases that are counted together."""
        return _group(self.simulation.opposite, self.mask)

    def run(self, workers: int | None) -> Outcome:
        """Make the pair if needed, register it and judge the result."""
        pair = self.simulation.pair(self.cache)
        given: dict[str, Any] = {}
        if self.mask == _TRUE:
            given["reference_mask"] = self.simulation.ground(self.cache)
        with tempfile.TemporaryDirectory() as folder:
            if self.mask == _REGIONS:
                given["reference_mask"] = Path(folder) / "mask.tif"
                groundtie.mask_regions(pair.reference, given["reference_mask"])
            return attempt(self.simulation.name, self.group, pair, workers, tool=TOOL, **given)


def _group(opposite: bool, mask: str) -> str:
    return f"{'opposite orbits' if opposite else 'same orbit'}, {mask}"


def simulations(seeds: range) -> list[SarPair]:
    """Return pairs of both orbit combinations; density and looks cycle with the seed."""
    return [
        SarPair(
            _SIZE_PX,
            _DENSITIES[seed % len(_DENSITIES)],
            seed,
            1 + seed % _MOST_LOOKS,
            opposite,
        )
        for opposite in (False, True)
        for seed in seeds
    ]


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    every = read_cases(settings.data)
    own = [case for case in every if case.kind == SAR_SAR]
    detectors, chains, turns = _counts(own)
    real: list[Case] = [
        *(
            ShiftedCase(case, number, tool=TOOL)
            for case in own
            for number in range(1 if settings.quick else SHIFTS)
        ),
        *(FreeCase(case, TOOL, FREE) for case in own if case.name in _TURNED),
    ]
    many_looks: list[Case] = [
        ShiftedCase(case, number, tool=TOOL, pixel_m=_MANY_LOOKS_M)
        for case in own
        for number in range(1 if settings.quick else SHIFTS)
        if case.name in _TURNED
    ]
    crossed = [
        Crossing(one.reference, one.input, TOOL)
        for one in crossings(every)
        if one.reference.kind == SAR_SAR
    ]
    simulated: list[Case] = [
        SimulatedAttempt(simulation, mask, settings.cache)
        for simulation in simulations(settings.seed_numbers())
        for mask in MASKS
    ]
    outcomes = {
        "real": run_cases(real, settings.jobs),
        "many looks": run_cases(many_looks, settings.jobs),
        "crossed": run_cases(
            crossed[:: max(len(crossed) // _QUICK_CROSSINGS, 1)] if settings.quick else crossed,
            settings.jobs,
        ),
        "simulated": run_cases(simulated, settings.jobs),
    }
    # Run alone, as it is timed.
    large = SimulatedAttempt(SarPair(_LARGE_PX, "rural", 1, 4, True), _TRUE, settings.cache)
    large.simulation.pair(settings.cache)
    outcomes["large"] = run_cases([large], 1)
    names = [_group(opposite, mask) for mask in MASKS for opposite in (False, True)]
    groups = by_group(outcomes["simulated"], names)
    pairs = {
        name: [o for o in outcomes["real"] if o.name.split(" ")[0] == name]
        for name in (case.name for case in own)
    }
    return SuiteResult(
        "Radar images registered to radar images",
        (
            *feature_counts.goals(detectors, chains, turns),
            *real_goals(outcomes["real"]),
            none_wrong(
                "Real pairs in pixels of many looks: silently wrong", outcomes["many looks"]
            ),
            *other_goals(outcomes["crossed"], groups, outcomes["large"][0]),
        ),
        (
            feature_counts.detector_table(detectors),
            feature_counts.chain_table(chains),
            feature_counts.turn_table(turns),
            accuracy_table("Real pairs", pairs),
            accuracy_table("Real pairs in pixels of many looks", by_group(outcomes["many looks"])),
            accuracy_table("Simulated pairs", groups),
            _reasons(outcomes["simulated"]),
        ),
        [
            *feature_counts.records([*detectors, *chains, *turns]),
            *(outcome.record() for part in outcomes.values() for outcome in part),
        ],
        (
            f"Simulated: {_SIZE_PX} px, rural and suburban, 1 to {_MOST_LOOKS} looks, incidence "
            f"{INCIDENCES_DEG[0]:g}° and {INCIDENCES_DEG[1]:g}°, {CHANGED_BUILDINGS:.0%} of the "
            "buildings and three in ten parcels changed, other speckle and texture. The ground "
            "mask is the simulator's: what layover or shadow hides in either image, and 8 px "
            "beside it, is left out.",
        ),
    )


def _counts(
    cases: Sequence[RealCase],
) -> tuple[
    list[feature_counts.DetectorCount],
    list[feature_counts.ChainCount],
    list[feature_counts.TurnCount],
]:
    gradients = ("differences", "recursive", "roewa", "roewa-unsigned")
    return (
        [
            feature_counts.count_detector(case, detector)
            for case in cases
            for detector in feature_counts.DETECTORS
        ],
        [feature_counts.count_chain(case) for case in cases],
        [feature_counts.count_turn(case, gradient) for gradient in gradients for case in cases],
    )


def real_goals(outcomes: Sequence[Outcome]) -> tuple[Goal, ...]:
    """Return the goals on real pairs, with their results."""
    right, refused = count(outcomes, CORRECT), count(outcomes, REFUSED)
    free = [outcome for outcome in outcomes if outcome.group == FREE]
    found = f"{right} of {len(outcomes)}, {refused} refused"
    return (
        Goal(
            "Real pairs: correct",
            "all that are not refused",
            found,
            right + refused == len(outcomes),
        ),
        none_wrong("Real pairs: silently wrong", outcomes),
        Goal(
            "Turned by 18°, without georeferencing: correct",
            "all",
            f"{count(free, CORRECT)} of {len(free)}",
            count(free, CORRECT) == len(free),
        ),
    )


def other_goals(
    crossed: Sequence[Outcome], groups: dict[str, list[Outcome]], large: Outcome
) -> tuple[Goal, ...]:
    """Return the goals on crossings and simulated pairs, with their results."""
    refused = count(crossed, REFUSED)
    goals = [
        Goal("Crossings: refused", "all", f"{refused} of {len(crossed)}", refused == len(crossed))
    ]
    for mask in MASKS:
        for opposite, largest in _LARGEST_ERROR_PX.items():
            own = groups[_group(opposite, mask)]
            good = sum(outcome.error_px <= largest for outcome in accepted(own))
            goals.append(
                Goal(
                    f"Simulated, {_group(opposite, mask)}: within {largest:g} px",
                    f"at least {_WANTED_CORRECT:.0%}",
                    f"{good} of {len(own)}",
                    good >= _WANTED_CORRECT * len(own),
                )
            )
        both = [*groups[_group(False, mask)], *groups[_group(True, mask)]]
        goals.append(none_wrong(f"Simulated, {mask}: silently wrong", both))
    goals.append(
        Goal(
            f"{_LARGE_PX}×{_LARGE_PX} px, end to end",
            f"at most {_LONGEST_S:g} s on two processors",
            f"{large.seconds:.1f} s ({large.verdict})",
            large.seconds <= _LONGEST_S,
        )
    )
    return tuple(goals)


def _reasons(outcomes: Sequence[Outcome]) -> Table:
    """Return why simulated pairs were refused, and the errors of accepted ones."""
    rows = []
    for group in dict.fromkeys(outcome.group for outcome in outcomes):
        own = [outcome for outcome in outcomes if outcome.group == group]
        errors = [outcome.error_px for outcome in accepted(own)]
        spread = np.quantile(errors, (0.5, 0.9, 1.0)) if errors else [np.nan] * 3
        refused = [outcome.reason for outcome in own if outcome.verdict == REFUSED]
        rows.append(
            [group, *(f"{error:.2f}" for error in spread), "; ".join(sorted(refused)) or "–"]
        )
    head = ("pairs", "median error (px)", "90 %", "largest", "refused because")
    return Table("Simulated pairs: errors and refusals", head, rows)
