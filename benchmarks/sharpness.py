"""How sharply edges and steps coincide, for aligned ground and for drawn content over other ground.

Aligned ground comes from all scenes of the red team; from different bands of the shared series, of
one date and of neighbouring dates, which show one ground in other colours; from dates of simulated
series; and from despeckled radar images, which cannot be told from camera images, with camera
images.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import partial
from itertools import combinations, pairwise, product
from pathlib import Path
from typing import Any

import numpy as np

from groundtie.context import threads
from groundtie.geometry.transform import Transform
from groundtie.kinds import plain
from groundtie.matching.chip_windows import Resampled
from groundtie.matching.locked import EXACT_PX, find_locked_content
from groundtie.matching.shared_content import Sensors
from groundtie.matching.survey import survey_places
from groundtie.rasters.pair import Image, make_pair
from groundtie.rasters.reading import open_raster
from groundtie.series.frame import PARAMETERS, SeriesFrame
from groundtie.similarity.in_common import (
    FINE_COHERENCE,
    LEAST_AREA,
    LEAST_SHARPNESS,
    MOST_BESIDE,
    VIEW_SHARPNESS,
    Sameness,
)
from groundtie.similarity.seams import DRAWN_WIDTH
from groundtie.speckle.filters import SpeckleFilter

from .accuracy import FloatArray
from .attacks.cases import AttackCase, all_scenes, cases
from .attacks.catalogue import LOCKED
from .attacks.examples import is_example
from .attacks.pairs import Pair, to_bytes
from .attacks.scenes import Scene
from .attacks.suite import sample
from .cases import SAR_OPTICAL, SAR_SAR
from .series_scenes import simulate_series
from .suites import Goal, Settings, SuiteResult, Table, by_group, run_cases

_QUICK, _SAMPLE = 4, 60
BANDS_OF_ONE, BANDS_APART = "bands of one exposure", "bands, years apart"
DESPECKLED = "despeckled radar with camera"
SIMULATED_DATES, DATES = "simulated dates of one camera", "dates of one camera, years apart"

# Seeds that the series suite does not use, and the number of dates of each.
_SERIES_SEEDS, _DATES = range(4, 9), 5

_NOWHERE = np.zeros(PARAMETERS)


@dataclass(frozen=True)
class Measured:
    """The similarities of two arrays in alignment.

    Parameters
    ----------
    name
        Scene and seed, or attack.
    group
        Group of the pair.
    is_drawn
        Whether something is drawn over ground that is displaced.
    sameness
        The measured similarities.
    """

    name: str
    group: str
    is_drawn: bool
    sameness: Sameness

    def line(self) -> str:
        """Return the measurement as a line of text."""
        return f"{self.name} ({self.group}): {self.sameness.sharpness:.2f}"

    def record(self) -> dict[str, Any]:
        """Return the measurement as values that JSON can carry."""
        return {**asdict(self), "sameness": plain(asdict(self.sameness))}


@dataclass(frozen=True)
class Case:
    """A pair whose arrays coincide pixel by pixel."""

    name: str
    group: str
    is_drawn: bool
    make: Callable[[], Pair]

    def run(self, workers: int | None) -> Measured:
        """Make the pair and measure it."""
        with tempfile.TemporaryDirectory() as folder:
            self.make().save(Path(folder))
            images = Path(folder) / "r.tif", Path(folder) / "i.tif"
            return Measured(self.name, self.group, self.is_drawn, _sameness(*images, workers))


@dataclass(frozen=True)
class Bands:
    """One band of each of two rasters on one grid."""

    reference: Path
    input: Path
    band: int
    other_band: int

    def run(self, workers: int | None) -> Measured:
        """Measure."""
        group = BANDS_OF_ONE if self.reference == self.input else BANDS_APART
        if self.band == self.other_band:
            group = DATES
        name = f"{self.reference.stem} {self.band}, {self.input.stem} {self.other_band}"
        with tempfile.TemporaryDirectory() as folder:
            # A copy, as a raster is not compared with itself.
            images = self.reference, Path(shutil.copy(self.input, folder))
            bands = self.band, self.other_band
            return Measured(name, group, False, _sameness(*images, workers, *bands))


@dataclass(frozen=True)
class Dates:
    """A date of a simulated series, and its first date."""

    seed: int
    date: int
    cache: Path

    def run(self, workers: int | None) -> Measured:
        """Simulate the series and measure the dates."""
        with tempfile.TemporaryDirectory() as folder:
            series = simulate_series(Path(folder), self.cache, self.seed, _DATES, ())
            images = series.files[0], series.files[self.date]
            displacement = series.displacement_px[self.date]
            sameness = _sameness(*images, workers, displacement=displacement)
        name = f"series {self.seed}, date {self.date}"
        return Measured(name, SIMULATED_DATES, False, sameness)


def _sameness(
    reference: Path,
    input: Path,
    workers: int | None,
    band: int | None = None,
    other_band: int | None = None,
    displacement: FloatArray = _NOWHERE,
) -> Sameness:
    with (
        open_raster(reference) as one,
        open_raster(input) as other,
        threads(workers) as context,
    ):
        pair = make_pair(Image(one, band), Image(other, other_band))
        model = SeriesFrame.around(pair.grid, [pair.grid]).model(displacement)
        truth = Transform(model, pair.grid.crs, other.grid)
        places = survey_places(pair.grid)
        images = Resampled(pair, truth)
        locked = find_locked_content(images, truth, places, Sensors.CAMERAS, EXACT_PX, context)
    if locked is None:
        raise ValueError("the arrays do not lie on one another")
    return locked.shared.sameness


def _despeckled(scene: Scene, seed: int, cache: Path) -> Pair:
    """Return a scene's pair, its radar image smoothed by a speckle filter."""
    pair = scene.pair(seed, cache)
    amplitude = pair.reference[0].astype(np.float32)
    power = SpeckleFilter("enhanced-frost", 7, 1.0)(amplitude**2, amplitude > 0)
    return replace(pair, reference=to_bytes(np.sqrt(power)[None]))


def bands_of_series(folder: Path) -> list[Bands]:
    """Return pairs of bands of one date, and of dates on one grid."""
    found = []
    for dates in ("fields", "river"):
        files = sorted((folder / "series" / dates).glob("*.tif"))
        found += [Bands(file, file, band, 4) for file in files for band in (1, 3)]
        if dates == "river":
            neighbours = list(pairwise(files))
            found += [Bands(one, other, band, 4) for one, other in neighbours for band in (1, 3)]
            every = combinations(files, 2)
            found += [Bands(one, other, band, band) for one, other in every for band in (1, 4)]
    return found


def run(settings: Settings) -> SuiteResult:
    """Measure all aligned ground, and `--sample` drawn pairs."""
    seeds = range(settings.first_seed, settings.first_seed + settings.seeds)
    bands = bands_of_series(settings.data)
    dates = [Dates(*at, settings.cache) for at in product(_SERIES_SEEDS, range(1, _DATES))]
    scenes: list[Case | Bands | Dates] = [
        *(bands[:1] if settings.quick else [*bands, *dates]),
        *(
            Case(f"{name} {seed}", scene.kind, False, partial(scene.pair, seed, settings.cache))
            for name, scene in all_scenes(settings.data).items()
            if not (is_example(scene) or scene.is_large)
            for seed in seeds
        ),
        *(
            Case(
                f"{name} {seed}",
                DESPECKLED,
                False,
                partial(_despeckled, scene, seed, settings.cache),
            )
            for name, scene in all_scenes(settings.data).items()
            if scene.kind == SAR_OPTICAL and not (is_example(scene) or scene.is_large)
            for seed in seeds
        ),
    ]
    drawn = [
        case
        for case in cases(seeds, settings.data, settings.cache)
        if isinstance(case, AttackCase) and case.group == LOCKED and case.tool == "coregister"
    ]
    wanted = _QUICK if settings.quick else settings.sample or _SAMPLE
    attacked = [
        Case(case.name, case.attack, True, case.make)
        for case in sample(drawn, wanted)
        if isinstance(case, AttackCase)
    ]
    every: list[Measured] = list(
        run_cases(scenes[:: len(scenes) // _QUICK] if settings.quick else scenes, settings.jobs)
    )
    every += run_cases(attacked, settings.jobs)
    found = [one for one in every if one.is_drawn]
    despeckled = [one for one in every if one.group == DESPECKLED]
    placed = [one for one in every if not one.is_drawn and one.group != DESPECKLED]
    ground = [one for one in placed if not _is_explained(one)]
    views = [one for one in placed if one.group == DATES or _is_explained(one)]
    apart = [one for one in ground if one.group not in (BANDS_OF_ONE, SIMULATED_DATES)]
    most, most_of_one = (
        max((one.sameness.sharpness for one in some), default=0.0) for some in (apart, ground)
    )
    most_beside = max((one.sameness.beside for one in placed), default=0.0)
    others = [one for one in apart if one.group not in (BANDS_APART, DATES)]
    least = min((one.sameness.step_width for one in others), default=np.inf)
    most_coarse = max((one.sameness.coarse_area for one in despeckled), default=0.0)
    radars = [one.sameness for one in placed if one.group == SAR_SAR]
    finer = [one.fine_coherence for one in radars if one.fine_coherence > one.coarse_coherence]
    most_fine = max(finer, default=0.0)
    return SuiteResult(
        "How sharply edges coincide",
        (
            Goal(
                "Ground at its place, but of one sensor",
                f"below {LEAST_SHARPNESS:g}",
                f"at most {most:.2f}",
                most < LEAST_SHARPNESS,
            ),
            Goal(
                "The same with one exposure's bands, and simulated dates",
                f"below {VIEW_SHARPNESS:g}",
                f"at most {most_of_one:.2f}",
                most_of_one < VIEW_SHARPNESS,
            ),
            Goal(
                "Edges to one side for each on one another, of all ground at its place",
                f"at most {MOST_BESIDE:g}",
                f"at most {most_beside:.2f}",
                most_beside <= MOST_BESIDE,
            ),
            Goal(
                "Steps between columns or rows, of different sensors' ground at its place",
                f"wider than {DRAWN_WIDTH:g}",
                f"at least {least:.2f}",
                least > DRAWN_WIDTH,
            ),
            Goal(
                "Coarse pixels alike of a despeckled radar's and a camera's images",
                f"below {LEAST_AREA:.0%}",
                f"at most {most_coarse:.0%}",
                most_coarse < LEAST_AREA,
            ),
            Goal(
                "Coherence of fine structure of two radar images where it exceeds that of coarse",
                f"below {FINE_COHERENCE:g}",
                f"at most {most_fine:.2f}",
                most_fine < FINE_COHERENCE,
            ),
        ),
        (
            _table("Ground at its place", [*ground, *despeckled]),
            _views_table("Copies, one camera's views and its dates at their place", views),
            _table("Drawn over other ground", found),
            _steps_table("Steps between columns or rows, ground at its place", ground),
            _steps_table("Steps between columns or rows, drawn over other ground", found),
            _coherence_table("Coherence, ground at its place", placed),
        ),
        [one.record() for one in every],
    )


def _is_explained(one: Measured) -> bool:
    return one.sameness.is_copy or one.sameness.is_view


def _by_group(some: list[Measured]) -> list[tuple[str, list[Sameness]]]:
    return [(group, [one.sameness for one in own]) for group, own in sorted(by_group(some).items())]


def _views_table(title: str, some: list[Measured]) -> Table:
    rows = []
    for group, own in _by_group(some):
        coarse = [one.coarse_area / one.reduced_area for one in own]
        sharpness = [one.sharpness for one in own]
        alike = min(one.coarse_area for one in own)
        least = (
            *(min(sharpness), max(sharpness)),
            *(min(one.ground for one in own), min(coarse), alike),
        )
        rows.append([group, str(len(own)), *(f"{number:.2f}" for number in least)])
    columns = (
        *("", "pairs", "least sharp", "sharpest", "least ground", "least in coarser pixels"),
        "least coarse pixels alike",
    )
    return Table(title, columns, rows)


def _steps_table(title: str, some: list[Measured]) -> Table:
    rows = []
    for group, own in _by_group(some):
        widths = [one.step_width for one in own]
        numbers = f"{min(widths):.2f}", f"{np.median(widths):.2f}"
        rows.append([group, str(len(own)), *numbers, str(sum(one.has_seams for one in own))])
    return Table(title, ("", "pairs", "least width", "median", "at the limit or below"), rows)


def _coherence_table(title: str, some: list[Measured]) -> Table:
    rows = []
    for group, own in _by_group(some):
        values = [[one.coarse_coherence, one.fine_coherence] for one in own]
        (coarse, fine), (most_coarse, most_fine) = np.min(values, axis=0), np.max(values, axis=0)
        ranges = f"{coarse:.2f} to {most_coarse:.2f}", f"{fine:.2f} to {most_fine:.2f}"
        finer = [fine for coarse, fine in values if fine > coarse]
        found = f"{len(finer)}, of up to {max(finer):.2f}" if finer else "none"
        rows.append([group, str(len(own)), *ranges, found])
    columns = ("", "pairs", "coarse structure", "fine structure", "fine structure the higher")
    return Table(title, columns, rows)


def _table(title: str, some: list[Measured]) -> Table:
    rows = []
    for group, own in _by_group(some):
        values = [one.sharpness for one in own]
        above = sum(value >= LEAST_SHARPNESS for value in values)
        evident = sum(one.is_evident for one in own)
        low, middle, high = np.percentile(values, [0, 50, 100])
        beside = [one.beside for one in own]
        coarse = [one.coarse_area for one in own]
        numbers = f"{low:.2f}", f"{middle:.2f}", f"{high:.2f}", str(above), f"{max(beside):.2f}"
        alike = f"{min(coarse):.2f} to {max(coarse):.2f}"
        rows.append([group, str(len(values)), *numbers, alike, str(evident)])
    columns = (
        *("", "pairs", "least", "median", "most", "at the limit or above"),
        *("most to one side", "coarse pixels alike", "evident in all"),
    )
    return Table(title, columns, rows)
