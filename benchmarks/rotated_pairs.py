"""Unknown rotation and scale: found or refused, never silently wrong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import groundtie
from groundtie.rasters.grid import PIXEL_COORDINATES, Grid

from .accuracy import CORRECT, REFUSED, SILENTLY_WRONG
from .attempt import Outcome, count, tried
from .cases import RealCase, image_size, read_cases
from .suites import Case, Goal, Settings, SuiteResult, by_group, run_cases
from .tables import accuracy_table

# Largest error, in pixels of a reference that is 256 px wide.
LARGEST_ERROR_PX = {
    "sar-optical-rotated": 5.0,
    "optical-optical-rotated": 2.0,
    "optical-infrared-rotated": 2.0,
}
LONGEST_S = 3.0

_SIDE_PX = 256
_CROSSED = "crossed"

# The inputs that each reference is crossed with: this many places further in the list.
_STRIDES = (1, 4, 11, 17)

# Two cases of one place, found by visual inspection: their file names differ.
_SAME_PLACE = {"oi-rotated/80", "oi-rotated/100"}


@dataclass(frozen=True)
class RotatedCase:
    """A reference and an input, with their truth; None if they show different places."""

    case: RealCase
    input: Path | None = None

    def run(self, workers: int | None) -> Outcome:
        """Estimate rotation, scale and shift, and compare with the truth."""
        case, crossed = self.case, self.input is not None
        name = case.name if self.input is None else f"{case.name} × {self.input.stem}"
        group = _CROSSED if crossed else case.kind
        files = case.reference, self.input or case.input
        one = tried(lambda: groundtie.estimate_rotation(*files, workers=workers))
        if one.result is None:
            return one.unregistered(name, group, case.sigma_px)
        found = one.result
        size = image_size(case.reference)
        plain = Grid(PIXEL_COORDINATES, None, *size)
        error_px = case.truths()[1].error_px(lambda px: found.transform(plain.pixel_to_map(px)))
        error_px *= _SIDE_PX / max(size)
        right = not crossed and error_px <= LARGEST_ERROR_PX[case.kind]
        verdict = CORRECT if right else SILENTLY_WRONG
        reason = (
            f"height {found.evidence.height:.1f}, rival ratio {found.evidence.rival_ratio:.2f}, "
            f"{found.pose.rotation_deg:.2f}°, scale {found.pose.scale:.3f}"
        )
        unknown = float("nan")
        return Outcome(
            name,
            group,
            verdict,
            verdict,
            unknown if crossed else error_px,
            unknown if crossed else error_px,
            case.sigma_px,
            one.seconds,
            unknown,
            "similarity",
            reason,
        )


def rotated_cases(folder: Path) -> list[RealCase]:
    """Return the cases of unknown rotation and scale in a folder."""
    return list(read_cases(folder, LARGEST_ERROR_PX))


def strides(cases: Sequence[RealCase]) -> list[tuple[RealCase, RealCase]]:
    """Return each case with some of the others."""
    return [
        (case, cases[(index + stride) % len(cases)])
        for index, case in enumerate(cases)
        for stride in _STRIDES
    ]


def crossed(cases: Sequence[RealCase]) -> list[RotatedCase]:
    """Return references paired with the inputs of other places."""
    return [
        RotatedCase(case, other.input)
        for case, other in strides(cases)
        if not {case.name, other.name} <= _SAME_PLACE
    ]


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    real = rotated_cases(settings.data)
    cases: list[Case] = [*map(RotatedCase, real), *crossed(real)]
    if settings.quick:
        cases = [*map(RotatedCase, real[:2]), *crossed(real)[:2]]
    outcomes = run_cases(cases, settings.jobs)
    groups = by_group(outcomes, (*LARGEST_ERROR_PX, _CROSSED))
    groups = {group: members for group, members in groups.items() if members}
    return SuiteResult(
        "Unknown rotation and scale",
        [goal for group, members in groups.items() for goal in goals(group, members)],
        (accuracy_table("By kind", groups),),
        [outcome.record() for outcome in outcomes],
        (
            "`estimate_rotation` with its defaults: any rotation, scale 0.5 to 2, centres apart by "
            "a quarter of the input at most. Errors are root mean squares on a lattice over the "
            f"reference, in pixels of a reference {_SIDE_PX} px wide; whatever is accepted with a "
            "larger error than the goal's counts as silently wrong.",
        ),
    )


def goals(group: str, outcomes: Sequence[Outcome]) -> tuple[Goal, ...]:
    """Return the goals for one group, with their results."""
    total = len(outcomes)
    refused, wrong = count(outcomes, REFUSED), count(outcomes, SILENTLY_WRONG)
    if group == _CROSSED:
        found = f"{refused} of {total} refused, {wrong} accepted"
        return (Goal("different places: refused", "all", found, refused == total),)
    right = count(outcomes, CORRECT)
    slowest = max(outcome.seconds for outcome in outcomes)
    return (
        Goal(
            f"{group}: found within {LARGEST_ERROR_PX[group]:g} px",
            "all",
            f"{right} of {total} ({refused} refused, {wrong} silently wrong)",
            right == total,
        ),
        Goal(
            f"{group}: longest time",
            f"≤ {LONGEST_S:g} s on two processors",
            f"{slowest:.1f} s",
            slowest <= LONGEST_S,
        ),
    )
