"""How far layover and lean draw the similarity of whole scenes away from the ground."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import groundtie

from .city import city
from .simulations import Simulation
from .suites import Settings, SuiteResult, Table, run_cases

SIMILARITIES = ("nmi", "orientation", "fused")
RADIUS_PX = 40
_CHIP_PX = 901
_QUICK_SEEDS = 1


@dataclass(frozen=True)
class Drawn:
    """Where a whole scene's similarity peaks, though its images lie as they should."""

    seed: int
    similarity: str
    right_px: float
    down_px: float
    height: float

    @property
    def error_px(self) -> float:
        """How far the peak is from the truth."""
        return math.hypot(self.right_px, self.down_px)

    @property
    def along_px(self) -> float:
        """How far it is along the line that heights displace along: no more than the error."""
        right, down = height_line(self.seed)
        return abs(self.right_px * right + self.down_px * down)

    @property
    def across_px(self) -> float:
        """How far it is across that line, where heights displace nothing."""
        return math.sqrt(max(self.error_px**2 - self.along_px**2, 0.0))


@dataclass(frozen=True)
class Peaks:
    """The peaks of one scene."""

    records: tuple[Drawn, ...]

    def line(self) -> str:
        """Return the peaks as a line of text."""
        peaks = (f"{r.similarity} {r.right_px:.1f}, {r.down_px:.1f}" for r in self.records)
        return f"city, seed {self.records[0].seed}: {'; '.join(peaks)}"


@dataclass(frozen=True)
class LayoverCase:
    """A city without misregistration."""

    seed: int
    cache: Path

    def run(self, workers: int | None) -> Peaks:
        """Make the pair if need be and find the peaks."""
        pair = aligned_city(self.seed).pair(self.cache)
        records = []
        with tempfile.TemporaryDirectory() as folder:
            for similarity in SIMILARITIES:
                peak = groundtie.similarity_surface(
                    pair.reference,
                    pair.input,
                    Path(folder) / "surface.tif",
                    chip_size=_CHIP_PX,
                    search_radius=float(RADIUS_PX),
                    similarity=similarity,
                    workers=workers,
                ).peak
                records.append(Drawn(self.seed, similarity, *peak.shift_px, peak.height))
        return Peaks(tuple(records))


def aligned_city(seed: int) -> Simulation:
    """Return the city of a seed, seen from where `city` is, its ground registered."""
    made = city(seed)
    return replace(made, shift=0.0, further=(*made.further, ("distortion", "shift")))


def height_line(seed: int) -> tuple[float, float]:
    """Return the direction (right, down) of roofs between the images of a city, of length 1.

    Layover by h / tan(incidence) towards the radar, relief displacement by h · tan(off-nadir angle)
    away from the camera.
    """
    view: dict[str, Any] = dict(city(seed).further)
    towards_radar = -1.0 if view["orbit"] == "ascending" else 1.0
    azimuth, lean = math.radians(view["view_azimuth"]), math.tan(math.radians(view["off_nadir"]))
    right = towards_radar / math.tan(math.radians(view["incidence"])) + lean * math.sin(azimuth)
    down = -lean * math.cos(azimuth)
    length = math.hypot(right, down)
    return right / length, down / length


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    seeds = range(1, 1 + (_QUICK_SEEDS if settings.quick else settings.seeds))
    found = run_cases([LayoverCase(seed, settings.cache) for seed in seeds], settings.jobs)
    records = [record for peaks in found for record in peaks.records]
    return SuiteResult(
        "Layover in a simulated dense city",
        (),
        (peaks_table(records),),
        [{**asdict(record), "error_px": record.error_px} for record in records],
        (
            f"Peaks of windows of {_CHIP_PX}×{_CHIP_PX} px within ± {RADIUS_PX} px, without mask, "
            "of images whose ground lies as it should.",
        ),
    )


def peaks_table(records: Sequence[Drawn]) -> Table:
    """Return a table of how far the peaks are from the truth."""
    head = (
        "similarity",
        "median (px)",
        "along the line of heights (px)",
        "across it (px)",
        "largest (px)",
        "within 1 px",
        "within 3 px",
        "seeds",
    )
    rows = []
    for similarity in SIMILARITIES:
        own = [record for record in records if record.similarity == similarity]
        errors, along, across = (
            np.array([of(record) for record in own])
            for of in (lambda r: r.error_px, lambda r: r.along_px, lambda r: r.across_px)
        )
        shares = (f"{np.mean(errors <= limit):.0%}" for limit in (1, 3))
        medians = (f"{np.median(values):.1f}" for values in (errors, along, across))
        size = (*medians, f"{errors.max():.1f}")
        rows.append([similarity, *size, *shares, str(len(errors))])
    return Table("Where whole scenes peak", head, rows)
