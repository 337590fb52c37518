"""Peak memory of tools on 10 000² pixels, with the usual memory budget and with a small one."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from groundtie.geometry.models import shift_model
from groundtie.geometry.transform import Transform
from groundtie.memory import DEFAULT_MB, LEAST_MB, MOST_MB
from groundtie.rasters.reading import open_raster

from .attempt import Pair
from .large_pairs import large_pair, tile_pair
from .processes import OUTPUT, measure
from .suites import Goal, Settings, SuiteResult, Table

SIZE_PX, QUICK_SIZE_PX = 10_000, 1000
BUDGETS_MB = (DEFAULT_MB, 300)
_THREADS = ("--workers", "2")


# Simulations hold their whole scenes in memory; each of these stresses another part of it.
_SIMULATIONS = (
    ("simulate", "--size", "2000"),
    ("simulate", "--size", "3000", "--density", "urban"),
    ("simulate", "--size", "1000", "--shift", "2000"),
    ("simulate", "--size", "1000", "--input-pixel-size", "0.25"),
    ("simulate-sensor", "--size", "2000"),
    ("simulate-sensor", "--size", "1000", "--relief", "600"),
)


@dataclass(frozen=True)
class Run:
    """A call of a tool with a memory budget: its peak memory and processor time."""

    tool: str
    budget_mb: int
    peak_bytes: int
    processor_seconds: float


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    size = QUICK_SIZE_PX if settings.quick else SIZE_PX
    tile, runs = tile_pair(settings.cache), []
    with tempfile.TemporaryDirectory() as folder:
        pair = large_pair(tile, size, Path(folder))
        for tool, words in calls(pair, Path(folder)).items():
            for budget_mb in BUDGETS_MB:
                option = ("--memory", str(budget_mb))
                found = measure([sys.executable, "-m", "groundtie", *option, tool, *words])
                runs.append(Run(tool, budget_mb, found.peak_bytes, found.processor_seconds))
                print(runs[-1], flush=True)
    return SuiteResult(
        "Memory",
        goals(runs, is_complete=not settings.quick),
        (table(runs), _simulated(_SIMULATIONS[:1] if settings.quick else _SIMULATIONS)),
        [asdict(one) for one in runs],
        (f"{size}² px, 16 bit: radar of one band, a camera's image of four; two threads.",),
    )


def calls(pair: Pair, folder: Path) -> dict[str, list[str]]:
    """Return the words of each tool's command line."""
    transform = folder / "transform.json"
    with open_raster(pair.input) as source:
        moved = Transform(shift_model(20.3, 30.4), source.grid.crs, source.grid)
    transform.write_text(json.dumps(moved.to_json()))
    reference, input = str(pair.reference), str(pair.input)
    return {
        "coregister": [reference, input, OUTPUT, *_THREADS],
        "warp": [input, OUTPUT, "--transform", str(transform), *_THREADS],
        "filter-speckle": [reference, OUTPUT, *_THREADS],
        "mask-threshold": [reference, OUTPUT],
        "mask-ground": [reference, OUTPUT],
        "mask-regions": [reference, OUTPUT],
    }


def _simulated(simulations: Sequence[Sequence[str]]) -> Table:
    """Return the memory that simulations take, and their own forecast of it."""
    rows = []
    for tool, *words in simulations:
        with tempfile.TemporaryDirectory() as folder:

            def program(budget_mb: int, call: Sequence[str]) -> list[str]:
                return [sys.executable, "-m", "groundtie", "--memory", str(budget_mb), *call]

            call = [tool, str(Path(folder) / "out"), *words]
            refused = subprocess.run(
                program(LEAST_MB, call), capture_output=True, text=True, check=False
            )
            foreseen = re.search(r"takes ([0-9.]+) GB", refused.stderr)
            peak = measure(program(MOST_MB, call)).peak_bytes
        expected = "–" if foreseen is None else f"{1000 * float(foreseen[1]):.0f}"
        rows.append([" ".join([tool, *words]), f"{peak / 1e6:.0f}", expected])
    return Table("Simulations", ["call", "peak MB", "foreseen MB"], rows)


def goals(runs: Sequence[Run], *, is_complete: bool) -> list[Goal]:
    """Return the goals on the usual budget."""
    usual = [one for one in runs if one.budget_mb == DEFAULT_MB]
    largest = max(usual, key=lambda one: one.peak_bytes)
    found = f"{largest.peak_bytes / 1e6:.0f} MB ({largest.tool})"
    is_kept = largest.peak_bytes <= DEFAULT_MB * 1e6
    wanted = f"≤ {DEFAULT_MB} MB"
    return [Goal("Largest peak, usual budget", wanted, found, is_kept if is_complete else None)]


def table(runs: Sequence[Run]) -> Table:
    """Return the measurements."""
    head = ["tool"]
    head += [f"{what}, --memory {mb}" for mb in BUDGETS_MB for what in ("peak MB", "s")]
    rows = []
    for tool in dict.fromkeys(one.tool for one in runs):
        own = {one.budget_mb: one for one in runs if one.tool == tool}
        cells = [
            text
            for mb in BUDGETS_MB
            for text in (f"{own[mb].peak_bytes / 1e6:.0f}", f"{own[mb].processor_seconds:.1f}")
        ]
        rows.append([tool, *cells])
    return Table("Peak memory and processor time", head, rows)
