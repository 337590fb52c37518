"""Whole scenes without misregistration, and where they peak."""

from __future__ import annotations

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
    row = layover.peaks_table(records).rows[0]
    assert row == ["nmi", "2.0", "5.0", "33%", "67%", "3"]
