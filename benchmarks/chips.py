"""The share of a pair's chips that each similarity matches."""

from __future__ import annotations

import math
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from groundtie.context import Context, threads
from groundtie.matching.chips import ChipMatcher
from groundtie.matching.matcher import Places
from groundtie.rasters.grid import Grid, mesh
from groundtie.similarity.description import BORDER_PX
from groundtie.similarity.peak import find_peak
from groundtie.similarity.surface import SIMILARITIES, SimilaritySettings

from .offsets import OffsetPair, Scene, open_offset

# The true peak lies off the centre of the surface, which a method might prefer.
OFFSETS_PX = (2.0, 6.0)
CHIPS_PX = (61, 101, 201)
RADIUS_PX = 12
LIMITS_PX = (1.5, 3.0)
SPACING_PX = 30


@dataclass(frozen=True)
class ChipShare:
    """The share of a pair's chips that one similarity matches.

    Parameters
    ----------
    name, group
        The pair.
    similarity, chip_px
        The similarity, and the size of the chips.
    chips
        Number of chips.
    shares
        Share of the chips within each of `LIMITS_PX` of the truth; empty without chips.
    milliseconds
        Time per chip, including reading.
    """

    name: str
    group: str
    similarity: str
    chip_px: int
    chips: int
    shares: tuple[float, ...]
    milliseconds: float


@dataclass(frozen=True)
class ChipShares:
    """The shares of all similarities on one pair."""

    records: tuple[ChipShare, ...]

    def line(self) -> str:
        """Return the shares of the smallest chips as a line of text."""
        first = [record for record in self.records if record.chip_px == CHIPS_PX[0]]
        shares = (f"{r.similarity} {r.shares[-1]:.0%}" for r in first if r.shares)
        return f"{first[0].name}, {first[0].chips} chips: {', '.join(shares)}"


@dataclass(frozen=True)
class ChipCase:
    """All similarities on the chips of one pair."""

    scene: Scene
    most_chips: int

    def run(self, workers: int | None) -> ChipShares:
        """Match the chips and compare them with the truth."""
        with (
            tempfile.TemporaryDirectory() as folder,
            threads(workers) as context,
            open_offset(self.scene.pair(Path(folder)), self.scene.offset_px(OFFSETS_PX)) as pair,
        ):
            records = [
                self.share(pair, similarity, chip_px, context)
                for chip_px in CHIPS_PX
                for similarity in SIMILARITIES
            ]
        return ChipShares(tuple(records))

    def share(self, pair: OffsetPair, similarity: str, chip_px: int, context: Context) -> ChipShare:
        """Return the share of chips of one size that a similarity matches."""
        grid = pair.images.grid
        matcher = ChipMatcher(pair.images, SimilaritySettings(similarity))
        # Larger chips take longer, and overlap more.
        most = self.most_chips * CHIPS_PX[0] // chip_px
        places = Places(grid, chip_centres(grid, chip_px, most), chip_px)
        started = time.perf_counter()
        images = matcher.resampled(pair.nominal(), grid, RADIUS_PX, context)
        _, surfaces = matcher.match_forward(images, places, RADIUS_PX, context)
        seconds = time.perf_counter() - started
        count = len(surfaces)
        errors = np.array([math.dist(find_peak(s).shift_px, pair.offset_px) for s in surfaces])
        within = (float(np.mean(errors <= limit)) for limit in LIMITS_PX)
        return ChipShare(
            self.scene.name,
            self.scene.group,
            similarity,
            chip_px,
            count,
            tuple(within) if count else (),
            1e3 * seconds / max(count, 1),
        )


def chip_centres(grid: Grid, chip_px: int, most: int) -> NDArray[np.int_]:
    """Return centres (col, row) of chips every `SPACING_PX`, evenly thinned to at most `most`."""
    margin = chip_px // 2 + RADIUS_PX + BORDER_PX
    sides = [np.arange(margin, size - margin, SPACING_PX) for size in (grid.width, grid.height)]
    centres = mesh(*sides)
    if len(centres) <= most:
        return centres
    return centres[np.linspace(0, len(centres) - 1, most).round().astype(int)]
