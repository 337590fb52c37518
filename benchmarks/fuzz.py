"""Damaged files of every kind that GroundTie reads: each must end in a result or in one line.

    .venv/bin/python -m benchmarks.fuzz --cases 20000
    .venv/bin/python -m benchmarks.fuzz --only dem,rpb --cases 500
    .venv/bin/python -m benchmarks.fuzz --case 4711

A case is a number that determines the file and its damage. Cases run in forked processes with
limits of time and memory. A case that crashes or hangs is counted, and a new process continues with
the next. Files that cause a crash, a hang, a traceback or too much memory are kept in
`results/fuzz/`, and the exit code is 1.
"""

from __future__ import annotations

import argparse
import contextlib
import faulthandler
import io
import os
import resource
import select
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from groundtie.cli import main as groundtie
from groundtie.errors import GroundTieError
from groundtie.features.classifier import read_classifier
from groundtie.masks.layer import read_layer
from groundtie.masks.scene import Scene
from groundtie.rasters.patch import Patch
from groundtie.rasters.reading import open_raster
from groundtie.tools import load_tool

from .fuzz_files import SIDE, write_seeds
from .fuzz_mutations import mutate

RESULTS = Path(__file__).with_name("results") / "fuzz"

# Outcomes of a case; the last four are failures.
OK, REFUSED, ERROR, TRACEBACK, CRASH, HANG, MEMORY = (
    "ok", "refused", "error line", "traceback", "crash", "hang", "memory",
)  # fmt: skip
FAILURES = (TRACEBACK, CRASH, HANG, MEMORY)

_PATIENCE_S = 30.0
_MEMORY_BYTES = 3 << 30
_BATCH = 100


@dataclass(frozen=True)
class Target:
    """Files to damage, and the tool that reads them.

    Parameters
    ----------
    names
        Healthy files, one of which each case damages.
    arguments
        Words of the command line, with `{}` for the file; or a function of the file's path.
    beside
        Files that accompany it.
    weight
        Relative frequency of the target.
    """

    names: tuple[str, ...]
    arguments: str | Callable[[Path], None]
    beside: tuple[str, ...] = ()
    weight: float = 1.0

    @property
    def tool(self) -> str | None:
        """Name of the tool that reads the file; None: a function does."""
        if not isinstance(self.arguments, str):
            return None
        return self.arguments.split()[0].replace("-", "_")


def _decide(path: Path) -> None:
    values = np.arange(SIDE * SIDE, dtype=np.float32).reshape(SIDE, SIDE)
    classifier, px = read_classifier(path), np.array([[20.0, 20.0], [30.0, 25.0]])
    bands = np.repeat(values[None], min(classifier.bands, 9), axis=0)
    classifier.keep(Patch(values, values > 3), px, bands)


def _mask(path: Path) -> None:
    with open_raster(path.with_name("image.tif")) as source:
        scene = Scene.of(source)
        read_layer(path, scene, 20.0).select(scene.whole)


_WARP = "warp image.tif out.tif --workers 1 --transform"
_ORTHO = "orthorectify sensor.tif out.tif --workers 1"
TARGETS = {
    "geotiff": Target(
        ("image.tif", "lzw.tif", "tiled.tif", "masked.tif"),
        "warp {} out.tif --workers 1 --transform affine.json",
        ("affine.json",),
        4.0,
    ),
    "vrt": Target(
        ("image.vrt",),
        "warp {} out.tif --workers 1 --transform affine.json",
        ("affine.json", "lzw.tif"),
    ),
    "beside": Target(
        ("beside.tif.aux.xml", "beside.tif.msk", "beside.tif.ovr"),
        "warp beside.tif out.tif --workers 1 --transform affine.json",
        ("affine.json", "beside.tif", "beside.tif.aux.xml", "beside.tif.msk", "beside.tif.ovr"),
        2.0,
    ),
    "reference": Target(("lzw.tif", "tiled.tif"), "mask-threshold {} out.tif", weight=1.0),
    "transform": Target(
        ("affine.json", "bent.json", "spline.json"), f"{_WARP} {{}}", ("image.tif",), 2.0
    ),
    "geojson": Target(("points.geojson",), f"{_WARP} {{}}", ("image.tif",)),
    "csv": Target(("points.csv",), f"{_WARP} {{}}", ("image.tif",)),
    "points": Target(("points.points",), f"{_WARP} {{}}", ("image.tif",)),
    "rpc": Target(("rpc.txt", "rpc.rpb", "rpc.xml"), f"{_ORTHO} --rpc {{}}", ("sensor.tif",), 2.0),
    "sensor": Target(("sensor.tif",), "orthorectify {} out.tif --workers 1"),
    "dem": Target(("dem.tif",), f"{_ORTHO} --dem {{}} --dem-datum ellipsoidal", ("sensor.tif",)),
    "geoid": Target(
        ("geoid.tif",), f"{_ORTHO} --dem dem.tif --geoid {{}}", ("sensor.tif", "dem.tif")
    ),
    "classifier": Target(("classifier.json",), _decide),
    # These take longer, as each starts a process of its own.
    "gpkg": Target(("points.gpkg",), f"{_WARP} {{}}", ("image.tif",), 0.25),
    "areas": Target(("areas.gpkg", "areas.geojson"), _mask, ("image.tif",), 0.25),
}
_TEXTS = (".json", ".geojson", ".csv", ".points", ".txt", ".rpb", ".xml", ".vrt")


@dataclass(frozen=True)
class Case:
    """One damaged file."""

    number: int
    target: str
    name: str
    content: bytes

    @classmethod
    def of(cls, number: int, seeds: Path, only: Sequence[str]) -> Case:
        """Return the case with a number."""
        random = np.random.default_rng(number)
        weights = np.array([TARGETS[name].weight for name in only])
        target = str(random.choice(only, p=weights / weights.sum()))
        name = str(random.choice(TARGETS[target].names))
        content = (seeds / name).read_bytes()
        is_text = Path(name).suffix in _TEXTS
        return cls(number, target, name, mutate(content, random, is_text=is_text))

    def write(self, seeds: Path, folder: Path) -> None:
        """Write the damaged file, and its healthy companions, into a folder."""
        for name in TARGETS[self.target].beside:
            shutil.copyfile(seeds / name, folder / name)
        (folder / self.name).write_bytes(self.content)

    def run(self, folder: Path) -> str:
        """Run the case in this process, return its outcome; a traceback goes to standard error."""
        arguments = TARGETS[self.target].arguments
        try:
            if not isinstance(arguments, str):
                arguments(folder / self.name)
                return OK
            code = groundtie(arguments.format(self.name).split())
        except GroundTieError:
            return ERROR
        except BaseException:
            traceback.print_exc()
            return TRACEBACK
        return {0: OK, 2: ERROR, 3: REFUSED}[code]


def run_cases(
    numbers: Sequence[int],
    seeds: Path,
    only: Sequence[str] = tuple(TARGETS),
    keep: Path | None = None,
    patience_s: float = _PATIENCE_S,
) -> Iterator[tuple[int, str, str]]:
    """Yield number, target and outcome of each case; the files of failures go to `keep`."""
    # Imported before any process is forked, so that none imports them again.
    for tool in {TARGETS[name].tool for name in only} - {None}:
        load_tool(tool)
    waiting = list(numbers)
    while waiting:
        batch, waiting = waiting[:_BATCH], waiting[_BATCH:]
        done = 0
        with tempfile.TemporaryDirectory(prefix="fuzz-") as folder:
            for number, outcome in _run_batch(batch, seeds, only, Path(folder), patience_s):
                case = Case.of(number, seeds, only)
                if outcome == HANG:  # or the machine is busy: once more, alone
                    with tempfile.TemporaryDirectory(prefix="fuzz-") as alone:
                        again = _run_batch([number], seeds, only, Path(alone), patience_s)
                        _, outcome = next(iter(list(again)))
                if outcome in FAILURES and keep is not None:
                    _keep(case, outcome, seeds, keep, Path(folder))
                done += 1
                yield number, case.target, outcome
        waiting = batch[done:] + waiting


def _keep(case: Case, outcome: str, seeds: Path, keep: Path, ran_in: Path) -> None:
    folder = keep / f"{case.target}-{case.number}-{outcome}"
    folder.mkdir(parents=True, exist_ok=True)
    case.write(seeds, folder)
    stderr = ran_in / "stderr.txt"
    shutil.copyfile(stderr, folder / "stderr.txt")


def _run_batch(
    batch: Sequence[int], seeds: Path, only: Sequence[str], folder: Path, patience_s: float
) -> Iterator[tuple[int, str]]:
    """Yield numbers and outcomes from one forked process, until it is done or has failed."""
    reading, writing = os.pipe()
    process = os.fork()
    if process == 0:
        os.close(reading)
        _child(batch, seeds, only, folder, writing)
    os.close(writing)
    outcome = ""
    with os.fdopen(reading) as lines:
        for number in batch:
            ready, _, _ = select.select([lines], [], [], patience_s)
            line = lines.readline().strip() if ready else ""
            if not line:
                outcome = CRASH if ready else HANG
                os.kill(process, signal.SIGKILL)
                yield number, outcome
                break
            yield number, line
            if line in FAILURES:
                break  # the process has ended, so that what it wrote can be kept
    os.waitpid(process, 0)


def _child(
    batch: Sequence[int], seeds: Path, only: Sequence[str], folder: Path, writing: int
) -> None:
    """Run cases and write an outcome a line; never returns."""
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY_BYTES, _MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    os.chdir(folder)
    log = os.open("stderr.txt", os.O_RDWR | os.O_CREAT | os.O_APPEND)
    os.dup2(log, 2)
    sys.stderr = io.TextIOWrapper(os.fdopen(2, "wb", 0, closefd=False), write_through=True)
    code = 1
    try:
        for number in batch:
            os.ftruncate(log, 0)
            work = folder / "case"
            shutil.rmtree(work, ignore_errors=True)
            work.mkdir()
            os.chdir(work)
            case = Case.of(number, seeds, only)
            case.write(seeds, work)
            faulthandler.dump_traceback_later(0.8 * _PATIENCE_S, file=log)
            with contextlib.redirect_stdout(io.StringIO()):
                outcome = case.run(work)
            if (
                outcome == ERROR
                and b"memory does not suffice" in (folder / "stderr.txt").read_bytes()
            ):
                outcome = MEMORY
            os.write(writing, f"{outcome}\n".encode())
            if outcome in FAILURES:
                break
        code = 0
    finally:
        os._exit(code)


def main() -> int:
    """Run cases from the command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--cases", type=int, default=20_000, help="how many")
    parser.add_argument("--first", type=int, default=0, help="number of the first one")
    parser.add_argument("--case", type=int, help="one case alone, by its number")
    parser.add_argument("--only", default=",".join(TARGETS), help="targets, by commas")
    given = parser.parse_args()
    numbers = range(given.first, given.first + given.cases)
    if given.case is not None:
        numbers = range(given.case, given.case + 1)
    counts: Counter[tuple[str, str]] = Counter()
    started = time.monotonic()
    # Ctrl-C ends with what was found so far.
    with (
        tempfile.TemporaryDirectory(prefix="fuzz-seeds-") as folder,
        contextlib.suppress(KeyboardInterrupt),
    ):
        write_seeds(Path(folder))
        for number, target, outcome in run_cases(
            numbers, Path(folder), given.only.split(","), RESULTS
        ):
            counts[target, outcome] += 1
            if outcome in FAILURES or given.case is not None:
                print(f"case {number}: {target}: {outcome}", flush=True)
    print(_table(counts), f"\n{sum(counts.values())} cases in {time.monotonic() - started:.0f} s")
    return int(any(outcome in FAILURES for _, outcome in counts))


def _table(counts: Counter[tuple[str, str]]) -> str:
    outcomes = (OK, REFUSED, ERROR, *FAILURES)
    lines = [f"{'':12}" + "".join(f"{outcome:>12}" for outcome in outcomes)]
    targets = [name for name in TARGETS if any(target == name for target, _ in counts)]
    for target in targets:
        row = "".join(f"{counts[target, outcome]:12}" for outcome in outcomes)
        lines.append(f"{target:12}{row}")
    total = "".join(f"{sum(counts[t, outcome] for t in targets):12}" for outcome in outcomes)
    return "\n".join([*lines, f"{'all':12}{total}"])


if __name__ == "__main__":
    sys.exit(main())
