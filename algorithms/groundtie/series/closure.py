"""Closures of triplets of dates: whether a loop of three registrations leads back to its start."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..geometry.judging import SIGNIFICANCE
from ..rasters.grid import FloatArray
from .frame import PARAMETERS, SeriesFrame, rms_px, sigma_px
from .network import Link, exceeded_by


@dataclass(frozen=True)
class Closure:
    """A loop of three dates.

    Parameters
    ----------
    dates
        The dates, by number.
    error_px
        Misclosure of the loop, root mean square over the frame.
    expected_px
        Its standard deviation, from the covariances and the scatter of the links.
    statistic
        The misclosure as a squared normalised length.
    is_closed
        Whether chance explains the misclosure.
    """

    dates: tuple[int, int, int]
    error_px: float
    expected_px: float
    statistic: float
    is_closed: bool


def triplet_closures(
    frame: SeriesFrame, links: Sequence[Link], scatter_px: float
) -> tuple[Closure, ...]:
    """Return the closures of all triplets of dates that links connect, worst first.

    Parameters
    ----------
    frame
        The series' frame.
    links
        The registrations, whether the adjustment used them or not.
    scatter_px
        Standard deviation of each link beyond its own covariance.
    """
    by_ends = {frozenset((link.first, link.second)): link for link in links}
    partners: dict[int, set[int]] = {}
    for link in links:
        partners.setdefault(link.first, set()).add(link.second)
        partners.setdefault(link.second, set()).add(link.first)
    found = [
        _closure(frame, by_ends, (a, b, c), scatter_px)
        for a, b in sorted(map(sorted, by_ends))
        for c in sorted(partners[a] & partners[b])
        if c > b
    ]
    return tuple(sorted(found, key=lambda one: -one.statistic))


def _closure(
    frame: SeriesFrame,
    by_ends: dict[frozenset[int], Link],
    dates: tuple[int, int, int],
    scatter_px: float,
) -> Closure:
    around = np.eye(3)
    covariance = 3 * scatter_px**2 * np.eye(PARAMETERS)
    ends = list(zip(dates, (*dates[1:], dates[0]), strict=True))
    links = [by_ends[frozenset(pair)] for pair in ends]
    for link, (start, _) in zip(links, ends, strict=True):
        matrix = frame.matrix(link.displacement)
        around = (matrix if link.first == start else np.linalg.inv(matrix)) @ around
        covariance = covariance + link.covariance
    miss: FloatArray = frame.of_matrix(around)
    statistic = float(miss @ np.linalg.solve(covariance, miss))
    is_closed = statistic <= exceeded_by(SIGNIFICANCE, links).max()
    return Closure(dates, rms_px(miss), sigma_px(covariance), statistic, bool(is_closed))
