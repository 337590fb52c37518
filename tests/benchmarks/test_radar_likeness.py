"""Statistics of radar images, on images whose statistics are known."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import radar_likeness
from benchmarks.radar_likeness import autocorrelation, edge_share, likeness, likeness_table

RANDOM = np.random.default_rng(1)


def speckle(looks: float, shape: tuple[int, int] = (240, 240)) -> np.ndarray:
    """Return amplitudes of a homogeneous area."""
    return (100 * np.sqrt(RANDOM.gamma(looks, 1 / looks, shape))).astype(np.float32)


def test_speckle_alone_has_its_looks_no_texture_and_no_edges() -> None:
    found = likeness("", "", speckle(4.0))
    assert found.looks == pytest.approx(4.0, rel=0.15)
    assert found.texture == pytest.approx(1.0, abs=0.1)
    assert found.strong < 0.001 and found.edges < 0.01
    assert abs(found.near) < 0.02 and found.far == 1
    # Quantiles of a gamma distribution of shape 4 and mean 1.
    assert found.span_db == pytest.approx(10 * np.log10(1.670 / 0.436), abs=0.15)


def test_bright_blocks_are_strong_and_have_edges() -> None:
    amplitude = speckle(4.0)
    amplitude[40:80, 40:160] *= 10  # 20 dB on a twelfth of the area
    found = likeness("", "", amplitude)
    assert found.strong == pytest.approx(1 / 12, abs=0.01)
    # Borders of 320 px, of blocks of 4 px among 2 * 60 * 59.
    assert found.edges == pytest.approx(80 / (2 * 60 * 59), abs=0.005)
    assert found.far > 10 and found.tail_db > 15


def test_autocorrelation_of_a_moving_average_falls_linearly() -> None:
    noise = RANDOM.normal(size=(300, 310))
    mean = np.lib.stride_tricks.sliding_window_view(noise, (10, 10)).mean(axis=(2, 3))
    near, far = autocorrelation(mean.astype(np.float32))
    assert near == pytest.approx(0.9, abs=0.03) and 8 <= far <= 11


def test_edges_are_counted_along_both_axes() -> None:
    halves = np.ones((40, 40), np.float32)
    halves[:, 20:] = 10
    assert edge_share(halves) == pytest.approx(10 / 180)
    assert edge_share(halves.T.copy()) == pytest.approx(10 / 180)


def test_a_group_has_its_median_and_its_range() -> None:
    found = [likeness("a", "g", speckle(looks)) for looks in (1.0, 4.0, 9.0)]
    (row,) = likeness_table(found).rows
    assert row[:2] == ["g", "3"] and len(row) == len(likeness_table(found).head)
    middle, low, high = (f"{one.looks:.1f}" for one in (found[1], found[0], found[2]))
    assert row[2] == f"{middle} ({low}–{high})"


def test_simulated_images_are_those_of_the_kinds() -> None:
    made = next(radar_likeness.simulated_images([1]))
    assert made.group == "simulated, rural" and made.looks == pytest.approx(2, rel=0.3)
