"""Chips matched by fused similarity, alone and with the support of their neighbours."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from groundtie.context import Context, threads
from groundtie.matching.belief_propagation import Surfaces, propagate
from groundtie.matching.chips import ChipMatcher
from groundtie.matching.matcher import Places
from groundtie.rasters.grid import PointFunction
from groundtie.similarity.peak import find_peak
from groundtie.similarity.surface import SimilaritySettings

from .accuracy import FloatArray
from .cases import SAR_OPTICAL, SAR_SAR, read_cases
from .chips import OFFSETS_PX, RADIUS_PX, SPACING_PX, chip_centres
from .offsets import OffsetPair, Scene, apply_matrix, open_offset
from .simulations import Simulation
from .suites import Goal, Settings, SuiteResult, Table, run_cases

CHIP_PX = 61
WITHIN_PX = 3.0
FUSED = "fused"
SINGLE = ("nmi", "orientation", "edge-strength", "ncc")
# Chips are neighbours of those beside and diagonally opposite them.
REACH_PX = 1.5 * SPACING_PX

# A distortion beyond any model of degree 1: up to 1.6 px from chip to chip.
WAVE_PX, WAVE_LENGTH_PX = 2.5, 300.0

# Settings were compared on seeds 1 to 4.
SIMULATED = tuple((density, seed) for seed in (5, 6) for density in ("rural", "suburban"))
SIZE_PX = 1000

WANTED = {"alone": 0.76, "supported": 0.92}
LARGEST_DEFICIT = 0.03
_HOW = {"alone": "without support", "supported": "with support"}
_REAL, _SIMULATED = "real SAR pairs", "simulated pairs"


@dataclass(frozen=True)
class FusionShare:
    """The share of a pair's chips that one similarity matches.

    Parameters
    ----------
    name, group
        The pair, and the group it is counted in.
    similarity, chips
        The similarity, and the number of chips.
    distorted
        Whether a smooth distortion was injected.
    one_way, alone, supported
        Share of chips within `WITHIN_PX`: reference chips searched for in the input; both
        directions combined; both directions with the support of neighbours.
    """

    name: str
    group: str
    similarity: str
    chips: int
    distorted: bool
    one_way: float
    alone: float
    supported: float


@dataclass(frozen=True)
class FusionShares:
    """The shares of all similarities on one pair."""

    records: tuple[FusionShare, ...]

    def line(self) -> str:
        """Return the shares as a line of text."""
        shares = (
            f"{r.similarity}{' (distorted)' * r.distorted} {r.alone:.0%}, {r.supported:.0%}"
            for r in self.records
        )
        return f"{self.records[0].name}, {self.records[0].chips} chips: {'; '.join(shares)}"


@dataclass(frozen=True)
class FusionCase:
    """All similarities on the chips of one pair."""

    scene: Scene

    def run(self, workers: int | None) -> FusionShares:
        """Match the chips and compare them with the truth."""
        with (
            tempfile.TemporaryDirectory() as folder,
            threads(workers) as context,
            open_offset(self.scene.pair(Path(folder)), self.scene.offset_px(OFFSETS_PX)) as pair,
        ):
            records = [self.share(pair, s, False, context) for s in (FUSED, *SINGLE)]
            records.append(self.share(pair, FUSED, True, context))
        return FusionShares(tuple(records))

    def share(
        self, pair: OffsetPair, similarity: str, distorted: bool, context: Context
    ) -> FusionShare:
        """Return the share of chips that one similarity matches."""
        grid = pair.images.grid
        model = pair.nominal(_distorting(pair) if distorted else None)
        centres = chip_centres(grid, CHIP_PX, grid.width * grid.height)
        matcher = ChipMatcher(pair.images, SimilaritySettings(similarity))
        found = matcher.match(model, Places(grid, centres, CHIP_PX), RADIUS_PX, context)
        shifts = true_shifts(pair, found.centres, distorted)
        both = found.combined
        return FusionShare(
            self.scene.name,
            _SIMULATED if isinstance(self.scene.source, Simulation) else _REAL,
            similarity,
            len(both),
            distorted,
            share_within(found.forward, shifts),
            share_within(both, shifts),
            share_within(propagate(both, found.centres, REACH_PX), shifts),
        )


def wave(px: FloatArray) -> FloatArray:
    """Return a smooth distortion at positions (col, row), shape (n, 2)."""
    x, y = px.T * 2 * np.pi / WAVE_LENGTH_PX
    return WAVE_PX * np.column_stack(
        [np.sin(x + 1) * np.cos(0.6 * y), np.cos(y) * np.cos(0.5 * x + 0.3)]
    )


def _distorting(pair: OffsetPair) -> PointFunction:
    """Return the function from the map to input pixels, including the injected distortion."""
    grid = pair.images.grid

    def to_px(xy: FloatArray) -> FloatArray:
        px = grid.map_to_pixel(xy)
        return apply_matrix(pair.matrix, px - pair.offset_px - wave(px))

    return to_px


def true_shifts(pair: OffsetPair, centres: FloatArray, distorted: bool) -> FloatArray:
    """Return the shifts at which chips should be found, shape (n, 2)."""
    shifts = np.broadcast_to(pair.offset_px, centres.shape)
    if not distorted:
        return shifts
    # The input shows the content of position p where q - offset - wave(q) = p.
    found = centres + shifts
    for _ in range(20):
        found = centres + pair.offset_px + wave(found)
    return found - centres


def share_within(surfaces: Surfaces, shifts: FloatArray) -> float:
    """Return the share of surfaces that peak within `WITHIN_PX` of the true shift."""
    peaks = np.array([find_peak(surface).shift_px for surface in surfaces]).reshape(-1, 2)
    return float(np.mean(np.hypot(*(peaks - shifts).T) <= WITHIN_PX))


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    sar = [case for case in read_cases(settings.data) if case.kind in (SAR_OPTICAL, SAR_SAR)]
    simulations = [Simulation(SIZE_PX, density, seed) for density, seed in SIMULATED]
    sources = [*sar[:2], *simulations[:1]] if settings.quick else [*sar, *simulations]
    shares = run_cases(
        [FusionCase(Scene(source, settings.cache)) for source in sources], settings.jobs
    )
    records = [record for share in shares for record in share.records]
    return SuiteResult(
        "Fused similarity and support",
        goals(records, settings.quick),
        [shares_table(records, how) for how in WANTED],
        [asdict(record) for record in records],
        (
            f"Share of {CHIP_PX} px chips every {SPACING_PX} px whose peak lies within "
            f"{WITHIN_PX:g} px of the truth, search ±{RADIUS_PX} px, both ways. Distorted: a wave "
            f"of {WAVE_PX:g} px and {WAVE_LENGTH_PX:g} px length is injected. Supported peaks are "
            "not independent of one another: verdicts do not count them.",
        ),
    )


def goals(records: Sequence[FusionShare], quick: bool) -> list[Goal]:
    """Return the suite's goals, with their results."""
    found = []
    for group in (_REAL, _SIMULATED):
        for how, wanted in WANTED.items():
            mean = float(np.mean(_values(records, group, FUSED, how)))
            best = np.max([_values(records, group, single, how) for single in SINGLE], axis=0)
            deficit = float(np.max(best - _values(records, group, FUSED, how)))
            names = f"{group}, {_HOW[how]}"
            found += [
                Goal(
                    f"Fused, mean of {names}",
                    f"≥ {wanted:.0%}",
                    f"{mean:.1%}",
                    None if quick else mean >= wanted,
                ),
                Goal(
                    f"Fused below the best single measure on any of {names}",
                    f"≤ {LARGEST_DEFICIT:.0%}",
                    f"{deficit:.1%}",
                    None if quick else deficit <= LARGEST_DEFICIT,
                ),
            ]
    return found


def _values(records: Sequence[FusionShare], group: str, similarity: str, how: str) -> FloatArray:
    return np.array(
        [
            getattr(r, how)
            for r in records
            if r.group == group and r.similarity == similarity and not r.distorted
        ]
    )


def shares_table(records: Sequence[FusionShare], how: str) -> Table:
    """Return the shares of all pairs and similarities."""
    columns = [(FUSED, False), *((single, False) for single in SINGLE), (FUSED, True)]
    rows = []
    for group in (_REAL, _SIMULATED):
        chosen = [r for r in records if r.group == group]
        names = list(dict.fromkeys(r.name for r in chosen))
        shares = np.array(
            [[_share(chosen, name, *column, how) for column in columns] for name in names]
        )
        counts = [next(r.chips for r in chosen if r.name == name) for name in names]
        for name, count, values in zip(names, counts, shares, strict=True):
            rows.append([name, str(count), *(f"{value:.0%}" for value in values)])
        means = shares.mean(axis=0)
        rows.append([f"mean of {group}", str(sum(counts)), *(f"{value:.1%}" for value in means)])
    head = ("pair", "chips", *(s + ", distorted" * d for s, d in columns))
    return Table(f"Matched {_HOW[how]}", head, rows)


def _share(
    records: Sequence[FusionShare], name: str, similarity: str, distorted: bool, how: str
) -> Any:
    key = name, similarity, distorted
    return next(getattr(r, how) for r in records if (r.name, r.similarity, r.distorted) == key)
