"""Run the benchmarks: accuracy on real and simulated pairs, speed against peers."""

from __future__ import annotations

import argparse
import datetime
import importlib
import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any

HERE = Path(__file__).resolve().parent
SUITES = (
    "real",
    "one_grid",
    "crossings",
    "simulated",
    "city",
    "towns",
    "coarse_towns",
    "double_bounce",
    "layover",
    "radar_likeness",
    "sharpness",
    "ground",
    "masks",
    "large_shift",
    "rotated_pairs",
    "rotation",
    "rpc",
    "rpc_city",
    "sar_sar",
    "speed",
    "ortho",
    "large",
    "memory",
    "guard",
    "kernels",
    "batch",
    "methods",
    "peaks",
    "fusion",
    "sensitivity",
    "optical",
    "series",
    "attacks",
    "margins",
    "calibration",
    "mountains",
)


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    """Return the options of the command line."""
    parser = argparse.ArgumentParser(description=__doc__, fromfile_prefix_chars="@")
    parser.add_argument(
        "--only", type=_suite_names, default=SUITES, help=f"suites, of {','.join(SUITES)}"
    )
    parser.add_argument("--quick", action="store_true", help="a few cases of each suite")
    parser.add_argument(
        "--seeds",
        type=_seeds,
        default=(1, 20),
        help="simulated pairs of each kind, or a range of their seeds, A-B",
    )
    parser.add_argument(
        "--jobs",
        type=int,
        default=1,
        help="processes for the accuracy suites, with one thread each; 1: all threads in one",
    )
    parser.add_argument(
        "--without",
        nargs="+",
        default=(),
        metavar="RULE",
        help="judge without these rules: what becomes wrong, or right, hinges on them",
    )
    attacks = parser.add_argument_group("attacks", "what it runs; classes: calibration, too")
    attacks.add_argument("--sample", type=int, help="so many cases, of every class about as many")
    attacks.add_argument(
        "--classes", nargs="+", default=(), help="classes or groups, by their names"
    )
    attacks.add_argument(
        "--case", nargs="+", default=(), help="by the names that a table gives, or @FILE of them"
    )
    attacks.add_argument("--large", action="store_true", help="scenes of 450 to 1000 pixels")
    attacks.add_argument("--save", type=Path, help="folder for the images of what is run")
    parser.add_argument("--results", type=Path, default=HERE / "results", help="folder of results")
    return parser.parse_args(arguments)


def _seeds(text: str) -> tuple[int, int]:
    """Return the first seed and how many of "20" or "3-8"."""
    first, _, last = text.rpartition("-")
    try:
        seeds = int(first or 1), int(last)
    except ValueError as error:
        raise argparse.ArgumentTypeError(f"{text!r} is neither a number nor A-B") from error
    return seeds[0], seeds[1] - seeds[0] + 1


def _suite_names(text: str) -> tuple[str, ...]:
    names = tuple(text.replace("-", "_").split(","))
    for name in names:
        if name not in SUITES:
            raise argparse.ArgumentTypeError(f"no suite {name!r}; there are {', '.join(SUITES)}")
    return names


def about(options: argparse.Namespace) -> dict[str, Any]:
    """Return the conditions that the figures depend on besides the cases."""
    commit = subprocess.run(
        ["git", "describe", "--always", "--dirty"],
        cwd=HERE,
        capture_output=True,
        text=True,
        check=False,  # without git, the commit is unknown
    )
    return {
        "date": datetime.date.today().isoformat(),
        "commit": commit.stdout.strip() or "unknown",
        "quick": "yes: not all cases" if options.quick else "no",
        "without": ", ".join(options.without) or "no rule",
        "jobs": options.jobs,
        "processors": os.cpu_count(),
        **{name: importlib.import_module(name).__version__ for name in ("numpy", "scipy", "cv2")},
    }


def load_suite(name: str) -> ModuleType:
    """Return the module of a suite."""
    return importlib.import_module(f"benchmarks.{name}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run suites, print and write their results; return 1 if the tool crashed, else 0."""
    options = parse(arguments)
    # Imported here so that help works before anything is installed.
    from benchmarks.ablation import leave_out
    from benchmarks.accuracy import CRASHED
    from benchmarks.cases import data_folder
    from benchmarks.suites import Settings
    from benchmarks.tables import suite_markdown, write_result

    leave_out(options.without)
    first_seed, seeds = options.seeds
    settings = Settings(
        options.quick,
        seeds,
        options.jobs,
        data_folder(),
        HERE / ".cache",
        first_seed,
        options.sample,
        tuple(options.classes),
        tuple(options.case),
        options.save,
        options.large,
    )
    crashed = 0
    for name in options.only:
        print(f"== {name}", flush=True)
        result = load_suite(name).run(settings)
        crashed += sum(record.get("verdict") == CRASHED for record in result.records)
        paths = write_result(name, result, about(options), options.results)
        print(suite_markdown(result, about(options)))
        print(f"Written: {', '.join(map(str, paths))}", flush=True)
    if crashed:
        print(f"{crashed} registrations crashed.", file=sys.stderr)
    return 1 if crashed else 0


if __name__ == "__main__":
    # A script's own folder comes first on the path, but the benchmarks are a package.
    sys.path[0] = str(HERE.parent)
    raise SystemExit(main())
