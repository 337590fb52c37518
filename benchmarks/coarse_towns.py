"""Simulated towns in pixels too coarse to resolve streets, seen obliquely."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from groundtie.kinds import plain
from groundtie.masks.used import GROUND
from groundtie.registration.specification import COREGISTER

from .accuracy import REFUSED, SILENTLY_WRONG, classify
from .attempt import on_pixels
from .pipeline_runs import found_by
from .simulations import Simulation
from .suites import Goal, Settings, SuiteResult, Table, by_group, run_cases

SIZE_PX = 700
SHIFT_PX = 8.0
LOOKS = 8.0
PIXELS_M = (2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
DENSITIES = ("urban", "city")
OFF_NADIR_DEG = (20.0, 35.0)


@dataclass(frozen=True)
class Town:
    """The outcome of one town.

    Parameters
    ----------
    name, group
        The case, and the group it is counted in.
    verdict, error_px
        As in `attempt.Outcome`, but with the error of refused transforms, too.
    right_m, down_m
        Mean displacement of the check points by the transform; NaN without a transform.
    is_by_ground
        Whether the ground alone was matched.
    reason
        The verdict's reason.
    """

    name: str
    group: str
    verdict: str
    error_px: float
    right_m: float
    down_m: float
    is_by_ground: bool
    reason: str

    def record(self) -> dict[str, Any]:
        """Return this as values that JSON can carry."""
        return plain(asdict(self))

    def line(self) -> str:
        """Return this as a line of text."""
        what = "ground" if self.is_by_ground else "whole"
        return f"{self.name}: {self.verdict}, {what}, {self.error_px:.2f} px; {self.reason}"


@dataclass(frozen=True)
class CoarseTown:
    """A town in pixels of one size, seen by an oblique camera."""

    density: str
    pixel_m: float
    off_nadir_deg: float
    seed: int
    cache: Path

    def run(self, workers: int | None) -> Town:
        """Make the pair if needed, register it and compare with the truth."""
        further = {"pixel_size": self.pixel_m, "off_nadir": self.off_nadir_deg, "looks": LOOKS}
        town = Simulation(SIZE_PX, self.density, self.seed, SHIFT_PX, tuple(further.items()))
        pair = town.pair(self.cache)
        found = found_by(COREGISTER, pair.reference, pair.input, workers=workers)
        error_px = right_m = down_m = math.nan
        if found.transform is not None and pair.truth is not None:
            mapping = on_pixels(found.transform, pair.reference)
            error_px = pair.truth.error_px(mapping)
            right_m, down_m = map(float, pair.truth.off_px(mapping).mean(axis=0) * self.pixel_m)
        group = group_name(self.density, self.pixel_m)
        return Town(
            f"{group}, {self.off_nadir_deg:g}° off nadir, seed {self.seed}",
            group,
            classify(found.verdict.accepted, error_px, pair.sigma_px),
            error_px,
            right_m,
            down_m,
            found.mask.kind == GROUND,
            found.verdict.reason,
        )


def group_name(density: str, pixel_m: float) -> str:
    """Return the name of a group of cases."""
    return f"{density}, {pixel_m:g} m"


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    cases = [
        CoarseTown(density, pixel_m, off_nadir_deg, seed, settings.cache)
        for seed in settings.seed_numbers()
        for density in DENSITIES
        for pixel_m in PIXELS_M
        for off_nadir_deg in OFF_NADIR_DEG
    ]
    towns = run_cases(cases, settings.jobs)
    names = [group_name(density, pixel_m) for density in DENSITIES for pixel_m in PIXELS_M]
    wrong = sum(town.verdict == SILENTLY_WRONG for town in towns)
    return SuiteResult(
        f"Simulated towns in coarse pixels, {SIZE_PX}×{SIZE_PX} px",
        [Goal("silently wrong", "none", f"{wrong} of {len(towns)}", wrong == 0)],
        (towns_table(by_group(towns, names)),),
        [town.record() for town in towns],
        (
            "The error is that at check points on open ground; roofs are elsewhere in both images. "
            "All displaced alike: root mean square along an axis, of all transforms that were "
            "found for whole towns, refused ones, too.",
        ),
    )


def towns_table(groups: Mapping[str, Sequence[Town]]) -> Table:
    """Return a table of the errors on the ground, one row for each town and pixel size."""
    head = (
        "town",
        "accepted",
        "by ground",
        "median error (px)",
        "largest (px)",
        "silently wrong",
        "refused",
        "whole: all displaced alike (m)",
    )
    rows = []
    for name, group in groups.items():
        accepted = [town for town in group if town.verdict != REFUSED]
        errors = [town.error_px for town in accepted] or [math.nan]
        rows.append(
            [
                name,
                str(len(accepted)),
                str(sum(town.is_by_ground for town in accepted)),
                f"{np.median(errors):.2f}",
                f"{max(errors):.2f}",
                str(sum(town.verdict == SILENTLY_WRONG for town in group)),
                str(len(group) - len(accepted)),
                _displaced_m(group),
            ]
        )
    return Table("On the ground", head, rows)


def _displaced_m(group: Sequence[Town]) -> str:
    whole = [town for town in group if not town.is_by_ground and math.isfinite(town.error_px)]
    off_m = [(town.right_m, town.down_m) for town in whole]
    return f"{np.sqrt(np.mean(np.square(off_m))):.1f}" if off_m else "–"
