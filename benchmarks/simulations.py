"""Simulated pairs with exact truth, kept on disk because large ones take minutes to make."""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

import groundtie
from groundtie.memory import MOST_MB, VARIABLE
from groundtie.rasters.grid import PointFunction
from groundtie.simulation import files

from .accuracy import FloatArray, Truth
from .attempt import Pair, on_pixels
from .cases import image_size, read_check_points


@dataclass(frozen=True)
class Simulation:
    """The parameters of a simulated pair; see `groundtie.simulate`.

    Parameters
    ----------
    size, density, seed, shift
        Its parameters of the same names.
    further
        Names and values of any others.
    """

    size: int
    density: str
    seed: int
    shift: float = 8.0
    further: tuple[tuple[str, float | str], ...] = ()

    @property
    def name(self) -> str:
        """Name for display."""
        return f"{self.density} {self.size}², seed {self.seed}, shift {self.shift:g} px"

    def pair(self, cache: Path) -> Pair:
        """Return the pair; it is made unless the folder `cache` has it."""
        folder = cache / "-".join(
            f"{part:g}" if isinstance(part, float) else str(part)
            for part in (self.density, self.size, self.shift, self.seed, *self._further())
        )
        # The truth exists only if all files do.
        if not (folder / files.NAMES["truth"]).exists():
            with _any_memory():
                groundtie.simulate(
                    folder,
                    size=self.size,
                    density=self.density,
                    seed=self.seed,
                    shift=self.shift,
                    **dict(self.further),
                )
        return read_pair(folder)

    def _further(self) -> list[str]:
        """Further words of the folder's name."""
        digest = hashlib.sha256(repr(self.further).encode()).hexdigest()[:8]
        return ([digest] if self.further else []) + [simulator_version()]


@contextmanager
def _any_memory() -> Iterator[None]:
    """Allow simulations to exceed the usual memory budget."""
    before = os.environ.get(VARIABLE)
    os.environ[VARIABLE] = str(MOST_MB)
    try:
        yield
    finally:
        del os.environ[VARIABLE]
        if before is not None:
            os.environ[VARIABLE] = before


def kept(folder: Path, make: Callable[[Path], object]) -> Path:
    """Return a folder; it is made if it does not exist.

    It appears complete or not at all: a run may be stopped, and other processes may make it, too.
    """
    if not folder.exists():
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder.parent) as temporary:
            made = Path(temporary) / "made"
            make(made)
            if not folder.exists():
                made.rename(folder)
    return folder


def read_exact(folder: Path) -> Pair:
    """Return the pair in a folder whose truth is exact everywhere; files as in `read_pair`."""
    reference, image, truth = (folder / files.NAMES[key] for key in ("reference", "input", "truth"))
    mapping, size = on_pixels(groundtie.load_transform(truth), reference), image_size(reference)
    lattice = Truth.on_lattice(mapping, size, linear_of(mapping, size))
    return Pair(reference, image, lattice, lattice)


def read_pair(folder: Path) -> Pair:
    """Return the pair in a folder written by `groundtie.simulate`."""
    exact = read_exact(folder)
    points = read_check_points(folder / files.NAMES["check_points"])
    assert exact.truth is not None
    return replace(exact, truth=Truth(points[:, :2], points[:, 2:], exact.truth.linear))


def linear_of(mapping: PointFunction, size: tuple[int, int]) -> FloatArray:
    """Return input pixels per reference pixel around the centre, shape (2, 2)."""
    # Far enough that terrain, which bends the truth from pixel to pixel, hardly matters.
    step = min(size) / 4
    steps = step * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    base, along_col, along_row = mapping(np.array(size) / 2 + steps)
    return np.column_stack([along_col - base, along_row - base]) / step


def simulator_version() -> str:
    """Return a fingerprint of the simulator's source, so that no pair outlives it."""
    return fingerprint(sorted(Path(files.__file__).parent.glob("*.py")))


def fingerprint(paths: Iterable[Path]) -> str:
    """Return a fingerprint that changes with any of the files."""
    return hashlib.sha256(b"".join(path.read_bytes() for path in paths)).hexdigest()[:8]
