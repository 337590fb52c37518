"""The similarity of two windows as a function of their pose, for searches that climb it.

Grey values are sorted into bins once. Whole-pixel shifts of equally large pixels are counted at
aligned grids, which is cheap (thesis S 4.4.2); any other pose by generalised partial volume
estimation.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import ParameterError
from ..pose.pose import Pose, PoseFound, PoseLimits
from ..rasters.patch import Patch
from ..similarity.binning import MASKED, to_bins
from ..similarity.correlation import MINIMUM_OVERLAP
from ..similarity.joint_histogram import ORDER
from ..similarity.measures import HistogramMeasure
from ..similarity.surface import SimilaritySettings
from .histogramming import joint_histogram_under
from .measures import HISTOGRAM_MEASURES

Bins = NDArray[np.uint8]

# A point of the space that is searched; see `PoseSpace`.
Place = tuple[float, ...]
Climb = Callable[["Counted", "PoseSpace", Place, np.random.Generator], Place]

# Peaks nearer than this are the same candidate, in pixels; so many are returned.
_SAME_PX = 4.0
_CANDIDATES = 4

# Where the input lies if its georeferencing is right.
_CLAIMED = Pose()


@dataclass(frozen=True)
class Effort:
    """How hard a search that climbs tries.

    Parameters
    ----------
    start
        Where the first climb starts.
    restarts
        How often it may start again, at places drawn evenly from within the limits.
    agreeing
        After so many climbs have ended at the best place, there are no more.
    seed
        Of everything that is drawn.
    """

    start: Pose = _CLAIMED
    restarts: int = 31
    agreeing: int = 3
    seed: int = 0


EFFORT = Effort()


@dataclass(frozen=True)
class BinnedPair:
    """Two windows, binned, and how their similarity is measured.

    Parameters
    ----------
    template, image
        Bins of the reference and the input, `MASKED` where a pixel does not count.
    counts
        Number of bins of each.
    measure
        Similarity of a joint histogram.
    order
        Order of the B-spline for poses between aligned grids.
    """

    template: Bins
    image: Bins
    counts: tuple[int, int]
    measure: HistogramMeasure
    order: int

    @cached_property
    def nothing(self) -> float:
        """The similarity of independent images with these grey values: where none overlap."""
        own, other = (
            np.bincount(bins[bins != MASKED], minlength=count).astype(float)
            for bins, count in zip((self.template, self.image), self.counts, strict=True)
        )
        return float(self.measure(np.outer(own, other)))

    @cached_property
    def _least(self) -> float:
        return MINIMUM_OVERLAP * float(np.count_nonzero(self.template != MASKED))

    @property
    def origin(self) -> tuple[float, float]:
        """Shift (right, down) of the aligned grids nearest to 0: 0, or -0.5 for unlike parity."""
        height, width = np.subtract(self.image.shape, self.template.shape)
        return width // 2 - width / 2, height // 2 - height / 2

    def aligned(self, shift_px: tuple[float, float]) -> float:
        """Return the similarity at a shift (right, down) at which the pixel grids meet.

        Such shifts are whole numbers of pixels from `origin`.
        """
        pairs = zip(shift_px, self.image.shape[::-1], self.template.shape[::-1], strict=True)
        right, down = (round(s + (image - own) / 2) for s, image, own in pairs)
        template = _shifted(self.template, (-right, -down), self.image.shape)
        image = _shifted(self.image, (right, down), self.template.shape)
        if template.size == 0:
            return self.nothing
        # Masked pixels go to one extra bin that is dropped; OpenCV's own mask is much slower.
        sizes = [count + 1 for count in self.counts]
        pair = [np.minimum(template, self.counts[0]), np.minimum(image, self.counts[1])]
        ranges = [0, sizes[0], 0, sizes[1]]
        counted = cv2.calcHist(pair, [0, 1], None, sizes, ranges)
        return self._similarity(counted[:-1, :-1].astype(np.float64))

    def under(self, pose: Pose) -> float:
        """Return the similarity at any pose."""
        to_image = pose.between(self.template.shape, self.image.shape)
        return self._similarity(
            joint_histogram_under(self.template, self.image, to_image, self.counts, self.order)
        )

    def _similarity(self, histogram: NDArray[np.float64]) -> float:
        """Return the measure, or what independent images have where too little overlaps."""
        if histogram.sum() < self._least:
            return self.nothing
        return float(self.measure(histogram))


def _shifted(bins: Bins, start: tuple[int, int], shape: tuple[int, ...]) -> Bins:
    """Return the part of an image that a window of a shape, put at (col, row), covers."""
    (col, row), (height, width) = start, shape
    return bins[max(row, 0) : max(row + height, 0), max(col, 0) : max(col + width, 0)]


def bin_pair(reference: Patch, input: Patch, settings: SimilaritySettings) -> BinnedPair | None:
    """Return two windows binned, or None if one of them is flat and has nothing to compare.

    Of the similarity "fused", only what is measured on joint histograms takes part: NMI.

    Raises
    ------
    ParameterError
        The similarity is not measured on joint histograms.
    """
    name = "nmi" if settings.similarity == "fused" else settings.similarity
    if name not in HISTOGRAM_MEASURES:
        raise ParameterError(f"{name} is not measured on joint histograms, as this search needs")
    if reference.is_flat or input.is_flat:
        return None
    bins = settings.bins_for(reference.values.size)
    template, image = (to_bins(patch.values, patch.valid, bins) for patch in (reference, input))
    return BinnedPair(template, image, (bins, bins), HISTOGRAM_MEASURES[name], ORDER)


class Counted:
    """A function that is evaluated once at every place, and counts how often."""

    def __init__(self, function: Callable[[Place], float]) -> None:
        self._function = function
        self._values: dict[Place, float] = {}

    def __call__(self, place: Place) -> float:
        """Return the value at a place."""
        if place not in self._values:
            self._values[place] = self._function(place)
        return self._values[place]

    @property
    def evaluations(self) -> int:
        """At how many places it was evaluated."""
        return len(self._values)


@dataclass(frozen=True)
class PoseSpace:
    """Poses within limits as places (right, down[, rotation][, scale]), all in pixels.

    One pixel of rotation or of (logarithmic) scale moves the template's pixels by one pixel, in
    the root mean square, so that steps are alike in all directions.

    Parameters
    ----------
    limits
        What is searched; what may not vary is no dimension, but for the shift.
    spread_px
        Root mean square distance of the template's pixels from its centre.
    origin
        A shift at which the pixel grids meet: only those whole pixels from it are places. None:
        all shifts are.
    """

    limits: PoseLimits
    spread_px: float
    origin: tuple[float, float] | None = None

    @property
    def bounds(self) -> NDArray[np.float64]:
        """Lowest and highest value of every dimension, shape (dimensions, 2)."""
        radius = self.limits.radius_px
        rows = [(-radius, radius)] * 2
        if self.origin is not None:
            rows = [(o - np.floor(radius + o), o + np.floor(radius - o)) for o in self.origin]
        if self._turns:
            turned = np.radians(self.limits.rotation_deg) * self.spread_px
            rows.append((-turned, turned))
        if self._scales:
            low, high = np.log(self.limits.scale) * self.spread_px
            rows.append((low, high))
        return np.array(rows, float)

    @property
    def _turns(self) -> bool:
        return self.limits.rotation_deg > 0

    @property
    def _scales(self) -> bool:
        return self.limits.scale[0] < self.limits.scale[1]

    def settle(self, values: ArrayLike) -> Place:
        """Return the place nearest to some values, shape (dimensions,)."""
        place = np.array(values, float)
        if self.origin is not None:
            origin = np.array(self.origin)
            place[:2] = np.rint(place[:2] - origin) + origin
        low, high = self.bounds.T
        return tuple(map(float, np.clip(place, low, high)))

    def draw(self, rng: np.random.Generator) -> Place:
        """Return a place drawn evenly."""
        return self.settle(rng.uniform(*self.bounds.T))

    def pose(self, place: Place) -> Pose:
        """Return the pose at a place."""
        right, down = place[:2]
        others = list(place[2:])
        rotation = np.degrees(others.pop(0) / self.spread_px) if self._turns else 0.0
        scale = np.exp(others.pop(0) / self.spread_px) if self._scales else self.limits.scale[0]
        return Pose(float(rotation), float(scale), (right, down))

    def place(self, pose: Pose) -> Place:
        """Return the place nearest to a pose."""
        values = [*pose.shift_px]
        if self._turns:
            values.append(np.radians(pose.rotation_deg) * self.spread_px)
        if self._scales:
            values.append(np.log(pose.scale) * self.spread_px)
        return self.settle(values)


def spread_px(shape: tuple[int, ...]) -> float:
    """Return the root mean square distance of a window's pixels from its centre."""
    height, width = shape
    return float(np.hypot(height, width) / np.sqrt(12))


@dataclass(frozen=True)
class Climbed:
    """Where climbs ended, in their order, and the similarity at all starts they might have had."""

    ends: tuple[Place, ...]
    background: tuple[float, ...]


def climb_often(
    similarity: Counted, space: PoseSpace, climb: Climb, effort: Effort, same_px: float
) -> Climbed:
    """Climb from a start and from drawn ones, until enough climbs end at the best place.

    Parameters
    ----------
    similarity
        What is climbed.
    space
        Where.
    climb
        Returns the best place it found from a start.
    effort
        Where and how often to start.
    same_px
        Ends are the same place if they differ by no more in any dimension.
    """
    rng = np.random.default_rng(effort.seed)
    starts = [space.draw(rng) for _ in range(effort.restarts)]
    background = tuple(similarity(start) for start in starts)
    ends: list[Place] = []
    for start in [space.place(effort.start), *starts]:
        ends.append(climb(similarity, space, start, rng))
        best = max(ends, key=similarity)
        if sum(_apart_px(end, best) <= same_px for end in ends) >= effort.agreeing:
            break
    return Climbed(tuple(ends), background)


def search_by_climbing(
    pair: BinnedPair, space: PoseSpace, climb: Climb, effort: Effort, same_px: float
) -> list[PoseFound]:
    """Return the best distinct places that climbs end at, best first.

    Heights are in robust standard deviations of the similarity at the drawn starts. Evaluations
    are those of the whole search, starts included: before its end, no candidate is known as such.
    """

    def at(place: Place) -> float:
        pose = space.pose(place)
        return pair.under(pose) if space.origin is None else pair.aligned(pose.shift_px)

    similarity = Counted(at)
    climbed = climb_often(similarity, space, climb, effort, same_px)
    level, spread = _background(climbed.background)
    found: list[Place] = []
    for end in sorted(climbed.ends, key=similarity, reverse=True):
        distinct = all(_apart_px(end, other) > _SAME_PX for other in found)
        if distinct and similarity(end) != pair.nothing:
            found.append(end)
    heights = [(similarity(end) - level) / spread if spread > 0 else 0.0 for end in found]
    return [
        PoseFound(space.pose(end), height, similarity.evaluations)
        for end, height in zip(found[:_CANDIDATES], heights, strict=False)
    ]


def _apart_px(one: Place, other: Place) -> float:
    return float(np.abs(np.subtract(one, other)).max())


def _background(values: Sequence[float]) -> tuple[float, float]:
    """Return median and robust standard deviation."""
    if not values:
        return 0.0, 0.0
    level = float(np.median(values))
    return level, 1.4826 * float(np.median(np.abs(np.subtract(values, level))))
