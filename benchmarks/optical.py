"""Optical images registered by features: match rates, clouds, and whole registrations."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from .accuracy import CORRECT, REFUSED
from .attempt import Outcome, Pair, accepted, attempt, count
from .cases import RealCase, read_cases
from .cloudy_rates import (
    BANDS,
    KERNEL,
    MASK,
    OTHERS,
    REFINEMENTS,
    TEXTURE,
    CloudyCase,
    LabelCase,
    for_others,
)
from .cloudy_registrations import TOOLS, CloudyRegistration
from .crossings import Crossing, counts_by_group, what_was_accepted
from .match_rates import LIMITS_PX, METHODS, ClearCase, MatchRate
from .optical_speed import SOURCE, time_features, timing_goals, timing_table
from .real import FreeCase, ShiftedCase
from .rotated_pairs import RotatedCase, crossed, rotated_cases, strides
from .suites import Case, Goal, Settings, SuiteResult, Table, by_group, none_wrong, run_cases
from .tables import accuracy_table

TOOL = "match_optical"

KINDS = ("optical-optical", "optical-infrared", "day-night")
_ROTATED = ("optical-optical-rotated", "optical-infrared-rotated")

FREE_CROSSING = "another place, without georeferencing"
CLOUDED = "Registrations under clouds over half of the input"

# Wanted share of correct registrations.
_WANTED_SHARE = 0.9


@dataclass(frozen=True)
class FreeCrossing:
    """Images of different places, without georeferencing."""

    crossed: RotatedCase

    def run(self, workers: int | None) -> Outcome:
        """Register the pair, which must be refused."""
        assert self.crossed.input is not None
        reference, other = self.crossed.case, self.crossed.input
        name = f"{reference.name} × {other.stem}"
        return attempt(name, FREE_CROSSING, Pair(reference.reference, other), workers, tool=TOOL)


def crossings(cases: Sequence[RealCase]) -> list[Crossing]:
    """Return references with the inputs of some other places, georeferenced to the same place."""
    return [Crossing(one, other, TOOL) for one, other in strides(cases) if one.place != other.place]


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    cases = [case for case in read_cases(settings.data) if case.kind in KINDS]
    turned = [case for case in rotated_cases(settings.data) if case.kind in _ROTATED]
    if settings.quick:
        cases, turned = [case for case in cases if case.name in ("oi-2", "oo-burn")], turned[:1]
    clear = _rates([ClearCase(case) for case in cases], settings.jobs)
    labels: Any = run_cases([LabelCase(case) for case in cases], settings.jobs)
    cloudy = _rates(
        [CloudyCase(case, for_others(labels, case.name)) for case in cases], settings.jobs
    )
    registrations: list[Case] = [ShiftedCase(case, 0, tool=TOOL) for case in cases]
    registrations += [FreeCase(case, TOOL, case.kind) for case in turned]
    outcomes = run_cases(registrations, settings.jobs)
    clouded = [
        CloudyRegistration(case, tool, classified)
        for tool in TOOLS
        for classified in (False, True)
        for case in cases
    ]
    clouded_outcomes = run_cases(clouded, settings.jobs)
    different = [*crossings(cases), *map(FreeCrossing, crossed(turned))]
    crossed_outcomes = run_cases(different[:2] if settings.quick else different, settings.jobs)
    # Run alone, as it is timed; not in quick runs.
    timed = [] if settings.quick else [case for case in cases if case.name == SOURCE]
    timings = [timing for case in timed for timing in time_features(case)]
    return SuiteResult(
        "Optical images by features",
        (
            *goals(clear, cloudy, outcomes, crossed_outcomes),
            none_wrong(f"{CLOUDED}: silently wrong", clouded_outcomes),
            *timing_goals(timings),
        ),
        (
            mean_table(clear),
            pair_table("Correct-match rate within 5 px, by pair (%)", clear, list(METHODS)),
            cloud_table(cloudy),
            accuracy_table("Registrations by match_optical", by_group(outcomes)),
            accuracy_table(CLOUDED, by_group(clouded_outcomes)),
            outcome_table(outcomes),
            counts_by_group(crossed_outcomes),
            what_was_accepted(crossed_outcomes),
            timing_table(timings),
        ),
        [
            *(asdict(each) for each in (*clear, *cloudy, *timings)),
            *(o.record() for o in (*outcomes, *clouded_outcomes, *crossed_outcomes)),
        ],
        (
            "Matches are mutual nearest neighbours among the 2000 strongest features of each "
            "image, all over the image, without a limit on the ratio. Times are of the processor, "
            "for both images.",
        ),
    )


def _rates(cases: Sequence[ClearCase | CloudyCase], jobs: int) -> list[MatchRate]:
    return [rate for rates in run_cases(cases, jobs) for rate in rates.found]


def _mean(rates: Iterable[MatchRate], of: Callable[[MatchRate], float]) -> float:
    return float(np.mean([of(rate) for rate in rates]))


def goals(
    clear: Sequence[MatchRate],
    cloudy: Sequence[MatchRate],
    outcomes: Sequence[Outcome],
    crossed_outcomes: Sequence[Outcome],
) -> tuple[Goal, ...]:
    """Return the goals, with their results."""
    gain = 100 * (
        _mean((r for r in clear if r.method == "HOG-81"), lambda r: r.rates[0])
        - _mean((r for r in clear if r.method == "SURF-64"), lambda r: r.rates[0])
    )
    right, refused, total = count(outcomes, CORRECT), count(outcomes, REFUSED), len(outcomes)
    return (
        Goal("HOG-81 above SURF-64, mean", "at least 5 points", f"{gain:+.1f} points", gain >= 5),
        *(
            _refinement_goal(cloudy, name, None if name in (OTHERS, MASK) else "all")
            for name in (KERNEL, BANDS, TEXTURE, OTHERS, MASK)
        ),
        Goal(
            "registrations correct",
            "at least 90 %",
            f"{right} of {total}, {refused} refused",
            right >= _WANTED_SHARE * total,
        ),
        none_wrong("silently wrong", outcomes),
        Goal(
            "different places: accepted",
            "none",
            f"{len(accepted(crossed_outcomes))} of {len(crossed_outcomes)}",
            count(crossed_outcomes, REFUSED) == len(crossed_outcomes),
        ),
    )


def _refinement_goal(cloudy: Sequence[MatchRate], name: str, wanted: str | None) -> Goal:
    gains = _gains(cloudy, name)
    better, worse = sum(gain > 0 for gain in gains), sum(gain < 0 for gain in gains)
    found = f"{better} of {len(gains)}, {worse} lowered"
    return Goal(
        f"refinement raises the rate on cloudy pairs: {name}",
        wanted or "reported",
        f"{found}; mean {np.mean(gains):+.1f} points" if gains else found,
        None if wanted is None else better == len(gains),
    )


def _gains(cloudy: Sequence[MatchRate], kernel: str) -> list[float]:
    """Return the gain of each cloudy pair's rate by a kernel, in percentage points."""
    before = {rate.name: rate.rates[0] for rate in cloudy if not rate.refinement}
    return [100 * (r.rates[0] - before[r.name]) for r in cloudy if r.refinement == kernel]


def mean_table(rates: Sequence[MatchRate]) -> Table:
    """Return the means of all methods."""
    rows = []
    for method in METHODS:
        own = [rate for rate in rates if rate.method == method]
        rows.append(
            [
                method,
                *(
                    f"{100 * _mean(own, lambda rate, number=number: rate.rates[number]):.1f}"
                    for number in range(len(LIMITS_PX))
                ),
                f"{_mean(own, lambda rate: rate.correct_at_20):.1f}",
                f"{_mean(own, lambda rate: rate.matches):.0f}",
                f"{_mean(own, lambda rate: rate.seconds):.2f}",
            ]
        )
    head = ("method", "% within 5 px", "% within 1.5 px", "correct@20", "matches", "s")
    return Table("Means over all pairs", head, rows)


def pair_table(title: str, rates: Sequence[MatchRate], methods: Sequence[str]) -> Table:
    """Return the rate of each pair and method, and correct@20."""
    by_name: dict[str, dict[str, MatchRate]] = {}
    for rate in rates:
        by_name.setdefault(rate.name, {})[rate.method] = rate
    rows = [
        [name, *(f"{100 * own[m].rates[0]:.0f} ({own[m].correct_at_20:g})" for m in methods)]
        for name, own in by_name.items()
    ]
    return Table(f"{title}, in brackets correct@20", ("pair", *methods), rows)


def cloud_table(rates: Sequence[MatchRate]) -> Table:
    """Return the rates on cloudy pairs without and with refinement by each kernel."""
    by_name: dict[str, dict[str, MatchRate]] = {}
    for rate in rates:
        by_name.setdefault(rate.name, {})[rate.refinement] = rate
    names = ("", *REFINEMENTS)
    rows = [
        [
            name,
            *(
                f"{100 * own[k].rates[0]:.1f} ({own[k].matches})" if k in own else "–"
                for k in names
            ),
        ]
        for name, own in by_name.items()
    ]
    refined = [own for own in by_name.values() if len(own) == len(names)]
    means = [f"{100 * _mean([own[k] for own in refined], lambda r: r.rates[0]):.1f}" for k in names]
    return Table(
        "Simulated clouds: % of HOG-81's matches within 5 px (matches)",
        ("pair", "not refined", *REFINEMENTS),
        [*rows, ["mean", *means]] if refined else rows,
    )


def outcome_table(outcomes: Sequence[Outcome]) -> Table:
    """Return every registration."""
    rows = [
        [o.name, o.verdict, f"{o.error_px:.2f}", f"{o.sigma_px:g}", f"{o.seconds:.1f}", o.reason]
        for o in outcomes
    ]
    return Table("Every registration", ("pair", "", "error (px)", "σ (px)", "s", "reason"), rows)
