"""Series of many dates: their mutual consistency, the dates left out, and the processing time."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import rasterio

import groundtie
from groundtie.errors import NotRegisteredError
from groundtie.kinds import plain

from .accuracy import CORRECT, REFUSED, Truth, lattice
from .attempt import Outcome, Pair, attempt
from .processes import OUTPUT, measure
from .series_scenes import SimulatedSeries, pairwise_px, simulate_series, write_moved
from .suites import Goal, Settings, SuiteResult, Table

_DATES, _BAD = 20, (4, 13, 8, 17)
_LARGEST_PX, _LARGEST_SHARE, _MOST_REFUSED = 0.3, 0.6, 0.1
_TIMED_DATES = 10
_MOST_SEEDS = 3

# Bands in which every two real dates on one grid are registered, and the expected consistency of
# these dates in pixels, as Landsat's level 2 has it.
_BANDS, _GRID_PX = (1, 4), 0.5

# Known shifts added to the georeferencing of real dates, in pixels.
_INJECTED_PX = (
    (0, 0),
    (3, -2),
    (-5, 4),
    (0.4, 7.3),
    (-8.6, -1.2),
    (2, 2),
    (-1, 6),
    (9, -9),
    (4, 0),
)


@dataclass(frozen=True)
class Run:
    """The outcome of one series.

    Parameters
    ----------
    name
        Name of the series.
    good, registered, silently_wrong
        Number of dates that belong to the series; number of these that were registered, including
        the reference; number of dates registered wrong by more than 0.3 px, or not belonging.
    bad, named
        Number of dates that do not belong, and number of these that were named.
    largest_px, median_px
        Error between two good dates against the truth, rms; NaN: unknown truth.
    pairs, refused
        Number of registrations tried between good dates, and number of these that were refused.
    loops, closed, loop_median_px, loop_largest_px
        Statistics of the loops.
    """

    name: str
    good: int
    registered: int
    silently_wrong: int
    bad: int
    named: int
    largest_px: float
    median_px: float
    pairs: int
    refused: int
    loops: int
    closed: int
    loop_median_px: float
    loop_largest_px: float


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    runs, gridded = [*_simulated(settings), *_real(settings)], _on_one_grid(settings)
    share, seconds = (np.nan, (np.nan, np.nan)) if settings.quick else _time(settings)
    simulated = [one for one in runs if one.name.startswith("simulated")]
    refused, tried = sum(one.refused for one in runs), sum(one.pairs for one in runs)
    wrong = sum(one.silently_wrong for one in runs)
    wrong += sum(one.verdict not in (CORRECT, REFUSED) for one in gridded)
    correct = sum(one.verdict == CORRECT for one in gridded)
    widest = max(one.largest_px for one in runs if np.isfinite(one.largest_px))
    goals = (
        Goal(
            "good dates of each other",
            f"≤ {_LARGEST_PX} px",
            f"{widest:.2f} px at most",
            widest <= _LARGEST_PX,
        ),
        Goal(
            "good dates registered",
            "all",
            f"{sum(one.registered for one in simulated)} of {sum(one.good for one in simulated)}",
            all(one.registered == one.good for one in simulated),
        ),
        Goal(
            "dates of other places or under clouds named",
            "all",
            f"{sum(one.named for one in runs)} of {sum(one.bad for one in runs)}",
            all(one.named == one.bad for one in runs),
        ),
        Goal(
            "silently wrong",
            "0",
            str(wrong),
            wrong == 0,
        ),
        Goal(
            "registrations of two good dates refused",
            f"at most {_MOST_REFUSED:.0%}",
            f"{refused} of {tried}",
            refused <= _MOST_REFUSED * tried,
        ),
        Goal(
            "real dates on one grid, each two, band by band: correct",
            f"{1 - _MOST_REFUSED:.0%}",
            f"{correct} of {len(gridded)}",
            correct >= (1 - _MOST_REFUSED) * len(gridded),
        ),
        Goal(
            f"{_TIMED_DATES} dates against {_TIMED_DATES} calls of coregister, processor time",
            f"≤ {_LARGEST_SHARE:.0%}",
            "–" if settings.quick else f"{share:.0%} ({seconds[0]:.0f} of {seconds[1]:.0f} s)",
            None if settings.quick else share <= _LARGEST_SHARE,
        ),
    )
    head = ("series", "good", "registered", "silently wrong", "bad", "named", "largest (px)")
    head += ("median (px)", "pairs refused", "loops that close", "median (px)", "largest (px)")
    table = Table("Series", head, [_row(one) for one in runs])
    records = [plain(asdict(one)) for one in (*runs, *gridded)]
    return SuiteResult("Series", goals, (table,), records)


def _simulated(settings: Settings) -> list[Run]:
    count, bad = (7, (2, 4)) if settings.quick else (_DATES, _BAD)
    runs = []
    for seed in settings.seed_numbers(_MOST_SEEDS):
        with tempfile.TemporaryDirectory() as folder:
            series = simulate_series(Path(folder) / "dates", settings.cache, seed, count, bad)
            for reference in (series.files[0], None):
                kind = "to date 1" if reference else "without reference"
                name = f"simulated, seed {seed}, {kind}"
                runs.append(_judged(name, series, reference, Path(folder) / kind))
                print(runs[-1], flush=True)
    return runs


def _judged(name: str, series: SimulatedSeries, reference: Path | None, out: Path) -> Run:
    found = groundtie.register_series(out, [series.files[0].parent], reference=reference)
    stems = [path.stem for path in series.files]
    placed = {one.name: one.verdict.displacement for one in found.dates if one.transform}
    good = [k for k in series.good if stems[k] in placed]
    errors = np.array([placed[stems[k]] - series.displacement_px[k] for k in good])
    apart = pairwise_px(errors)
    # A date is wrong if it differs from most of the others.
    wrong = int((np.median(apart, axis=1) > _LARGEST_PX).sum())
    bad = {stems[k] for k in (*series.elsewhere, *series.cloudy)}
    named = bad & {one.name for one in found.left_out}
    pairs = apart[np.triu_indices(len(good), 1)]
    return Run(
        name,
        len(series.good),
        len(good),
        wrong + len(bad) - len(named),
        len(bad),
        len(named),
        float(pairs.max()),
        float(np.median(pairs)),
        *_network(found, {stems[k] for k in series.good}),
    )


def _real(settings: Settings) -> list[Run]:
    folder = settings.data / "series"
    if not folder.is_dir():
        return []
    fields, river = (sorted((folder / name).glob("*.tif")) for name in ("fields", "river"))
    with tempfile.TemporaryDirectory() as scratch:
        plain = Path(scratch)
        if settings.quick:
            return [_as_it_is("river", river[:3], plain / "river")]
        return [
            _as_it_is("river", river, plain / "river"),
            _as_it_is("fields", fields, plain / "fields"),
            _injected(fields, plain),
        ]


def _as_it_is(name: str, files: list[Path], out: Path) -> Run:
    found = _registered(out, files)
    placed = sum(one.transform is not None for one in found.dates)
    network = _network(found, {path.stem for path in files})
    return Run(name, len(files), placed, 0, 0, 0, np.nan, np.nan, *network)


def _injected(files: list[Path], scratch: Path) -> Run:
    """Register dates unchanged, and with known shifts and two dates of another place."""
    before = _displacements(_registered(scratch / "before", files))
    moved = scratch / "moved"
    moved.mkdir()
    shifts = dict(zip([path.stem for path in files], _INJECTED_PX, strict=False))
    dates = [write_moved(path, moved / path.name, shifts.get(path.stem, (0, 0))) for path in files]
    names = [f"elsewhere_{year}" for year in (2011, 2019)]
    for name, path in zip(names, files[2:4], strict=True):
        dates.append(_mirrored(path, moved / f"{name}.tif"))
    found = _registered(scratch / "after", dates)
    after = _displacements(found)
    both = sorted(before.keys() & after.keys())
    errors = np.array([after[k] - before[k] - [*shifts.get(k, (0, 0)), 0, 0, 0, 0] for k in both])
    apart = pairwise_px(errors)
    pairs = apart[np.triu_indices(len(both), 1)]
    left = {one.name for one in found.left_out}
    wrong = int((np.median(apart, axis=1) > _LARGEST_PX).sum())
    return Run(
        "fields, known shifts and two dates mirrored",
        len(files),
        len(both),
        wrong + len(set(names) - left),
        len(names),
        len(left & set(names)),
        float(pairs.max()),
        float(np.median(pairs)),
        *_network(found, {path.stem for path in files}),
    )


def _on_one_grid(settings: Settings) -> list[Outcome]:
    """Register every two dates of the river, which lie on one grid, band by band."""
    files = sorted((settings.data / "series" / "river").glob("*.tif"))
    found = []
    for one, other in combinations(files[:2] if settings.quick else files, 2):
        with rasterio.open(one) as raster:
            px = lattice((raster.width, raster.height))
        pair = Pair(one, other, Truth(px, px, np.eye(2)), sigma_px=_GRID_PX)
        for band in _BANDS:
            bands = {"reference_band": band, "input_band": band}
            name = f"{one.stem} and {other.stem}, band {band}"
            found.append(attempt(name, "dates on one grid", pair, **bands))
            print(found[-1].line(), flush=True)
    return found


def _mirrored(source: Path, target: Path) -> Path:
    with rasterio.open(source) as raster:
        profile, values = raster.profile, raster.read()
    with rasterio.open(target, "w", **profile) as raster:
        raster.write(values[:, ::-1, ::-1])
    return target


def _registered(out: Path, files: list[Path]) -> Any:
    try:
        return groundtie.register_series(out, files, reference=files[0])
    except NotRegisteredError as error:
        raise RuntimeError(f"no date of {files[0].parent} was registered") from error


def _displacements(found: Any) -> dict[str, Any]:
    return {
        one.name: one.verdict.displacement
        for one in found.dates
        if one.verdict.displacement is not None
    }


def _network(found: Any, good: set[str]) -> tuple[int, int, int, int, float, float]:
    """Return the numbers of tried and refused pairs of good dates, and loop statistics."""
    tried = [pair for pair in found.pairs if {pair.first, pair.second} <= good]
    refused = sum(not pair.accepted for pair in tried)
    loops = found.loops()
    median, largest = (
        np.nan if loops[key] is None else loops[key] for key in ("median_px", "largest_px")
    )
    return len(tried), refused, loops["count"], loops["closed"], median, largest


def _time(settings: Settings) -> tuple[float, tuple[float, float]]:
    """Return the processor time of a series relative to as many registrations, and both times."""
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        series = simulate_series(folder / "dates", settings.cache, 1, _TIMED_DATES + 1, ())
        reference, *dates = map(str, series.files)
        program = [sys.executable, "-m", "groundtie"]
        call: Callable[..., float] = lambda *words: measure([*program, *words]).processor_seconds  # noqa: E731
        single = sum(call("coregister", reference, date, OUTPUT) for date in dates)
        out = str(folder / "out")
        whole = call("coregister-series", out, *dates, "--reference", reference)
    return whole / single, (whole, single)


def _row(one: Run) -> list[str]:
    counts = [one.good, one.registered, one.silently_wrong, one.bad, one.named]
    return [
        one.name,
        *map(str, counts),
        *(_text(value) for value in (one.largest_px, one.median_px)),
        f"{one.refused} of {one.pairs}",
        f"{one.closed} of {one.loops}",
        *(_text(value) for value in (one.loop_median_px, one.loop_largest_px)),
    ]


def _text(value: float) -> str:
    return f"{value:.2f}" if np.isfinite(value) else "–"
