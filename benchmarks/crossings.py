"""Pairs that must be refused: images of different places, and images replaced by speckle."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from affine import Affine
from numpy.typing import NDArray

from groundtie.rasters.grid import compose

from .accuracy import CRASHED, REFUSED
from .attempt import Outcome, Pair, accepted, attempt, count
from .cases import (
    REFERENCE_TRANSFORM,
    SAR_OPTICAL,
    SAR_SAR,
    RealCase,
    draw_shift,
    image_size,
    read_cases,
    read_image,
    search_radius_m,
    write_case,
    write_image,
)
from .real import LARGEST_SHIFT_PX
from .suites import Goal, Settings, SuiteResult, Table, by_group, run_cases

CROSSING = "another place"
SPECKLE = {"reference": "reference is speckle", "input": "input is speckle"}

SAR_REFERENCES = (SAR_OPTICAL, SAR_SAR)

_AT_LEAST = 200
_QUICK_STEP = 60


@dataclass(frozen=True)
class Crossing:
    """The reference of one place and the input of another, georeferenced to the same place."""

    reference: RealCase
    input: RealCase
    tool: str = "coregister"

    def run(self, workers: int | None) -> Outcome:
        """Register the pair, which must be refused."""
        with tempfile.TemporaryDirectory() as folder:
            pair = write_crossing(self.reference, self.input, Path(folder))
            name = f"{self.reference.name} × {self.input.name}"
            return _attempt(name, CROSSING, pair, workers, self.tool)


@dataclass(frozen=True)
class Speckled:
    """A pair with one image (a key of `SPECKLE`) replaced by speckle."""

    case: RealCase
    replaced: str

    def run(self, workers: int | None) -> Outcome:
        """Register the pair, which must be refused."""
        with tempfile.TemporaryDirectory() as folder:
            shift = draw_shift(self.case, LARGEST_SHIFT_PX, 0)
            pair = write_speckled(self.case, shift, self.replaced, Path(folder))
            group = SPECKLE[self.replaced]
            return _attempt(f"{self.case.name}, {group}", group, pair, workers)


def _attempt(
    name: str, group: str, pair: Pair, workers: int | None, tool: str = "coregister"
) -> Outcome:
    radius_m = search_radius_m(LARGEST_SHIFT_PX)
    return attempt(name, group, pair, workers, tool=tool, search_radius=radius_m)


def write_crossing(reference: RealCase, input: RealCase, folder: Path) -> Pair:
    """Write two images with the same centre and the same pixel size."""
    size, other = np.array(image_size(reference.reference)), np.array(image_size(input.input))
    claimed = compose(REFERENCE_TRANSFORM, Affine.translation(*((size - other) / 2)))
    return Pair(
        write_image(read_image(reference.reference), REFERENCE_TRANSFORM, folder / "reference.tif"),
        write_image(read_image(input.input), claimed, folder / "input.tif"),
    )


def write_speckled(
    case: RealCase, shift_px: tuple[float, float], replaced: str, folder: Path
) -> Pair:
    """Write a pair as `write_case` does, with speckle in place of one image."""
    pair = write_case(case, shift_px, folder)
    path = {"reference": pair.reference, "input": pair.input}[replaced]
    with rasterio.open(path) as source:
        image, transform = source.read(), source.transform
    write_image(speckle(image, np.random.default_rng(len(case.name))), transform, path)
    return Pair(pair.reference, pair.input)


def speckle(image: NDArray[Any], generator: np.random.Generator) -> NDArray[Any]:
    """Return single-look speckle of an image's shape, type and contrast, the same in all bands."""
    amplitude = generator.rayleigh(size=image.shape[1:])
    standard = (amplitude - amplitude.mean()) / amplitude.std()
    values = image.mean() + image.std() * np.broadcast_to(standard, image.shape)
    if image.dtype.kind in "iu":
        limits = np.iinfo(image.dtype)
        values = np.clip(np.rint(values), limits.min, limits.max)
    return values.astype(image.dtype)


def crossings(cases: Sequence[RealCase]) -> list[Crossing]:
    """Return every SAR reference with the input of every other place."""
    sar = [case for case in cases if case.kind in SAR_REFERENCES]
    return [Crossing(a, b) for a in sar for b in cases if a.place != b.place]


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    cases = read_cases(settings.data)
    speckled = [Speckled(case, replaced) for case in cases for replaced in SPECKLE]
    impossible: list[Crossing | Speckled] = [*crossings(cases), *speckled]
    if settings.quick:
        impossible = impossible[::_QUICK_STEP]
    outcomes = run_cases(impossible, settings.jobs)
    return SuiteResult(
        "Images that do not belong together",
        goals(outcomes),
        (counts_by_group(outcomes), what_was_accepted(outcomes)),
        [outcome.record() for outcome in outcomes],
    )


def goals(outcomes: Sequence[Outcome]) -> tuple[Goal, ...]:
    """Return the suite's goal, with its result."""
    wrong, refused = len(accepted(outcomes)), count(outcomes, REFUSED)
    reached = None
    if wrong > 0:
        reached = False
    elif refused >= _AT_LEAST:
        reached = refused == len(outcomes)
    found = f"{wrong} of {len(outcomes)}, {refused} refused"
    return (Goal("Accepted", f"0 of at least {_AT_LEAST}", found, reached),)


def counts_by_group(outcomes: Sequence[Outcome]) -> Table:
    """Return how many were accepted, by the kind of mismatch."""
    rows = [
        [
            name,
            str(len(group)),
            str(len(accepted(group))),
            str(count(group, CRASHED)),
            f"{np.median([o.seconds for o in group]):.1f}",
        ]
        for name, group in by_group(outcomes).items()
    ]
    return Table("By what is wrong", ("images", "pairs", "accepted", "crashed", "median s"), rows)


def what_was_accepted(outcomes: Sequence[Outcome]) -> Table:
    """Return the accepted pairs, all of which should have been refused."""
    rows = [[o.name, o.model, f"{o.claimed_rmse_px:.2f}"] for o in accepted(outcomes)]
    return Table("Accepted", ("images", "model", "claimed RMSE (px)"), rows)
