from __future__ import annotations

import numpy as np
import pytest

from benchmarks import ground
from benchmarks.ground import FoundGround


def test_precision_is_of_the_mask_and_recall_of_the_ground() -> None:
    mask, radar, both = (np.zeros((10, 10), bool) for _ in range(3))
    mask[:4], radar[:3], both[1:6] = True, True, True
    found = FoundGround.of(7, mask, radar, both)
    assert found.share == pytest.approx(0.4)
    assert found.radar_precision == pytest.approx(3 / 4)
    assert found.precision == pytest.approx(3 / 4)
    assert found.recall == pytest.approx(3 / 5)
    assert found.record()["seed"] == 7


def test_a_mask_that_keeps_nothing_has_no_precision() -> None:
    nothing, everything = np.zeros((4, 4), bool), np.ones((4, 4), bool)
    found = FoundGround.of(1, nothing, everything, everything)
    assert np.isnan(found.precision)
    assert found.recall == 0


def test_each_city_has_a_row() -> None:
    found = [FoundGround(seed, 0.15, 0.8, 0.7, recall) for seed, recall in ((1, 0.4), (2, 0.6))]
    assert ground.table(found).rows[1] == ["2", "15%", "80%", "70%", "60%"]
    assert ground.goal(found).found == "70% and 50%"
