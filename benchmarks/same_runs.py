"""Registrations of all real pairs by the command line, as any revision offers it.

Only arguments and options that all revisions share are used, and only exit codes, transforms and
RPCs are read. Thus any two revisions can be compared.
"""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from groundtie.geometry.transform import load_transform
from groundtie.rasters.grid import PIXEL_COORDINATES, Grid
from groundtie.sensor.rpc import RPC
from groundtie.sensor.rpc_files import read_rpc

from .accuracy import FloatArray, lattice
from .cases import (
    KINDS,
    REFERENCE_TRANSFORM,
    SAR_SAR,
    RealCase,
    draw_shift,
    image_size,
    read_cases,
    search_radius_m,
    write_case,
)
from .half_real import PLACES, make_scene, place_case, sensor_of, sensor_rpc
from .rotated_pairs import rotated_cases

ACCEPTED, REFUSED, FAILED = "accepted", "refused", "failed"
_VERDICTS = {0: ACCEPTED, 3: REFUSED}

LARGEST_SHIFT_PX = 20.0
BIASES = (1, 2)

_TRANSFORM, _RPC = "transform.json", "refined_RPC.TXT"


@dataclass(frozen=True)
class Prepared:
    """A registration that is ready to run.

    Parameters
    ----------
    words
        Tool, arguments and options of the command line.
    inputs
        The files that are read.
    positions
        Returns the result's input pixels, shape (n, 2), on a lattice of the ground.
    """

    words: Sequence[str]
    inputs: Sequence[Path]
    positions: Callable[[], FloatArray]


class Registration(Protocol):
    """A registration that can be run by any revision."""

    @property
    def name(self) -> str:
        """The pair and the tool."""

    def prepare(self, folder: Path) -> Prepared:
        """Write what is needed into a folder."""


@dataclass(frozen=True)
class PairRegistration:
    """A real pair, with synthetic, wrong georeferencing or unchanged."""

    tool: str
    case: RealCase
    georeferenced: bool = True

    @property
    def name(self) -> str:
        """Tool and case."""
        return f"{self.tool} {self.case.name}{'' if self.georeferenced else ', as it is'}"

    def prepare(self, folder: Path) -> Prepared:
        """Write the pair if needed."""
        case, found = self.case, folder / _TRANSFORM
        size, options = image_size(case.reference), ["--transform", str(found)]
        if self.georeferenced:
            pair = write_case(case, draw_shift(case, LARGEST_SHIFT_PX, 0), folder)
            inputs = pair.reference, pair.input
            place = REFERENCE_TRANSFORM
            options += ["--search-radius", f"{search_radius_m(LARGEST_SHIFT_PX):g}"]
        else:
            inputs = case.reference, case.input
            place = PIXEL_COORDINATES
        words = [self.tool, *map(str, inputs)]
        if self.tool != "estimate-rotation":
            words.append(str(folder / "registered.tif"))
        xy = Grid(place, None, *size).pixel_to_map(lattice(size))
        return Prepared([*words, *options], inputs, lambda: load_transform(found)(xy))


@dataclass(frozen=True)
class RpcRefinement:
    """An optical image with real RPCs and a known bias, refined by the real SAR image."""

    data: Path
    place: str
    number: int

    @property
    def name(self) -> str:
        """Tool, sensor, place and bias."""
        return (
            f"refine-rpc rpc-{sensor_of(self.place, self.number)}, {self.place}, bias {self.number}"
        )

    def prepare(self, folder: Path) -> Prepared:
        """Make the scene."""
        rpc = sensor_rpc(self.data, sensor_of(self.place, self.number))
        scene = make_scene(place_case(self.data, self.place), rpc, self.number, folder)
        output = folder / _RPC
        words = ["refine-rpc", str(scene.image), str(output), "--reference", str(scene.reference)]
        words += ["--dem", str(scene.dem), "--dem-datum", "ellipsoidal"]
        ground, height = _ground(scene.truth, scene.size)
        return Prepared(
            words,
            (scene.image, scene.reference, scene.dem),
            lambda: read_rpc(output).project(ground, height),
        )


def _ground(rpc: RPC, size: tuple[int, int]) -> tuple[FloatArray, FloatArray]:
    """Return places (longitude, latitude) over the whole image, low and high, and their heights."""
    px = np.tile(lattice(size), (2, 1))
    side = np.repeat([-0.5, 0.5], len(px) // 2)
    height = rpc.offset[2] + side * rpc.scale[2]
    return rpc.localise(px, height), height


def registrations(data: Path) -> list[Registration]:
    """Return all registrations of the real pairs in a folder."""
    plain, turned = read_cases(data), rotated_cases(data)
    optical = {kind for kind in KINDS if not kind.startswith("sar")}
    optical |= {f"{kind}-rotated" for kind in optical}
    radar_pairs = [case for case in plain if case.kind == SAR_SAR]
    return [
        *(PairRegistration("coregister", case) for case in (*plain, *turned)),
        *(PairRegistration("match-sar-sar", case, own) for own in (True, False)
          for case in radar_pairs),
        *(PairRegistration("match-optical", case) for case in plain if case.kind in optical),
        *(PairRegistration("match-optical", case, False) for case in turned
          if case.kind in optical),
        *(PairRegistration("estimate-rotation", case, False) for case in turned),
        *(RpcRefinement(data, place, number) for place in PLACES for number in BIASES),
    ]  # fmt: skip


@dataclass(frozen=True)
class Record:
    """The outcome of a registration.

    Parameters
    ----------
    name
        Name of the registration.
    inputs
        Fingerprint of the input files: only records with the same one are comparable.
    verdict, reason
        One of `ACCEPTED`, `REFUSED`, `FAILED`, and the tool's reason.
    positions
        Input pixels on a lattice of the ground; None unless accepted.
    seconds
        Wall-clock time of the whole process.
    """

    name: str
    inputs: str
    verdict: str
    reason: str
    positions: FloatArray | None
    seconds: float

    def to_json(self) -> dict[str, Any]:
        """Return values that JSON can carry, with every bit of the positions."""
        positions = None if self.positions is None else self.positions.tolist()
        return {**asdict(self), "positions": positions}

    @classmethod
    def from_json(cls, values: dict[str, Any]) -> Record:
        """Return the record from the output of `to_json`."""
        positions = values["positions"]
        return cls(**{**values, "positions": None if positions is None else np.array(positions)})

    def line(self) -> str:
        """Return the record as a line of text."""
        return f"{self.name}: {self.verdict} in {self.seconds:.1f} s; {self.reason}"


def run_in(tree: Path, registration: Registration, known: Record | None = None) -> Record:
    """Run a registration with the source tree in a folder; return `known` if it still holds."""
    with tempfile.TemporaryDirectory() as folder:
        prepared = registration.prepare(Path(folder))
        inputs = _fingerprint(prepared)
        if known is not None and known.inputs == inputs:
            return known
        started = time.perf_counter()
        done = subprocess.run(
            [sys.executable, "-m", "groundtie", *prepared.words, "--json", "--quiet"],
            cwd=folder,  # where no other package of that name lies
            env=environment(tree),
            capture_output=True,
            text=True,
            check=False,
        )
        seconds = time.perf_counter() - started
        verdict = _VERDICTS.get(done.returncode, FAILED)
        positions = prepared.positions() if verdict == ACCEPTED else None
    reason = _reason(done).replace(folder + os.sep, "")
    return Record(registration.name, inputs, verdict, reason, positions, seconds)


def environment(tree: Path) -> dict[str, str]:
    """Return the environment in which Python finds the package of a source tree."""
    return {**os.environ, "PYTHONPATH": str(tree / "algorithms")}


def _fingerprint(prepared: Prepared) -> str:
    """Return a fingerprint of the files and of the command."""
    digest = hashlib.sha256()
    for path in prepared.inputs:
        digest.update(path.read_bytes())
    digest.update(json.dumps([w for w in prepared.words if not os.path.isabs(w)]).encode())
    return digest.hexdigest()[:16]


def _reason(done: subprocess.CompletedProcess[str]) -> str:
    """Return the verdict's reason; without a verdict, the last line of the error output."""
    try:
        return str(json.loads(done.stdout)["verdict"]["reason"])
    except (json.JSONDecodeError, KeyError, TypeError):
        lines = done.stderr.strip().splitlines()
        return lines[-1] if lines else ""
