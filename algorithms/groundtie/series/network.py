"""Least-squares adjustment of a network of registrations: one displacement for each date.

Sources: [Koch1999] sections 3.2 and 4.2 (adjustment, tests of outliers); [Baarda1968] (data
snooping); docs/method-series.md has the formulas.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import compress

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_matrix, coo_matrix, csr_matrix, kron
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu
from scipy.special import chdtri  # scipy.stats takes 0.4 s to import

from ..geometry.judging import SIGNIFICANCE
from ..rasters.grid import FloatArray
from ..rasters.reading import Mask
from .frame import PARAMETERS, SeriesFrame, sigma_px

# Largest offset of dates from each other, in pixels.
_GOAL_PX = 0.3

# Standard deviation of links beyond their own covariance, per parameter, in pixels: seasons,
# shadows and tides displace all points alike. It is estimated from the residuals, between the
# scatter of the best links (suite series) and the goal; a network that needs more is wrong.
SCATTER_RANGE_PX = (0.03, _GOAL_PX)

# Of a shift, the change over the frame is this share as uncertain, or less: two UTM zones rotate by
# 3° or so against each other, and by 0.2° more or less over 20 km. An affine transform's is about
# as uncertain.
_OF_SHIFT = 0.01

# Links of smaller redundancy are not tested.
_LEAST_REDUNDANCY = 0.01

# Halvings of the range of the scatter: to less than 0.0001 px.
_BISECTIONS = 12

# Most Gauss-Newton steps, and the size of the last step. Displacements are nearly linear, so that
# few steps are needed.
_STEPS = 10
_PRECISION_PX = 1e-9


@dataclass(frozen=True)
class Link:
    """A registration of one date to another one.

    Parameters
    ----------
    first, second
        The dates, by number: reference and input of the registration.
    displacement
        From nominal positions of the first date to those of the second, shape (6,).
    covariance
        Covariance of the displacement, shape (6, 6), px².
    """

    first: int
    second: int
    displacement: FloatArray
    covariance: FloatArray

    @property
    def degrees_of_freedom(self) -> int:
        """Number of parameters that were fitted: two of a shift, else six.

        Between maps, a shift may change over the frame, but is as certain everywhere.
        """
        variances = np.diag(self.covariance)
        return 2 if variances[2:].max() <= _OF_SHIFT**2 * variances[:2].max() else PARAMETERS


def exceeded_by(share: float, links: Sequence[Link]) -> FloatArray:
    """Return the squared normalised length that a share of each link's kind exceeds by chance."""
    return np.asarray(chdtri([link.degrees_of_freedom for link in links], share))


@dataclass(frozen=True)
class Adjustment:
    """Displacements of all dates that the network reaches.

    Parameters
    ----------
    displacements, covariances
        Of each date against the frame, shapes (n, 6) and (n, 6, 6); NaN for dates not reached.
    kept
        Which links were used, shape (m,): no outliers, and connected with the hub.
    scatter_px
        Standard deviation of links beyond their own covariance, per parameter.
    confirmed
        Which dates a second path confirms, shape (n,): they lie in loops, and no single link
        alone connects them with the hub.
    """

    displacements: FloatArray
    covariances: FloatArray
    kept: Mask
    scatter_px: float
    confirmed: Mask

    @property
    def reached(self) -> Mask:
        """Which dates the network reaches, shape (n,)."""
        return np.asarray(np.isfinite(self.displacements).all(axis=1))

    @property
    def imprecise(self) -> Mask:
        """Which dates may differ from equally precise ones by more than the goal, shape (n,).

        The limit is exceeded by chance once in a thousand times. The variance of the difference on
        each axis is that of one date on both axes.
        """
        sigmas = np.array([sigma_px(covariance) for covariance in self.covariances])
        return np.asarray(sigmas * np.sqrt(chdtri(2, SIGNIFICANCE)) > _GOAL_PX)


def adjust(
    frame: SeriesFrame, links: Sequence[Link], count: int, hub: int, *, is_free: bool
) -> Adjustment:
    """Adjust a network; links that contradict the others are removed, the worst first.

    Parameters
    ----------
    frame
        The series' frame.
    links
        All registrations that were accepted.
    count
        Number of dates.
    hub
        The date whose displacement is zero.
    is_free
        Whether the mean displacement of all dates is zero instead.
    """
    kept = np.ones(len(links), bool)
    while True:
        kept &= _reached(links, kept, count, hub)
        network = _Network(frame, list(compress(links, kept)), count, hub)
        solution = network.settled()
        found = network.statistics(solution) / exceeded_by(SIGNIFICANCE, network.links)
        if not np.any(found > 1):
            break
        kept[np.flatnonzero(kept)[np.nanargmax(found)]] = False
    displacements, covariances = solution.of_dates(frame, is_free)
    confirmed = network.confirmed()
    return Adjustment(displacements, covariances, kept, solution.scatter_px, confirmed)


@dataclass(frozen=True)
class _Solution:
    """Displacements (n, 6), NaN for dates that are not reached, and covariance (n, 6, n, 6)."""

    displacements: FloatArray
    covariance: FloatArray
    scatter_px: float

    def of_dates(self, frame: SeriesFrame, is_free: bool) -> tuple[FloatArray, FloatArray]:
        """Return displacements (n, 6) and covariances (n, 6, 6)."""
        count = len(self.displacements)
        displacements: FloatArray = self.displacements
        covariance: FloatArray = self.covariance
        reached = np.isfinite(displacements).all(axis=1)
        if is_free:
            mean = np.linalg.inv(frame.matrix(displacements[reached].mean(axis=0)))
            displacements = np.array(
                [frame.of_matrix(frame.matrix(one) @ mean) for one in displacements]
            )
            # S-transformation to the datum of zero mean.
            less_mean: FloatArray = np.eye(count)
            less_mean[:, reached] -= 1 / reached.sum()
            change = "ij,jakb,lk->ialb"
            covariance = np.einsum(change, less_mean, covariance, less_mean, optimize=True)
        own = np.array([covariance[i, :, i] for i in range(count)])
        own[~reached] = np.nan
        return displacements, own


@dataclass(frozen=True)
class _Network:
    """The links that are used, and the dates that they reach from the hub."""

    frame: SeriesFrame
    links: Sequence[Link]
    count: int
    hub: int

    @property
    def free(self) -> list[int]:
        """The dates whose displacement is unknown."""
        ends = {end for link in self.links for end in (link.first, link.second)}
        return sorted(ends - {self.hub})

    def settled(self) -> _Solution:
        """Return the solution with the scatter at which the median statistic is as expected."""
        low, high = SCATTER_RANGE_PX
        median = exceeded_by(0.5, self.links)

        def is_enough(scatter_px: float) -> bool:
            found = self.statistics(self.solve(scatter_px)) / median
            return not np.isfinite(found).any() or bool(np.nanmedian(found) <= 1)

        if is_enough(low):
            return self.solve(low)
        if not is_enough(high):
            return self.solve(high)
        for _ in range(_BISECTIONS):
            middle = (low + high) / 2
            low, high = (low, middle) if is_enough(middle) else (middle, high)
        return self.solve(high)

    def solve(self, scatter_px: float) -> _Solution:
        """Return the least-squares solution.

        By the Gauss-Newton method: residuals are exact, from composed transforms; the design
        matrix, of differences of displacements, neglects their products.
        """
        displacements = np.full((self.count, PARAMETERS), np.nan)
        displacements[self.hub] = 0.0
        covariance = np.zeros((self.count, PARAMETERS) * 2)
        free = self.free
        if not free:
            return _Solution(displacements, covariance, scatter_px)
        displacements[free] = 0.0
        weights = np.linalg.inv([self._covariance(link, scatter_px) for link in self.links])
        design, count = self._design(free), len(weights)
        pull = design.T @ bsr_matrix((weights, np.arange(count), np.arange(count + 1)))
        factors = splu((pull @ design).tocsc())
        for _ in range(_STEPS):
            residuals = [self._residual(link, displacements) for link in self.links]
            step = factors.solve(pull @ np.concatenate(residuals)).reshape(-1, PARAMETERS)
            displacements[free] += step
            if np.abs(step).max() < _PRECISION_PX:
                break
        inverse = factors.solve(np.eye(len(free) * PARAMETERS))
        every = range(PARAMETERS)
        covariance[np.ix_(free, every, free, every)] = inverse.reshape((len(free), PARAMETERS) * 2)
        return _Solution(displacements, covariance, scatter_px)

    def statistics(self, solution: _Solution) -> FloatArray:
        """Return the squared normalised residual of each link that is used, shape (links,).

        It has a χ² distribution of the link's degrees of freedom; NaN where no other link controls
        it.
        """
        blocks = solution.covariance
        found = []
        for link in self.links:
            i, j = link.first, link.second
            of_fit = blocks[i, :, i] + blocks[j, :, j] - blocks[i, :, j] - blocks[j, :, i]
            own = self._covariance(link, solution.scatter_px)
            left = own - of_fit
            redundancy = np.trace(np.linalg.solve(own, left)) / PARAMETERS
            residual = self._residual(link, solution.displacements)
            is_controlled = redundancy >= _LEAST_REDUNDANCY
            found.append(residual @ np.linalg.solve(left, residual) if is_controlled else np.nan)
        return np.array(found)

    def confirmed(self) -> Mask:
        """Return which dates lie in loops and reach the hub by more than a single link, (n,)."""
        edges = [(link.first, link.second) for link in self.links]
        inner = []
        for k, (first, second) in enumerate(edges):
            part = _parts(edges[:k] + edges[k + 1 :], self.count)
            if part[first] == part[second]:
                inner.append((first, second))
        part = _parts(inner, self.count)
        in_loop = np.isin(np.arange(self.count), inner)
        return np.asarray(in_loop & (part == part[self.hub]))

    def _covariance(self, link: Link, scatter_px: float) -> FloatArray:
        return np.asarray(link.covariance + scatter_px**2 * np.eye(PARAMETERS))

    def _residual(self, link: Link, displacements: FloatArray) -> FloatArray:
        first, second, between = (
            self.frame.matrix(one)
            for one in (displacements[link.first], displacements[link.second], link.displacement)
        )
        return self.frame.of_matrix(between) - self.frame.of_matrix(second @ np.linalg.inv(first))

    def _design(self, free: list[int]) -> csr_matrix:
        """Return the design matrix of links by free dates, shape (6 links, 6 dates)."""
        count = len(self.links)
        ends = [end for link in self.links for end in (link.second, link.first)]
        where, signs = (np.repeat(np.arange(count), 2), ends), np.tile([1.0, -1.0], count)
        differences = csr_matrix((signs, where), shape=(count, self.count))[:, free]
        return kron(differences, np.eye(PARAMETERS), "csr")


def _reached(links: Sequence[Link], kept: Mask, count: int, hub: int) -> Mask:
    """Return which links are connected with the hub by kept links, shape (m,)."""
    part = _parts([(link.first, link.second) for link in compress(links, kept)], count)
    return np.array([part[link.first] == part[hub] for link in links], bool)


def _parts(edges: Sequence[tuple[int, int]], count: int) -> NDArray[np.int_]:
    """Return which connected part of a graph each of its nodes lies in, shape (count,)."""
    first, second = np.array(edges, int).reshape(-1, 2).T
    graph = coo_matrix((np.ones(len(edges)), (first, second)), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1])
