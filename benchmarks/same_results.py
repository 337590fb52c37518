"""Compare the results of this source tree with those of another revision on all real pairs.

Every real pair is registered by both; the exit code is 1 if a verdict differs, or transforms that
both accept differ by more than the tolerance. The other revision's results are kept.
"""

from __future__ import annotations

import argparse
import fnmatch
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from benchmarks.same_runs import Record, Registration

HERE = Path(__file__).resolve().parent
TOLERANCE_PX = 1e-6


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Return the options of the command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--base", required=True, metavar="REV", help="revision to compare with")
    parser.add_argument(
        "--base-results", type=Path, metavar="FILE", help="where its results are kept"
    )
    parser.add_argument("--base-only", action="store_true", help="run nothing but that revision")
    parser.add_argument(
        "--only",
        default="*",
        metavar="PATTERN",
        help="names of registrations, as 'coregister so-*'",
    )
    parser.add_argument("--jobs", type=int, default=1, help="registrations at a time")
    parser.add_argument(
        "--tolerance", type=float, default=TOLERANCE_PX, help="largest difference in input pixels"
    )
    return parser.parse_args(arguments)


@dataclass(frozen=True)
class Comparison:
    """A registration by two revisions."""

    base: Record
    now: Record

    @property
    def difference_px(self) -> float:
        """Largest distance between positions in input pixels; NaN unless both were accepted."""
        import numpy as np

        if self.base.positions is None or self.now.positions is None:
            return float("nan")
        unseen = np.isnan(self.base.positions)
        if not np.array_equal(unseen, np.isnan(self.now.positions)):
            return float("inf")
        off = np.where(unseen, 0.0, self.now.positions - self.base.positions)
        return float(np.hypot(*off.T).max())

    def is_same(self, tolerance_px: float) -> bool:
        """Return whether the verdicts agree, and the transforms, if any."""
        if self.base.verdict != self.now.verdict:
            return False
        return not self.difference_px > tolerance_px

    def row(self, tolerance_px: float) -> list[str]:
        """Return the comparison as a row of the table."""
        same = self.is_same(tolerance_px)
        verdicts = dict.fromkeys([self.base.verdict, self.now.verdict])
        reasons = dict.fromkeys([self.base.reason, self.now.reason])
        difference = self.difference_px
        return [
            self.now.name,
            " → ".join(verdicts),
            "–" if difference != difference else f"{difference:.2g}",
            "yes" if same else "**no**",
            " → ".join(reasons),
        ]


class Kept:
    """Results of a revision, kept in a file that is written after each of them.

    Raises
    ------
    SystemExit
        The file holds results of another revision.
    """

    def __init__(self, path: Path, revision: str) -> None:
        from benchmarks.same_runs import Record

        self._path, self._revision = path, revision
        self._records: dict[str, Record] = {}
        if path.exists():
            values = json.loads(path.read_text(encoding="utf-8"))
            if values["revision"] != revision:
                raise SystemExit(f"{path} holds the results of {values['revision']}")
            records = map(Record.from_json, values["records"])
            self._records = {record.name: record for record in records}

    def get(self, name: str) -> Record | None:
        """Return the result with a name, if there is one."""
        return self._records.get(name)

    def add(self, record: Record) -> None:
        """Keep a result."""
        self._records[record.name] = record
        values = {
            "revision": self._revision,
            "records": [known.to_json() for known in self._records.values()],
        }
        self._path.parent.mkdir(parents=True, exist_ok=True)
        # Stopping the run in the middle of writing loses nothing.
        partial = self._path.with_suffix(".partial")
        partial.write_text(json.dumps(values), encoding="utf-8")
        partial.replace(self._path)


def _git(*words: str) -> str:
    done = subprocess.run(["git", *words], cwd=HERE, capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(done.stderr.strip())
    return done.stdout.strip()


@contextmanager
def checked_out(revision: str) -> Iterator[Path]:
    """Check out a revision into a temporary folder."""
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "tree"
        _git("worktree", "add", "--detach", "--quiet", str(tree), revision)
        try:
            yield tree
        finally:
            _git("worktree", "remove", "--force", str(tree))


def check_package(tree: Path) -> None:
    """Stop unless Python finds the package in the given source tree."""
    from benchmarks.same_runs import environment

    code = "import groundtie; print(groundtie.__file__)"
    done = subprocess.run(
        [sys.executable, "-P", "-c", code],
        env=environment(tree),
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise SystemExit(f"Python finds no package in {tree}: {done.stderr.strip()[-200:]}")
    if not Path(done.stdout.strip()).is_relative_to(tree):
        raise SystemExit(f"Python takes the package in {done.stdout.strip()}, not that in {tree}")


def run_all(
    tree: Path,
    wanted: Sequence[Registration],
    jobs: int,
    known: Mapping[str, Record | None] | None = None,
    keep: Callable[[Record], None] | None = None,
) -> list[Record]:
    """Run registrations with a source tree, except those already known."""
    from benchmarks.same_runs import run_in

    check_package(tree)
    records = []
    with ThreadPoolExecutor(jobs) as pool:
        for record in pool.map(lambda one: run_in(tree, one, (known or {}).get(one.name)), wanted):
            records.append(record)
            print(f"[{len(records)}/{len(wanted)}] {record.line()}", flush=True)
            if keep is not None:
                keep(record)
    return records


def report(comparisons: Sequence[Comparison], tolerance_px: float) -> str:
    """Return the comparisons as a table with a summary."""
    from benchmarks.suites import Table
    from benchmarks.tables import to_markdown

    head = ("registration", "verdict", "largest difference (px)", "same", "reason")
    rows = [one.row(tolerance_px) for one in comparisons]
    same = sum(one.is_same(tolerance_px) for one in comparisons)
    before = sum(one.base.seconds for one in comparisons)
    after = sum(one.now.seconds for one in comparisons)
    return (
        to_markdown(Table(f"Same results to {tolerance_px:g} px", head, rows))
        + f"\n{same} of {len(comparisons)} the same. "
        + f"Time of all processes: {before:.0f} s → {after:.0f} s.\n"
    )


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare, print, and return 1 if something differs, else 0."""
    options = parse(arguments)
    # Imported here so that help works before anything is installed.
    from benchmarks.cases import data_folder
    from benchmarks.same_runs import registrations

    every = registrations(data_folder().resolve())
    wanted = [one for one in every if fnmatch.fnmatch(one.name, options.only)]
    if not wanted:
        raise SystemExit(f"no registration is named {options.only}")
    revision = _git("rev-parse", "--verify", f"{options.base}^{{commit}}")
    path = options.base_results or HERE / "results" / f"same_results_{revision[:12]}.json"
    kept = Kept(path, revision)
    print(f"== {revision[:12]}", flush=True)
    with checked_out(revision) as tree:
        known = {one.name: kept.get(one.name) for one in wanted}
        base = run_all(tree, wanted, options.jobs, known, kept.add)
    if options.base_only:
        return 0
    print("== this tree", flush=True)
    now = run_all(HERE.parent, wanted, options.jobs)
    comparisons = [Comparison(*both) for both in zip(base, now, strict=True)]
    print(report(comparisons, options.tolerance))
    return 0 if all(one.is_same(options.tolerance) for one in comparisons) else 1


if __name__ == "__main__":
    # A script's own folder comes first on the path, but the benchmarks are a package.
    sys.path[0] = str(HERE.parent)
    raise SystemExit(main())
