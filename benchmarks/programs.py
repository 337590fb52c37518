"""Whole registrations of the same files by GroundTie and by its peers."""

from __future__ import annotations

import json
import os
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .accuracy import CRASHED, REFUSED, classify
from .attempt import Pair
from .cases import search_radius_m
from .offsets import Scene, apply_matrix, write_offset
from .processes import measure
from .speed import OWN, PEERS, own_command, own_error_px, peer_python

# Initial error in columns and in rows; time limit of a program.
SHIFTS_PX = (10.0, 20.0)
TIME_LIMIT_S = 180.0
_MAX_SHIFT = "21"


@dataclass(frozen=True)
class Program:
    """A peer: its name, environment, script, and the script's arguments besides the files."""

    name: str
    environment: str
    script: str
    options: tuple[str, ...] = ()


PROGRAMS = (
    Program("SimpleITK Mattes MI, shift", "simpleitk", "simpleitk_mattes.py", ("translation",)),
    Program("SimpleITK Mattes MI, affine", "simpleitk", "simpleitk_mattes.py", ("affine",)),
    Program("elastix Mattes MI, affine", "elastix", "elastix_mattes.py", ("affine",)),
    Program("AROSICS global", "arosics", "arosics_shift.py", (_MAX_SHIFT, "global")),
    Program("AROSICS local, affine fit", "arosics", "arosics_shift.py", (_MAX_SHIFT, "local")),
    Program("OTB FineRegistration MI", "otb", "otb_mi.py", (_MAX_SHIFT,)),
    Program("phase correlation", "skimage", "skimage_phase.py", ("grey",)),
    Program("phase correlation, gradients", "skimage", "skimage_phase.py", ("gradients",)),
    Program("ECC on gradients, affine", "opencv", "opencv_ecc.py"),
    Program("SIFT + MAGSAC, affine", "opencv", "opencv_sift.py"),
)


@dataclass(frozen=True)
class Registration:
    """The result of one program on one pair."""

    name: str
    group: str
    program: str
    verdict: str
    error_px: float | None
    seconds: float
    processor_seconds: float | None = None
    peak_bytes: int | None = None
    reason: str = ""


@dataclass(frozen=True)
class Registrations:
    """The results of all programs on one pair."""

    records: tuple[Registration, ...]

    def line(self) -> str:
        """Return the verdicts as a line of text."""
        verdicts = (f"{record.program} {record.verdict}" for record in self.records)
        return f"{self.records[0].name}: {', '.join(verdicts)}"


@dataclass(frozen=True)
class WholeCase:
    """All installed programs on one pair."""

    scene: Scene

    def run(self, workers: int | None) -> Registrations:
        """Write the pair, register it with every program and judge the results."""
        with tempfile.TemporaryDirectory() as folder:
            pair = write_offset(
                self.scene.pair(Path(folder)), self.scene.offset_px(SHIFTS_PX), Path(folder)
            )
            threads = workers or os.cpu_count() or 1
            records = [self.register(program, pair, threads) for program in (None, *PROGRAMS)]
        return Registrations(tuple(r for r in records if r is not None))

    def register(self, program: Program | None, pair: Pair, threads: int) -> Registration | None:
        """Return a program's (None: GroundTie's) result on a pair; None if it is not installed."""
        words = command(program, pair, threads)
        if words is None:
            return None
        name = OWN if program is None else program.name
        started = time.perf_counter()
        try:
            run = measure(words)
        except RuntimeError as failure:
            seconds = time.perf_counter() - started
            # A failing peer claims nothing, so it counts as refused.
            verdict = CRASHED if program is None else REFUSED
            reason = "time limit" if seconds >= TIME_LIMIT_S else f"failed: {str(failure)[-300:]}"
            return Registration(
                self.scene.name, self.scene.group, name, verdict, None, seconds, reason=reason
            )
        error = own_error_px(run.output, pair) if program is None else error_px(run.output, pair)
        return Registration(
            self.scene.name,
            self.scene.group,
            name,
            classify(error is not None, 0.0 if error is None else error, pair.sigma_px),
            error,
            run.seconds,
            run.processor_seconds,
            run.peak_bytes,
        )


def command(program: Program | None, pair: Pair, threads: int) -> list[str] | None:
    """Return the command of a program (None: GroundTie); None if it is not installed."""
    if program is None:
        radius = str(search_radius_m(SHIFTS_PX[1]))
        words = [*own_command(pair), "--search-radius", radius, "--workers", str(threads)]
    else:
        python = peer_python(program.environment)
        if python is None:
            return None
        files = [str(pair.reference), str(pair.input)]
        words = [str(python), str(PEERS / program.script), *files, *program.options]
    variables = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "ITK_GLOBAL_DEFAULT_NUMBER_OF_THREADS")
    limits = [f"{variable}={threads}" for variable in variables]
    return ["env", *limits, "timeout", "--signal=KILL", f"{TIME_LIMIT_S:g}", *words]


def error_px(output: str, pair: Pair) -> float | None:
    """Return the error of the matrix in the last line of a peer's output; None if there is none."""
    found = json.loads(output.strip().splitlines()[-1])
    if found is None or not np.isfinite(found).all():
        return None
    assert pair.truth is not None
    matrix = np.array(found, float)
    return pair.truth.error_px(lambda px: apply_matrix(matrix, px))
