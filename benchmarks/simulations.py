"""Simulated pairs with exact truth, kept on disk because large ones take minutes to make."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import groundtie
from groundtie.memory import MOST_MB, VARIABLE
from groundtie.simulation import files

from .accuracy import FloatArray, Mapping, Truth
from .attempt import Pair, on_pixels
from .cases import image_size, read_check_points


@dataclass(frozen=True)
class Simulation:
    """What a simulated pair is made from; see `groundtie.simulate`.

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
        """Name for people."""
        return f"{self.density} {self.size}², seed {self.seed}, shift {self.shift:g} px"

    def pair(self, cache: Path) -> Pair:
        """Return the pair, which is made unless the folder `cache` has it."""
        folder = cache / "-".join(
            f"{part:g}" if isinstance(part, float) else str(part)
            for part in (self.density, self.size, self.shift, self.seed, *self._further())
        )
        # The truth is there only if all files are.
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
        """What else the folder's name must tell."""
        digest = hashlib.sha256(repr(self.further).encode()).hexdigest()[:8]
        return ([digest] if self.further else []) + [simulator_version()]


@contextmanager
def _any_memory() -> Iterator[None]:
    """Let simulations take more than the usual budget."""
    before = os.environ.get(VARIABLE)
    os.environ[VARIABLE] = str(MOST_MB)
    try:
        yield
    finally:
        del os.environ[VARIABLE]
        if before is not None:
            os.environ[VARIABLE] = before


def read_pair(folder: Path) -> Pair:
    """Return the pair in a folder that `groundtie.simulate` wrote."""
    paths = {key: folder / name for key, name in files.NAMES.items()}
    mapping = on_pixels(groundtie.load_transform(paths["truth"]), paths["reference"])
    size = image_size(paths["reference"])
    linear = linear_of(mapping, size)
    points = read_check_points(paths["check_points"])
    return Pair(
        paths["reference"],
        paths["input"],
        Truth(points[:, :2], points[:, 2:], linear),
        Truth.on_lattice(mapping, size, linear),
    )


def linear_of(mapping: Mapping, size: tuple[int, int]) -> FloatArray:
    """Return input pixels per reference pixel around the centre, shape (2, 2)."""
    # Far enough that terrain, which bends the truth from pixel to pixel, hardly counts.
    step = min(size) / 4
    steps = step * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    base, along_col, along_row = mapping(np.array(size) / 2 + steps)
    return np.column_stack([along_col - base, along_row - base]) / step


def simulator_version() -> str:
    """Return a fingerprint of the simulator's source, so that no pair outlives it."""
    folder = Path(files.__file__).parent
    sources = b"".join(path.read_bytes() for path in sorted(folder.glob("*.py")))
    return hashlib.sha256(sources).hexdigest()[:8]
