"""Counts of features and right matches, and the goals on them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from affine import Affine
from speckled_pairs import radar_image, speckled

from benchmarks.cases import RealCase, write_image
from benchmarks.feature_counts import (
    ChainCount,
    DetectorCount,
    TurnCount,
    chain_table,
    count_chain,
    count_detector,
    count_turn,
    detector_table,
    goals,
    turn_table,
)

SHIFT = (30, 20)


@pytest.fixture(scope="module")
def case(tmp_path_factory: pytest.TempPathFactory) -> RealCase:
    """Return a pair of crops of one scene, each with its own speckle."""
    folder = tmp_path_factory.mktemp("case")
    scene = radar_image(300, 320, looks=np.inf)
    crops = scene[:280, :290], scene[SHIFT[1] :, SHIFT[0] :]
    paths = [
        write_image(speckled(crop, 2.0, seed)[None], Affine.identity(), folder / f"{seed}.tif")
        for seed, crop in enumerate(crops)
    ]
    matrix = np.array([[1.0, 0.0, -SHIFT[0]], [0.0, 1.0, -SHIFT[1]]])
    return RealCase("scene", "sar-sar", Path(paths[0]), Path(paths[1]), 1.0, matrix)


@pytest.mark.slow
def test_detectors_find_and_match_on_a_registered_pair(case: RealCase) -> None:
    sift, oct = (count_detector(case, name) for name in ("sift", "sift-oct"))
    assert min(sift.detections) > 2 * max(oct.detections) > 100
    assert oct.right > 0.8 * oct.matches > 20
    assert oct.repeated[0] > sift.repeated[0]
    assert oct.seconds > 0


@pytest.mark.slow
def test_right_matches_of_all_ways(case: RealCase) -> None:
    found = count_chain(case)
    # Of an easy pair hardly any match is lost without the gate.
    assert found.hybrid[0] > 0.95 * found.alone[0] > 100
    assert found.alone[0] > found.standard[0] > 50
    assert found.hybrid[0] > 0.9 * found.hybrid[1]
    assert found.by_chance < 0.2 * found.hybrid[0]


@pytest.mark.slow
def test_a_quarter_turn_costs_unsigned_ratios_their_matches(case: RealCase) -> None:
    signed, unsigned = (count_turn(case, name) for name in ("roewa", "roewa-unsigned"))
    assert signed.turned > 0.8 * signed.without > 10
    assert unsigned.turned < 0.5 * unsigned.without


def detector(name: str, detector: str, **more: object) -> DetectorCount:
    values = DetectorCount(name, detector, (100, 100), (0.1,) * 5, 30, 20, 15, 15, 1.0)
    return replace(values, **more)  # type: ignore[arg-type]


CHAINS = [
    ChainCount("a", (3, 5), (9, 10), (20, 22), 2.0),
    ChainCount("b", (50, 51), (60, 60), (80, 90), 3.0),
]
TURNS = [TurnCount("a", "roewa", 50, 45), TurnCount("a", "roewa-unsigned", 50, 5)]


def test_goals_are_told_from_the_counts() -> None:
    good = [
        detector("a", "sift"),
        detector("a", "sift-oct", detections=(25, 25), right=16, seconds=0.25),
        detector("a", "sift-isef-oct"),
    ]
    assert [goal.reached for goal in goals(good, CHAINS, TURNS)] == [*[True] * 5, None]
    bad = [good[0], detector("a", "sift-oct", detections=(30, 25), right=14, seconds=0.3), good[2]]
    worse = [TurnCount("a", "roewa", 50, 30), TURNS[1]]
    harder = [replace(CHAINS[0], hybrid=(14, 20)), CHAINS[1]]
    assert [goal.reached for goal in goals(bad, harder, worse)] == [*[False] * 5, None]
    assert "a 14 < 15" in goals(bad, harder, worse)[1].found


def test_tables_have_a_row_for_each_count() -> None:
    counts = [detector("a", "sift")]
    for table, rows in (
        (detector_table(counts), 1),
        (chain_table(CHAINS), 2),
        (turn_table(TURNS), 2),
    ):
        assert len(table.rows) == rows
        assert all(len(row) == len(table.head) for row in table.rows)
