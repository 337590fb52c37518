"""Whole registrations by match_optical: matching pairs, and pairs of different places."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from .attempt import Outcome, Pair, attempt
from .cases import RealCase, draw_shift, search_radius_m, write_case
from .crossings import Crossing
from .real import LARGEST_SHIFT_PX
from .rotated_pairs import STRIDES, RotatedCase

TOOL = "match_optical"
FREE_CROSSING = "another place, without georeferencing"


@dataclass(frozen=True)
class RegistrationCase:
    """A pair that match_optical registers: georeferenced with a wrong shift."""

    case: RealCase

    def run(self, workers: int | None) -> Outcome:
        """Register the pair and judge the result."""
        case = self.case
        with tempfile.TemporaryDirectory() as folder:
            return attempt(
                case.name,
                case.kind,
                write_case(case, draw_shift(case, LARGEST_SHIFT_PX, 0), Path(folder)),
                workers,
                tool=TOOL,
                search_radius=search_radius_m(LARGEST_SHIFT_PX),
            )


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
    pairs = [
        (case, cases[(index + stride) % len(cases)])
        for index, case in enumerate(cases)
        for stride in STRIDES
    ]
    return [Crossing(one, other, TOOL) for one, other in pairs if one.place != other.place]
