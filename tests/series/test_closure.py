"""Loops of three dates."""

from __future__ import annotations

import numpy as np
import pytest
from series_dates import FRAME, link, shifted

from groundtie.series.closure import triplet_closures

TRUE = np.array([[0, 0, 0, 0, 0, 0], [3, -2, 0.5, 0, 0, -0.5], [-4, 1, 0, 0.3, -0.3, 0]], float)


@pytest.mark.parametrize("ends", [((0, 1), (1, 2), (2, 0)), ((1, 0), (1, 2), (0, 2))])
def test_exact_links_close_in_either_direction(ends: tuple[tuple[int, int], ...]) -> None:
    (found,) = triplet_closures(FRAME, [link(a, b, TRUE, 0.1) for a, b in ends], 0.0)
    assert found.dates == (0, 1, 2)
    assert found.error_px < 1e-9 and found.is_closed


def test_the_error_of_a_link_is_the_error_of_its_loop() -> None:
    links = [link(0, 1, TRUE, 0.1, shifted(0.6, 0.8)), link(1, 2, TRUE, 0.1), link(0, 2, TRUE, 0.1)]
    (found,) = triplet_closures(FRAME, links, 0.0)
    assert found.error_px == pytest.approx(1.0, rel=0.02)
    # Three links of variance 0.01 along each axis, shift and linear part: 0.03 · 2 · (1 + 2/3).
    assert found.expected_px == pytest.approx(np.sqrt(0.1))
    assert found.statistic == pytest.approx(1 / 0.03, rel=0.03)
    assert not found.is_closed


def test_scatter_is_expected_of_each_link() -> None:
    links = [link(0, 1, TRUE, 0.1), link(1, 2, TRUE, 0.1), link(0, 2, TRUE, 0.1)]
    (found,) = triplet_closures(FRAME, links, 0.2)
    assert found.expected_px == pytest.approx(np.sqrt(0.1 * 5))


def test_without_triangles_there_is_nothing_to_close() -> None:
    assert triplet_closures(FRAME, [link(0, 1, TRUE, 0.1), link(1, 2, TRUE, 0.1)], 0.0) == ()
