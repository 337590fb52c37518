"""Whole scenes without misregistration, and where they peak."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks import city, layover
from benchmarks.layover import Drawn


def test_the_city_is_the_same_and_its_ground_registered() -> None:
    made, aligned = city.city(3), layover.aligned_city(3)
    assert set(made.further) < set(aligned.further)
    assert dict(aligned.further)["distortion"] == "shift"
    assert aligned.shift == 0
    assert (aligned.density, aligned.seed, aligned.size) == ("city", 3, made.size)


def test_table_counts_distances_from_the_truth() -> None:
    records = [
        Drawn(seed, similarity, right, down, 9.0)
        for similarity in layover.SIMILARITIES
        for seed, (right, down) in enumerate([(0.6, 0.8), (-3.0, 4.0), (0.0, 2.0)])
    ]
    name, median, along, across, *rest = layover.peaks_table(records).rows[0]
    assert [name, median, *rest] == ["nmi", "2.0", "5.0", "33%", "67%", "3"]
    assert float(along) <= 2.0 and float(across) <= 2.0


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 3])
def test_roofs_lie_along_the_line_of_heights(seed: int, tmp_path: Path) -> None:
    """The simulator's own roof points, between their places in both images."""
    view = dict(layover.city(seed).further)
    made = replace(layover.aligned_city(seed), size=160)
    pair = made.pair(tmp_path)
    with (pair.reference.parent / "roof_points.csv").open(encoding="utf-8") as stream:
        rows = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(stream)]
    high = [row for row in rows if row["height_m"] > 15]
    apart = [
        np.array([row["reference_col"] - row["input_col"], row["reference_row"] - row["input_row"]])
        for row in high
    ]
    line = np.array(layover.height_line(seed))
    assert len(high) > 1 and 5 <= float(view["off_nadir"]) <= 25
    for vector in apart:
        assert vector @ line / np.hypot(*vector) > 0.99
