"""Whole processes, timed as users experience them, including imports and written output."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import groundtie

# Placeholder in a command for a file that is written and discarded.
OUTPUT = "{output}"

_MEASURE = Path(__file__).with_name("measure.py")
_PACKAGE = Path(groundtie.__file__).parents[1]


@dataclass(frozen=True)
class Measured:
    """Time, memory and output of a process."""

    seconds: float
    processor_seconds: float
    peak_bytes: int
    exit_code: int
    output: str


def measure(command: Sequence[str]) -> Measured:
    """Run a command once, with a new file in place of `OUTPUT`.

    Raises
    ------
    RuntimeError
        The command failed; a refused registration (exit code 3) is no failure.
    """
    paths = [str(_PACKAGE), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(paths)}
    # An installed package is compiled once, as all peers are, and not by each process.
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    with tempfile.TemporaryDirectory() as folder:
        result, output = Path(folder) / "measured.json", str(Path(folder) / "output.tif")
        words = [output if word == OUTPUT else word for word in command]
        done = subprocess.run(
            [sys.executable, "-I", "-S", _MEASURE, result, *words],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        )
        measured = Measured(**json.loads(result.read_text()), output=done.stdout)
    if measured.exit_code not in (0, 3):
        raise RuntimeError(f"{' '.join(command)} failed:\n{done.stderr}")
    return measured


def shortest_s(
    work: Callable[[], object], times: int, clock: Callable[[], float] = time.thread_time
) -> float:
    """Return the shortest time for work; by default this thread's processor time."""
    seconds = []
    for _ in range(times):
        started = clock()
        work()
        seconds.append(clock() - started)
    return min(seconds)


def measure_often(command: Sequence[str], times: int) -> Measured:
    """Run a command several times and return the run with the median time."""
    runs = sorted((measure(command) for _ in range(times)), key=lambda run: run.seconds)
    return runs[int(np.floor((len(runs) - 1) / 2))]
