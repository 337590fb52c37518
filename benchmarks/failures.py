"""Kill jobs at each step that changes the disk, fill their disk, let nobody write to it.

A job writes a set of files over an older set. Whatever happens, each name must have its old or its
new file, complete; which files belong together must be told by their ids; an error must be one
line; and after the next run nothing may be left of the one that died. The exit code is 1 if not.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import resource
import shutil
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import rasterio

import groundtie
from groundtie.context import threads
from groundtie.geometry.tie_point_files import _read_rows
from groundtie.rasters.atomic import Outputs, write_json
from groundtie.registration.delivery import RegistrationFiles
from groundtie.registration.registered_output import RegisteredOutput
from groundtie.runs import RUN, RUN_TAG, running

from .failing import End, Steps, Work, disk, hidden, in_child, make_read_only

OLD, NEW, NEXT = "an older run", "this run", "the next run"

# Free space in percent of the files' size, on disks that are too small or just large enough.
_FREE = (0, 1, 2, 5, 10, 15, 20, 25, 30, 35, 40, 45, 50, 55, 60, 65, 70, 75, 80, 85, 90, 92, 94, 96,
         98, 99, 101, 110)  # fmt: skip
_PAGE = 4096

# Space for the file system itself, and for hidden names.
_SPARE = 16 * _PAGE

# After kills at multiples of this step the same job runs again; after others, a shorter one.
_AGAIN = 5


@dataclass(frozen=True)
class Job:
    """A job that writes files into a folder.

    Parameters
    ----------
    name
        Name of the job.
    files
        Files of the job, in the order in which they take their final names.
    work
        Writes the files.
    """

    name: str
    files: tuple[str, ...]
    work: Work

    def as_run(self, folder: Path, run: str) -> None:
        """Write the files as the run with an id."""
        with running(run):
            self.work(folder)

    def contents(self, folder: Path) -> dict[str, bytes]:
        """Return the contents of the files that exist."""
        return {
            name: (folder / name).read_bytes() for name in self.files if (folder / name).exists()
        }


@dataclass
class Findings:
    """Numbers of trials, and faults that were found."""

    tried: Counter[str] = field(default_factory=Counter)
    wrong: list[str] = field(default_factory=list)

    def add(self, what: str, faults: Sequence[str], where: str) -> None:
        """Count a trial."""
        self.tried[what] += 1
        for fault in faults:
            self.wrong.append(f"{where}: {fault}")
            print(self.wrong[-1], flush=True)


def run_of(path: Path) -> str | None:
    """Return the id of the run that wrote a file; None: it has no id."""
    suffix = path.suffix
    if suffix == ".tif":
        with rasterio.open(path) as dataset:
            return dataset.tags().get(RUN_TAG)
    if suffix == ".json":
        return json.loads(path.read_text(encoding="utf-8")).get(RUN)
    if suffix == ".html":
        found = re.search(r'name="groundtie-run" content="([^"]*)"', path.read_text("utf-8"))
        return None if found is None else found[1]
    rows = _read_rows(path, suffix)[0]
    return rows[0].get(RUN) if rows else None


def is_whole(path: Path) -> bool:
    """Return whether a file can be read to its end."""
    try:
        if path.suffix == ".tif":
            with rasterio.open(path) as dataset:
                dataset.read()
        elif path.suffix == ".html":
            return path.read_text(encoding="utf-8").rstrip().endswith("</html>")
        run_of(path)
    except Exception:  # whatever it is, the file is not whole
        return False
    return True


def faults_of_files(job: Job, folder: Path, old: dict[str, bytes]) -> list[str]:
    """Return the faults of the files under their final names after a run that died."""
    faults, runs = [], []
    for name in job.files:
        path = folder / name
        if not path.exists():
            if name in old:
                faults.append(f"{name} is missing")
            runs.append(OLD)
        elif path.read_bytes() == old.get(name):
            runs.append(OLD)
        elif is_whole(path):
            runs.append(run_of(path) or "nobody's")
        else:
            faults.append(f"{name} is not whole")
    if not set(runs) <= {OLD, NEW}:
        faults.append(f"files do not tell their run: {runs}")
    if runs != sorted(runs, key=[NEW, OLD].index) and set(runs) <= {OLD, NEW}:
        faults.append(f"files are not put in their places in order: {runs}")
    return faults


def faults_of_next(job: Job, folder: Path, again: bool) -> list[str]:
    """Return the faults after the next run, of the same job or of one with another file."""
    other = Job("other", ("other.json",), lambda folder: _write_other(folder / "other.json"))
    follower = job if again else other
    end = in_child(partial(follower.as_run, folder, NEXT))
    faults = [] if end.how == "done" else [f"the next run: {end.how}, {end.text}"]
    if end.text:
        faults.append(f"the next run says {end.text}")
    faults += [f"left over: {name}" for name in hidden(folder)]
    runs = {run_of(folder / name) for name in follower.files}
    return faults if runs == {NEXT} else [*faults, f"a mixed set: {runs}"]


def _write_other(path: Path) -> None:
    with Outputs() as outputs:
        write_json(outputs.stage(path), {})


def steps_of(job: Job, folder: Path) -> int:
    """Return the number of steps of a job that change the disk."""
    with Steps().watched() as steps:
        job.as_run(folder, NEW)
    return steps.count


def kill(job: Job, before: Path, step: int, found: Findings, folder: Path) -> None:
    """Kill a job at a step in a copy of a folder, and check the files that it leaves."""
    shutil.copytree(before, folder)
    old = job.contents(folder)

    def work() -> None:
        with Steps(step).watched():
            job.as_run(folder, NEW)

    end = in_child(work, kill_expected=True)
    faults = [] if end.how == "killed" else [f"{end.how}: {end.text}"]
    faults += faults_of_files(job, folder, old)
    faults += faults_of_next(job, folder, again=step % _AGAIN == 0)
    found.add("kills", faults, f"{job.name}, killed at step {step}")
    shutil.rmtree(folder)


def faults_of_error(job: Job, folder: Path, end: End, old: dict[str, bytes]) -> list[str]:
    """Return the faults after a run that could not write."""
    faults = [f"left over: {name}" for name in hidden(folder)]
    if end.how not in ("told", "done"):
        faults.append(f"{end.how}: {end.text}")
    if end.how == "told" and not re.match("no space left on|cannot write|the folder of", end.text):
        faults.append(f"said {end.text}")
    if end.how == "told" and job.contents(folder) != old:
        faults.append("the old files changed")
    if end.how == "done":
        faults += [name for name in job.files if not is_whole(folder / name)]
        if {run_of(folder / name) for name in job.files} != {NEW}:
            faults.append("not all files are new")
    return faults


def fill(job: Job, before: Path, percent: int, found: Findings, folder: Path) -> None:
    """Run a job on a disk that is too small or just large enough."""
    old = job.contents(before)
    taken = sum(-(-len(content) // _PAGE) * _PAGE for content in old.values())
    free = max(taken * percent // 100, 1)
    with disk(folder, taken + _SPARE + free):
        for name, content in old.items():
            (folder / name).write_bytes(content)
        end = in_child(partial(job.as_run, folder, NEW))
        faults = faults_of_error(job, folder, end, old)
    folder.rmdir()
    if _SPARE + free < 0.85 * taken and end.how == "done":
        faults.append("it fits on a disk that is too small")
    found.add("full disks", faults, f"{job.name}, {percent} % of the disk free")


def limit(job: Job, before: Path, percent: int, found: Findings, folder: Path) -> None:
    """Run a job with the file size limited to a share of the largest file."""
    shutil.copytree(before, folder)
    old = job.contents(folder)
    most = max(map(len, old.values())) * percent // 100

    def work() -> None:
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))
        job.as_run(folder, NEW)

    faults = faults_of_error(job, folder, in_child(work), old)
    found.add("limits of a file's size", faults, f"{job.name}, {percent} % of the largest file")
    shutil.rmtree(folder)


def lock(job: Job, before: Path, found: Findings, folder: Path) -> None:
    """Run a job on a read-only disk."""
    old = job.contents(before)
    with disk(folder, sum(map(len, old.values())) * 2 + 100 * _PAGE):
        for name, content in old.items():
            (folder / name).write_bytes(content)
        make_read_only(folder)
        end = in_child(partial(job.as_run, folder, NEW))
        faults = faults_of_error(job, folder, end, old)
    if end.how == "done":
        faults.append("it was written to")
    folder.rmdir()
    found.add("read-only disks", faults, job.name)


def jobs(scene: Path) -> Iterator[Job]:
    """Make small scenes in a folder, and yield the jobs on them."""
    pair, sensor = scene / "pair", scene / "sensor"
    groundtie.simulate(pair, size=700, looks=4.0, density="rural", seed=1)
    groundtie.simulate_sensor(sensor, size=300)
    reference, moved = pair / "reference.tif", pair / "input.tif"
    found = groundtie.coregister(reference, moved)

    def register(folder: Path) -> None:
        output = RegisteredOutput(folder / "out.tif", "reference", "cubic")
        named = [folder / name for name in ("points.gpkg", "transform.json", "report.html")]
        with threads(2) as context:
            RegistrationFiles(output, *named).write(found, context)

    files = ("points.gpkg", "transform.json", "out.tif", "report.json", "report.html")
    yield Job("coregister", files, register)

    def tool(call: Callable[..., Any], file: str, *inputs: Path, **more: Any) -> Job:
        def work(folder: Path) -> None:
            call(*inputs, folder / file, **more)

        return Job(call.__name__, (file,), work)

    yield tool(groundtie.warp, "out.tif", moved, transform=pair / "truth.json", workers=2)
    yield tool(groundtie.filter_speckle, "out.tif", reference, workers=2)
    yield tool(groundtie.mask_threshold, "out.tif", reference)
    yield tool(
        groundtie.orthorectify,
        "out.cog.tif",
        sensor / "sensor.tif",
        dem=sensor / "dem.tif",
        dem_datum="ellipsoidal",
        workers=2,
    )


def run(every: int = 1, only: str = "") -> Findings:
    """Make jobs fail in all ways.

    Parameters
    ----------
    every
        1: at every step and on disks of every size; n: at each n-th.
    only
        Beginning of the names of the jobs.
    """
    found = Findings()
    with tempfile.TemporaryDirectory() as made:
        work = Path(made) / "work"
        for job in jobs(Path(made) / "scene"):
            if not job.name.startswith(only):
                continue
            fresh, before = Path(made) / "fresh", Path(made) / "before"
            fresh.mkdir(exist_ok=True)
            before.mkdir()
            job.as_run(before, OLD)
            shutil.copytree(before, work)
            count = steps_of(job, work)
            shutil.rmtree(work)
            for step in range(1, count + 1, every):
                kill(job, before, step, found, work)
            # Without older files there are fewer steps: the old files get no second names.
            for step in range(1, count - len(job.files) + 1, every):
                kill(job, fresh, step, found, work)
            for percent in _FREE[::every]:
                limit(job, before, percent, found, work)
            try:
                for percent in _FREE[::every]:
                    fill(job, before, percent, found, work)
                lock(job, before, found, work)
            except PermissionError as error:
                print(f"NOT TRIED: full and read-only disks: {error}", file=sys.stderr)
            shutil.rmtree(before)
            print(f"{job.name}, {count} steps: {dict(found.tried)}, wrong: {len(found.wrong)}")
    return found


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--every", type=int, default=1, help="try each n-th step and size only")
    parser.add_argument("--only", default="", help="what the names of the jobs begin with")
    options = parser.parse_args(arguments)
    os.environ.setdefault("CPL_LOG", os.devnull)
    found = run(options.every, options.only)
    for what, count in found.tried.items():
        print(f"{what}: {count}")
    print(f"went wrong: {len(found.wrong)}")
    return 1 if found.wrong else 0


if __name__ == "__main__":
    sys.exit(main())
