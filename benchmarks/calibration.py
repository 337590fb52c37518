"""Whether verdicts state realistic errors: CE50, CE90, CE95 against known errors."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import numpy as np

import groundtie
from groundtie.kinds import plain

from .attempt import Pair, on_pixels, tried
from .cases import RealCase, draw_shift, read_cases, search_radius_m, write_case
from .optical_pairs import OpticalPair
from .real import LARGEST_SHIFT_PX
from .sar_pairs import SarPair
from .simulations import Simulation
from .suites import Goal, Settings, SuiteResult, Table, by_group, of_classes, run_cases

ACCEPTED = "accepted"
SAID = {"ce50_px": 0.5, "ce90_px": 0.9, "ce95_px": 0.95}

# One of this many seeds is a large scene, too: it takes five times as long.
_SMALL_PX, _LARGE_PX, _LARGE_EVERY = 500, 1500, 5

# The ground of dense towns is found in larger scenes only: name, side and pixel size in metres.
_CITIES = ("city, 1 m", 1000, 1.0), ("city, 2 m", 800, 2.0)

_RADIUS_M = 20.0

# Wanted share of places within CE90 for each class, and the number of runs that can show it.
_WANTED = 0.88, 0.93
_ENOUGH = 20

# Two-sided 95 % of a normal distribution.
_Z = 1.96


class Made(Protocol):
    """A simulated pair, kept in a folder."""

    @property
    def name(self) -> str: ...

    def pair(self, cache: Path) -> Pair: ...


@dataclass(frozen=True)
class CalibrationRun:
    """The outcome of one registration.

    Parameters
    ----------
    name, group
        The case, and its class.
    verdict
        Accepted, refused or crashed.
    reason
        The tool's message.
    rms_px
        Root mean square error over the reference, in its pixels.
    sigma_px
        Uncertainty of the truth.
    ce50_px, ce90_px, ce95_px
        Radii that the verdict states.
    within
        For each radius, the share of places of the reference whose error does not exceed it.
    seconds
        Wall-clock time.
    """

    name: str
    group: str
    verdict: str
    reason: str
    rms_px: float = math.nan
    sigma_px: float = 0.0
    ce50_px: float = math.nan
    ce90_px: float = math.nan
    ce95_px: float = math.nan
    within: tuple[float, ...] = ()
    seconds: float = 0.0

    def record(self) -> dict[str, Any]:
        """Return the run as values that JSON can carry."""
        return plain(asdict(self))

    def line(self) -> str:
        """Return the run as a line of text."""
        if self.verdict != ACCEPTED:
            return f"{self.group}: {self.name}: {self.verdict}; {self.reason}"
        return (
            f"{self.group}: {self.name}: {self.rms_px:.2f} px (RMS), CE90 {self.ce90_px:.2f} px, "
            f"which holds {self.within[1]:.0%}, in {self.seconds:.1f} s"
        )


@dataclass(frozen=True)
class SimulatedCase:
    """A simulated pair, registered by the tool for its kind."""

    made: Made
    group: str
    tool: str
    cache: Path
    radius_m: float = _RADIUS_M

    def run(self, workers: int | None) -> CalibrationRun:
        """Make the pair if needed, register it and compare."""
        pair = self.made.pair(self.cache)
        return compare(self.made.name, self.group, self.tool, pair, self.radius_m, workers)


@dataclass(frozen=True)
class RealPairCase:
    """A real pair with a wrong shift."""

    case: RealCase
    number: int

    @property
    def group(self) -> str:
        """Class of the case."""
        return f"real {self.case.kind}"

    def run(self, workers: int | None) -> CalibrationRun:
        """Write the pair, register it, and compare."""
        shift = draw_shift(self.case, LARGEST_SHIFT_PX, self.number)
        with tempfile.TemporaryDirectory() as folder:
            pair = write_case(self.case, shift, Path(folder))
            radius = search_radius_m(LARGEST_SHIFT_PX)
            return compare(self.case.name, self.group, "coregister", pair, radius, workers)


def compare(
    name: str, group: str, tool: str, pair: Pair, radius_m: float, workers: int | None
) -> CalibrationRun:
    """Register a pair and compare its errors over the reference with the radii of the verdict."""
    files = pair.reference, pair.input
    call = partial(getattr(groundtie, tool), *files, search_radius=radius_m, workers=workers)
    one = tried(call)
    if one.result is None:
        return CalibrationRun(name, group, one.verdict, one.reason)
    found = one.result
    assert pair.truth is not None
    errors = np.hypot(*pair.truth.off_px(on_pixels(found.transform, pair.reference)).T)
    accuracy = found.verdict.accuracy
    radii = accuracy.ce50_px, accuracy.ce90_px, accuracy.ce95_px
    return CalibrationRun(
        name,
        group,
        ACCEPTED,
        found.verdict.reason,
        float(np.sqrt(np.mean(errors**2))),
        pair.sigma_px,
        *radii,
        tuple(
            float(np.mean(errors <= with_truth_px(radius, said, pair.sigma_px)))
            for radius, said in zip(radii, SAID.values(), strict=True)
        ),
        one.seconds,
    )


def with_truth_px(radius_px: float, said: float, sigma_px: float) -> float:
    """Return a radius enlarged by the root mean square error of the truth."""
    return math.hypot(radius_px, sigma_px * math.sqrt(-math.log(1 - said)))


def wilson(held: float, count: int) -> tuple[float, float]:
    """Return the 95 % interval of a share that was observed in a number of runs ([Wilson1927])."""
    if count == 0:
        return 0.0, 1.0
    middle = (held + _Z**2 / (2 * count)) / (1 + _Z**2 / count)
    half = _Z * math.sqrt(held * (1 - held) / count + (_Z / (2 * count)) ** 2)
    half /= 1 + _Z**2 / count
    return max(middle - half, 0.0), min(middle + half, 1.0)


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    runs: Sequence[CalibrationRun] = run_cases(cases(settings), settings.jobs)
    groups = by_group(runs)
    return SuiteResult(
        "Calibration: said and true errors",
        [goal(name, group) for name, group in groups.items()],
        (coverage_table(groups),),
        [one.record() for one in runs],
        (
            "CE90 is said to hold the error of the transform at a random place of the overlap with "
            "90 %: given is the share of places, over all accepted runs of a class, with the 95 % "
            "interval for as many runs (places of one run err together). Errors of real pairs are "
            "against a truth that errs by σ itself, which the radii are widened by.",
        ),
    )


def cases(settings: Settings) -> list[SimulatedCase | RealPairCase]:
    """Return the cases, class by class for each seed, so that any part of a run is a sample."""
    found: list[SimulatedCase | RealPairCase] = []
    for seed in settings.seed_numbers():
        sizes = (_SMALL_PX, _LARGE_PX) if seed % _LARGE_EVERY == 0 else (_SMALL_PX,)
        for size in sizes[: 1 if settings.quick else 2]:
            found += _simulated(seed, size, settings.cache)
    if not settings.quick:
        found += [RealPairCase(case, settings.first_seed) for case in read_cases(settings.data)]
    return of_classes(found, settings.classes, lambda case: {case.group})


def _simulated(seed: int, size: int, cache: Path) -> list[SimulatedCase]:
    """Return pairs of all classes; looks and changes vary with the seed."""
    further = (("looks", float(1 + seed % 3)), ("changed", 10.0 * (seed % 2)))
    is_large = size >= _LARGE_PX
    large = ", large" if is_large else ""
    found = [
        SimulatedCase(
            Simulation(size, density, seed, 8.0, further), density + large, "coregister", cache
        )
        for density in ("rural", "suburban", "urban", "city")
    ]
    for density in ("rural", "suburban"):
        radar = SarPair(size, density, seed, 1 + seed % 4, bool(seed % 2))
        camera = OpticalPair(size, density, seed)
        found += [
            SimulatedCase(radar, f"SAR–SAR, {density}{large}", "match_sar_sar", cache),
            SimulatedCase(camera, f"optical, {density}{large}", "match_optical", cache),
        ]
    for name, side, pixel_m in () if is_large else _CITIES:
        town = Simulation(side, "city", seed, 8.0, (*further, ("pixel_size", pixel_m)))
        found.append(SimulatedCase(town, name, "coregister", cache, _RADIUS_M * pixel_m))
    return found


def goal(name: str, runs: Sequence[CalibrationRun]) -> Goal:
    """Return the goal of a class, with its result."""
    share, count = coverage(runs, 1)
    low, high = _WANTED
    reached = None if count < _ENOUGH else low <= share <= high
    said = f"{share:.0%} of places, {count} runs" if count else "no run was accepted"
    return Goal(f"{name}: within CE90", f"{low:.0%} to {high:.0%}", said, reached)


def coverage(runs: Sequence[CalibrationRun], which: int) -> tuple[float, int]:
    """Return the share of places within a radius over the accepted runs, and their number."""
    accepted = [one for one in runs if one.verdict == ACCEPTED]
    share = float(np.mean([one.within[which] for one in accepted])) if accepted else math.nan
    return share, len(accepted)


def coverage_table(groups: dict[str, list[CalibrationRun]]) -> Table:
    """Return a table with a row for each class and one for all."""
    head = (
        "class",
        "runs",
        "accepted",
        "median RMS (px)",
        "median CE90 (px)",
        "within CE50",
        "within CE90",
        "95 % interval",
        "within CE95",
        "runs whose RMS is below CE90",
    )
    simulated = [
        one for name, runs in groups.items() if not name.startswith("real") for one in runs
    ]
    rows = [_row(name, runs) for name, runs in (*groups.items(), ("all simulated", simulated))]
    return Table("Coverage by class", head, rows)


def _row(name: str, runs: Sequence[CalibrationRun]) -> list[str]:
    accepted = [one for one in runs if one.verdict == ACCEPTED]
    if not accepted:
        return [name, str(len(runs)), "0", *["–"] * 7]
    shares = [coverage(accepted, which)[0] for which in range(len(SAID))]
    low, high = wilson(shares[1], len(accepted))
    below = np.mean(
        [one.rms_px <= with_truth_px(one.ce90_px, 0.9, one.sigma_px) for one in accepted]
    )
    return [
        name,
        str(len(runs)),
        str(len(accepted)),
        f"{np.median([one.rms_px for one in accepted]):.2f}",
        f"{np.median([one.ce90_px for one in accepted]):.2f}",
        f"{shares[0]:.0%}",
        f"{shares[1]:.0%}",
        f"{low:.0%} to {high:.0%}",
        f"{shares[2]:.0%}",
        f"{below:.0%}",
    ]
