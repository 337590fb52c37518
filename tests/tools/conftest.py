"""Pairs with known truth, made once a session."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from textured_pairs import TexturedPair, shift_on_map, write_textured_pair

from groundtie.geometry.transform import Transform, load_transform
from groundtie.tools.simulate import simulate


@dataclass(frozen=True)
class SimulatedFiles:
    """A simulated SAR–optical pair on rural ground, pixels of 1 m."""

    folder: Path

    @property
    def reference(self) -> Path:
        return self.folder / "reference.tif"

    @property
    def input(self) -> Path:
        return self.folder / "input.tif"

    def error_px(self, transform: Transform) -> float:
        """Return the root mean square error at points on open ground, in input pixels."""
        table = np.genfromtxt(self.folder / "check_points.csv", delimiter=",", names=True)
        xy = np.column_stack([table["reference_x"], table["reference_y"]])
        truth = load_transform(self.folder / "truth.json")
        return rms(transform(xy) - truth(xy))


def rms(errors: np.ndarray) -> float:
    """Return the root mean square length of vectors, shape (n, 2)."""
    return float(np.sqrt((errors**2).sum(axis=1).mean()))


@pytest.fixture(scope="session")
def simulated(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], SimulatedFiles]:
    """Return the function that simulates a pair with a kind of distortion."""

    @cache
    def pair(distortion: str) -> SimulatedFiles:
        folder = tmp_path_factory.mktemp(distortion)
        sizes = {"rotation": 1.0, "scale": 1.01} if distortion == "similarity" else {}
        simulate(folder, 480, "rural", distortion, looks=4.0, **sizes)
        return SimulatedFiles(folder)

    return pair


@pytest.fixture(scope="session")
def textured(tmp_path_factory: pytest.TempPathFactory) -> TexturedPair:
    """Return a small pair of opposite contrast; the input claims to lie 70 m east, 45 m south."""
    return write_textured_pair(tmp_path_factory.mktemp("textured"), SIZE, shift_on_map(70, -45))


SIZE = (240, 220)
