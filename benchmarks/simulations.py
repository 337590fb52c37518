"""Simulated pairs with exact truth, kept on disk because large ones take minutes to make."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rasterio

import groundtie
from groundtie.geometry.transform import Transform
from groundtie.rasters.grid import Grid
from groundtie.simulate.files import NAMES

from .accuracy import FloatArray, Truth
from .attempt import Pair
from .cases import read_check_points


@dataclass(frozen=True)
class Simulation:
    """What a simulated pair is made from; see `groundtie.simulate`."""

    size: int
    density: str
    seed: int
    shift: float = 8.0

    @property
    def name(self) -> str:
        """Name for people."""
        return f"{self.density} {self.size}², seed {self.seed}, shift {self.shift:g} px"

    def pair(self, cache: Path) -> Pair:
        """Return the pair, which is made unless the folder `cache` has it."""
        folder = cache / f"{self.density}-{self.size}-{self.shift:g}-{self.seed}-{_simulator()}"
        # The truth is there only if all files are.
        if not (folder / NAMES["truth"]).exists():
            groundtie.simulate(
                folder, size=self.size, density=self.density, seed=self.seed, shift=self.shift
            )
        return read_pair(folder)


def read_pair(folder: Path) -> Pair:
    """Return the pair in a folder that `groundtie.simulate` wrote."""
    truth = groundtie.load_transform(folder / NAMES["truth"])
    with rasterio.open(folder / NAMES["reference"]) as source:
        grid = Grid(source.transform, source.crs, source.width, source.height)

    def mapping(px: FloatArray) -> FloatArray:
        return truth(grid.pixel_to_map(px))

    linear = _linear(truth, grid)
    points = read_check_points(folder / NAMES["check_points"])
    return Pair(
        folder / NAMES["reference"],
        folder / NAMES["input"],
        Truth(points[:, :2], points[:, 2:], linear),
        Truth.on_lattice(mapping, (grid.width, grid.height), linear),
    )


def _linear(truth: Transform, grid: Grid) -> FloatArray:
    """Return input pixels per reference pixel at the centre, shape (2, 2)."""
    centre = np.array([grid.centre_px])
    steps = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    base, along_col, along_row = truth(grid.pixel_to_map(centre + steps))
    return np.column_stack([along_col - base, along_row - base])


def _simulator() -> str:
    """Return a fingerprint of the simulator's source, so that no pair outlives it."""
    folder = Path(groundtie.__file__).parent / "simulate"
    sources = b"".join(path.read_bytes() for path in sorted(folder.glob("*.py")))
    return hashlib.sha256(sources).hexdigest()[:8]
