"""Real pairs, each with several wrong shifts of up to 20 pixels."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from .accuracy import CORRECT, SILENTLY_WRONG
from .attempt import Outcome, Pair, attempt, count
from .cases import (
    KINDS,
    SAR_OPTICAL,
    RealCase,
    draw_shift,
    read_cases,
    search_radius_m,
    write_case,
)
from .suites import Goal, Settings, SuiteResult, by_group, none_wrong, run_cases
from .tables import accuracy_table

LARGEST_SHIFT_PX = 20.0
SHIFTS = 5

# Wanted number of correct registrations of SAR–optical pairs.
_WANTED = 40
_WANTED_OF = 45


@dataclass(frozen=True)
class ShiftedCase:
    """A real pair and the number of the shift that is drawn for it.

    Parameters
    ----------
    case, number
        The case, and the number of the shift.
    largest_px
        Largest shift.
    tool
        Tool that registers it.
    pixel_m
        Pixel size of the comparison, for references of 1 m; None: the default.
    """

    case: RealCase
    number: int
    largest_px: float = LARGEST_SHIFT_PX
    tool: str = "coregister"
    pixel_m: float | None = None

    def run(self, workers: int | None) -> Outcome:
        """Write the pair, register it and judge the result."""
        shift = draw_shift(self.case, self.largest_px, self.number)
        is_coarse = self.pixel_m is not None
        with tempfile.TemporaryDirectory() as folder:
            return attempt(
                f"{self.case.name} ({shift[0]:+.1f}, {shift[1]:+.1f})",
                f"{self.case.kind}, {self.pixel_m:g} m" if is_coarse else self.case.kind,
                write_case(self.case, shift, Path(folder)),
                workers,
                tool=self.tool,
                search_radius=search_radius_m(self.largest_px),
                **({"matching_pixel_size": self.pixel_m} if is_coarse else {}),
            )


@dataclass(frozen=True)
class FreeCase:
    """A real pair without georeferencing."""

    case: RealCase
    tool: str
    group: str

    def run(self, workers: int | None) -> Outcome:
        """Register the pair and judge the result."""
        case = self.case
        pair = Pair(case.reference, case.input, *case.truths(), case.sigma_px)
        return attempt(case.name, self.group, pair, workers, tool=self.tool)


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    cases = read_cases(settings.data)
    shifts = SHIFTS
    if settings.quick:
        others = [next(case for case in cases if case.kind == kind) for kind in KINDS[1:]]
        cases = (*(case for case in cases if case.kind == SAR_OPTICAL), *others)
        shifts = 1
    shifted = [ShiftedCase(case, number) for case in cases for number in range(shifts)]
    outcomes = run_cases(shifted, settings.jobs)
    by_case = {
        case.name: [o for s, o in zip(shifted, outcomes, strict=True) if s.case is case]
        for case in cases
    }
    return SuiteResult(
        f"Real pairs, shifts of up to ± {LARGEST_SHIFT_PX:g} px",
        goals(outcomes),
        (
            accuracy_table("By kind", by_kind(outcomes)),
            accuracy_table("By pair", by_case),
        ),
        [outcome.record() for outcome in outcomes],
    )


def by_kind(outcomes: Sequence[Outcome]) -> dict[str, list[Outcome]]:
    """Return outcomes by their group."""
    return by_group(sorted(outcomes, key=lambda outcome: KINDS.index(outcome.group)))


def goals(outcomes: Sequence[Outcome]) -> tuple[Goal, ...]:
    """Return the suite's goals, on SAR–optical pairs, with their results."""
    sar_optical = [outcome for outcome in outcomes if outcome.group == SAR_OPTICAL]
    correct = count(sar_optical, CORRECT)
    all_wrong = count(outcomes, SILENTLY_WRONG)
    enough = correct * _WANTED_OF >= _WANTED * len(sar_optical)
    return (
        Goal(
            "SAR–optical pairs correct",
            f"at least {_WANTED} of {_WANTED_OF}",
            f"{correct} of {len(sar_optical)}",
            enough,
        ),
        none_wrong("SAR–optical pairs silently wrong", sar_optical),
        Goal(
            "Real pairs of all kinds silently wrong",
            "reported",
            f"{all_wrong} of {len(outcomes)}",
            None,
        ),
    )
