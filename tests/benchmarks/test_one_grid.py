"""The suite of pairs on one grid: where they are put."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.offsets import Scene
from benchmarks.one_grid import PLACES, OneGridCase
from benchmarks.simulations import Simulation


@pytest.mark.parametrize("place", PLACES)
def test_pairs_are_off_as_their_place_states(place: str, tmp_path: Path) -> None:
    scenes = [Scene(Simulation(100, "rural", seed), tmp_path) for seed in range(20)]
    shifts = np.abs([OneGridCase(scene, place).shift_px for scene in scenes])
    if place == "where they belong":
        assert not shifts.any()
        return
    assert shifts.min() >= 10 and shifts.max() <= 20 and np.ptp(shifts) > 5
    is_whole = shifts == np.rint(shifts)
    assert is_whole.all() if place == "off by whole pixels" else not is_whole.any()
