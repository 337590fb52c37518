"""How far layover and relief displacement draw the similarity of whole scenes off the ground.

The same for the supposed ground alone, by grey levels and by colour classes, with its darkest
pixels, which are radar shadow, and without. Also the errors of directions inferred from the images.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import groundtie
from groundtie.context import threads
from groundtie.geometry.models import shift_model
from groundtie.masks.ground import find_ground
from groundtie.masks.scene import Scene
from groundtie.masks.shadow_direction import shadow_azimuth_deg
from groundtie.matching.matcher import Places
from groundtie.matching.pooled import PooledHistogramMatcher
from groundtie.rasters.grid import Grid
from groundtie.simulation.optical import OpticalOptions

from .attempt import Pair
from .city import city
from .masks import masked_by, opened
from .simulations import Simulation
from .suites import Settings, SuiteResult, Table, run_cases

SIMILARITIES = ("nmi", "orientation", "fused")
RADIUS_PX = 40

# The ground alone; whether it is matched by colours.
GROUND = {"ground, grey levels": False, "ground, colours": True}
_GROUND_RADIUS_PX, _GROUND_CHIP_PX = 10, 80

# Inference of shadow directions: outer percentages of the histogram, farthest pixels.
_SHADOWS = 15.0, 14

# Start of the search on the ground, right and down of the truth; and the number of rounds, as its
# joint histogram improves with every round.
_START_PX, _ROUNDS = (2.0, 2.0), 3
_CHIP_PX = 901


@dataclass(frozen=True)
class Drawn:
    """The peak of a whole scene's similarity where the images are aligned."""

    seed: int
    similarity: str
    right_px: float
    down_px: float
    height: float

    @property
    def error_px(self) -> float:
        """Distance of the peak from the truth."""
        return math.hypot(self.right_px, self.down_px)

    @property
    def along_px(self) -> float:
        """Its component along the line of relief displacement: at most the error."""
        right, down = height_line(self.seed)
        return abs(self.right_px * right + self.down_px * down)

    @property
    def across_px(self) -> float:
        """Its component across that line, where heights displace nothing."""
        return math.sqrt(max(self.error_px**2 - self.along_px**2, 0.0))


@dataclass(frozen=True)
class Directions:
    """Errors in degrees of directions inferred from the images."""

    range_deg: float
    sun_deg: float


@dataclass(frozen=True)
class Peaks:
    """The peaks of one scene."""

    records: tuple[Drawn, ...]
    directions: Directions

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
        """Make the pair if needed, and find the peaks."""
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
        ground, directions = of_ground(self.seed, pair)
        return Peaks((*records, *ground), directions)


def of_ground(seed: int, pair: Pair) -> tuple[list[Drawn], Directions]:
    """Return the peaks on a city's ground without misregistration, and the errors of directions."""
    found = []
    with ExitStack() as stack:
        context = stack.enter_context(threads(1))
        images = opened(pair, stack)
        scene = Scene.of(images.reference.source)
        camera = Scene.of(images.input.source)
        azimuths = [shadow_azimuth_deg(one.read(one.whole), *_SHADOWS) for one in (scene, camera)]
        masked = masked_by(images, scene, find_ground(scene).select, stack)
        for name, is_coloured in GROUND.items():
            matcher = PooledHistogramMatcher.of(masked, _GROUND_CHIP_PX, nothing_hidden)
            if not is_coloured:
                matcher = replace(matcher, colours=None)
            places, at = Places.tiles(masked.grid, _GROUND_CHIP_PX), np.array(_START_PX)
            for _ in range(_ROUNDS):
                # Pixels are of 1 m; rows run south.
                model = shift_model(at[0], -at[1])
                surfaces = matcher.match(model, places, _GROUND_RADIUS_PX, context)
                at = at + surfaces.common_shift_px
            found.append(Drawn(seed, name, float(at[0]), float(at[1]), 0.0))
    # Radar shadow falls away from the radar, a cast shadow away from the sun.
    away = 90.0 if dict(city(seed).further)["orbit"] == "ascending" else 270.0
    of_sun = OpticalOptions().sun_azimuth_deg + 180
    return found, Directions(_apart_deg(azimuths[0], away), _apart_deg(azimuths[1], of_sun))


def nothing_hidden(grid: Grid) -> np.ndarray:
    """Return which pixels of a grid are hidden: none."""
    return np.zeros((grid.height, grid.width), bool)


def _apart_deg(one: float, other: float) -> float:
    return abs((one - other + 180) % 360 - 180)


def aligned_city(seed: int) -> Simulation:
    """Return the city of a seed with the views of `city`, but with its ground aligned."""
    made = city(seed)
    return replace(made, shift=0.0, further=(*made.further, ("distortion", "shift")))


def height_line(seed: int) -> tuple[float, float]:
    """Return the unit vector (right, down) along which roofs are displaced between a city's images.

    Layover displaces them by h / tan(incidence) towards the radar, relief displacement by
    h · tan(off-nadir angle) away from the camera.
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
    cases = [LayoverCase(seed, settings.cache) for seed in settings.seed_numbers()]
    found = run_cases(cases, settings.jobs)
    records = [record for peaks in found for record in peaks.records]
    return SuiteResult(
        "Layover in a simulated dense city",
        (),
        (peaks_table(records), directions_table([peaks.directions for peaks in found])),
        [{**asdict(record), "error_px": record.error_px} for record in records],
        (
            f"Peaks of windows of {_CHIP_PX}×{_CHIP_PX} px within ± {RADIUS_PX} px, without mask, "
            "of images whose ground lies as it should; of the ground alone by one joint histogram, "
            f"within ± {_GROUND_RADIUS_PX} px.",
        ),
    )


def peaks_table(records: Sequence[Drawn]) -> Table:
    """Return a table of the distances of the peaks from the truth."""
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
    for similarity in dict.fromkeys(record.similarity for record in records):
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


def directions_table(directions: Sequence[Directions]) -> Table:
    """Return a table of the errors of inferred directions."""
    head = ("direction inferred from", "median (°)", "largest (°)", "seeds")
    rows = []
    for name, of in (
        ("radar shadow: range", lambda one: one.range_deg),
        ("cast shadows: sun", lambda one: one.sun_deg),
    ):
        off = [of(one) for one in directions]
        rows.append([name, f"{np.median(off):.0f}", f"{max(off):.0f}", str(len(off))])
    return Table("Directions", head, rows)
