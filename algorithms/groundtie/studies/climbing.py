"""Pose searches that climb the similarity from several starting points."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..context import Context
from ..errors import ParameterError
from ..geometry.limits import SearchLimits
from ..pose.pose import Pose, PoseFound
from ..rasters.patch import Patch
from ..similarity.order_statistics import robust_deviation
from ..similarity.surface import SimilaritySettings
from .objective import BinnedPair, bin_pair

# A point of the search space; see `PoseSpace`.
Place = tuple[float, ...]
Similarity = Callable[[Place], float]
Climb = Callable[[Similarity, "PoseSpace", Place, np.random.Generator], Place]

# Approximate width of a similarity peak, and the required precision of a place, in pixels.
PEAK_PX = 4.0
PRECISION_PX = 0.05

# Largest number of candidates that are returned.
_CANDIDATES = 4

# Climbs that end within this distance, in pixels, agree; on aligned grids, ends must be equal.
_SAME_END_PX = 1.0


@dataclass(frozen=True)
class Effort:
    """Effort of a climbing search.

    Parameters
    ----------
    restarts
        Largest number of restarts, at places drawn uniformly within the limits.
    agreeing
        The search stops when this many climbs have ended at the best place.
    """

    restarts: int = 31
    agreeing: int = 3


@dataclass(frozen=True)
class PoseSpace:
    """Poses within limits as places (right, down[, rotation][, scale]), all in pixels.

    One pixel of rotation or of (logarithmic) scale moves the template's pixels by one pixel in
    the root mean square, so that equal steps have equal effects in all dimensions.

    Parameters
    ----------
    limits
        Limits of the search. A fixed rotation or scale is not a dimension; the shift always is.
    spread_px
        Root mean square distance of the template's pixels from its centre.
    origin
        A shift that aligns the pixel grids; places then have shifts at whole pixels from it. None:
        places may have any shift.
    """

    limits: SearchLimits
    spread_px: float
    origin: tuple[float, float] | None = None

    @property
    def bounds(self) -> NDArray[np.float64]:
        """Lowest and highest value of every dimension, shape (dimensions, 2)."""
        radius = self.limits.radius
        rows = [(-radius, radius)] * 2
        if self.origin is not None:
            rows = [(o - np.floor(radius + o), o + np.floor(radius - o)) for o in self.origin]
        if self._rotates:
            angle = np.radians(self.limits.rotation_deg) * self.spread_px
            rows.append((-angle, angle))
        if self._scales:
            low, high = np.log(self.limits.scale) * self.spread_px
            rows.append((low, high))
        return np.array(rows, float)

    @property
    def _rotates(self) -> bool:
        return self.limits.rotation_deg > 0

    @property
    def _scales(self) -> bool:
        return self.limits.scale[0] < self.limits.scale[1]

    def settle(self, values: ArrayLike) -> Place:
        """Return the place nearest to the given values, shape (dimensions,)."""
        place = np.array(values, float)
        if self.origin is not None:
            origin = np.array(self.origin)
            place[:2] = np.rint(place[:2] - origin) + origin
        low, high = self.bounds.T
        return tuple(map(float, np.clip(place, low, high)))

    def draw(self, rng: np.random.Generator) -> Place:
        """Return a place drawn uniformly."""
        return self.settle(rng.uniform(*self.bounds.T))

    def pose(self, place: Place) -> Pose:
        """Return the pose at a place."""
        right, down = place[:2]
        others = list(place[2:])
        rotation = np.degrees(others.pop(0) / self.spread_px) if self._rotates else 0.0
        scale = np.exp(others.pop(0) / self.spread_px) if self._scales else self.limits.scale[0]
        return Pose(float(rotation), float(scale), (right, down))

    def place(self, pose: Pose) -> Place:
        """Return the place nearest to a pose."""
        values = [*pose.shift_px]
        if self._rotates:
            values.append(np.radians(pose.rotation_deg) * self.spread_px)
        if self._scales:
            values.append(np.log(pose.scale) * self.spread_px)
        return self.settle(values)


def spread_px(shape: tuple[int, ...]) -> float:
    """Return the root mean square distance of a window's pixels from its centre."""
    height, width = shape
    return float(np.hypot(height, width) / np.sqrt(12))


def climb_often(
    similarity: Similarity, space: PoseSpace, climb: Climb, effort: Effort, seed: int
) -> tuple[list[Place], list[float]]:
    """Climb from the nominal pose and from drawn ones, until enough climbs end at the best place.

    Parameters
    ----------
    similarity
        The function to climb.
    space
        The search space.
    climb
        Returns the best place it found from a start.
    effort
        Limits on the number of climbs.
    seed
        Seed of all random numbers.

    Returns
    -------
    The ends of the climbs in order, and the similarity at all drawn starts, used or not.
    """
    rng = np.random.default_rng(seed)
    same_px = _SAME_END_PX if space.origin is None else 0.0
    starts = [space.draw(rng) for _ in range(effort.restarts)]
    background = [similarity(start) for start in starts]
    ends: list[Place] = []
    for start in [space.place(Pose()), *starts]:
        ends.append(climb(similarity, space, start, rng))
        best = max(ends, key=similarity)
        if sum(_apart_px(end, best) <= same_px for end in ends) >= effort.agreeing:
            break
    return ends, background


def search_by_climbing(
    pair: BinnedPair, space: PoseSpace, climb: Climb, effort: Effort, seed: int
) -> list[PoseFound]:
    """Return the best distinct places that climbs end at, best first.

    Heights are in robust standard deviations of the similarity at the drawn starts. Every candidate
    carries the number of evaluations of the whole search, drawn starts included, because no
    candidate is known before its end.
    """

    @cache
    def similarity(place: Place) -> float:
        pose = space.pose(place)
        return pair.under(pose) if space.origin is None else pair.aligned(pose.shift_px)

    ends, background = climb_often(similarity, space, climb, effort, seed)
    level, spread = _background(background)
    found: list[Place] = []
    for end in sorted(ends, key=similarity, reverse=True):
        distinct = all(_apart_px(end, other) > PEAK_PX for other in found)
        if distinct and similarity(end) != pair.nothing:
            found.append(end)
    evaluations = similarity.cache_info().misses
    return [
        PoseFound(
            space.pose(end), (similarity(end) - level) / spread if spread > 0 else 0.0, evaluations
        )
        for end in found[:_CANDIDATES]
    ]


@dataclass(frozen=True)
class ClimbingSearch:
    """A `PoseSearch` that climbs from several starts, drawn by the context's seed.

    Parameters
    ----------
    climb
        Returns the best place it found from a start.
    effort
        Limits on the number of climbs.
    on_grid
        Whether to search only shifts that align the windows' pixel grids. If one size is even and
        the other odd, such shifts between the window centres end in one half.
    """

    climb: Climb
    effort: Effort = Effort()
    on_grid: bool = False

    def __call__(
        self,
        reference: Patch,
        input: Patch,
        limits: SearchLimits,
        settings: SimilaritySettings,
        context: Context,
    ) -> list[PoseFound]:
        """Search within limits, in one thread, as every evaluation depends on earlier ones.

        Raises
        ------
        ParameterError
            The similarity is not measured on joint histograms; or the search on aligned grids
            includes rotation or scale.
        """
        if self.on_grid and not limits.is_shift:
            raise ParameterError("discrete SPSA searches for shifts alone")
        pair = bin_pair(reference, input, settings)
        if pair is None:
            return []
        origin = pair.origin if self.on_grid else None
        space = PoseSpace(limits, spread_px(reference.values.shape), origin)
        return search_by_climbing(pair, space, self.climb, self.effort, context.seed)


def _apart_px(one: Place, other: Place) -> float:
    return float(np.abs(np.subtract(one, other)).max())


def _background(values: Sequence[float]) -> tuple[float, float]:
    """Return median and robust standard deviation."""
    if not values:
        return 0.0, 0.0
    return float(np.median(values)), robust_deviation(np.asarray(values))
