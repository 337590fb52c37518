"""How accurate a transform is at a random place: a prediction from what its points show.

Residuals of check points are no errors of the transform: each holds its own matching error, too.
What the transform errs by is what it would change by with other points (jackknife), what
neighbouring check points have in common, and what displaces all points alike: heights, and what
of them is left where the ground is not known for sure.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.special import gammaincinv

from ..rasters.grid import FloatArray, PointFunction
from ..rasters.reading import Mask
from .estimation import jackknife_deviations
from .judging import CE90_FACTOR
from .misses import Misses

# Points at a side or a corner of each other are neighbours: √2 spacings are the farthest.
NEIGHBOUR_SPACINGS = 1.5

# A quantile of so many draws at each place is good to 1 or 2 %.
_DRAWS = 1000

# Fewer inliers than this, by their weights, are none.
_LEAST_WEIGHT = 1e-9

# The interval holds the true figure with this probability.
_CONFIDENCE = 0.9


@dataclass(frozen=True)
class Ellipse:
    """The ellipse that holds 90 % of the errors at a random place, by their covariance.

    Parameters
    ----------
    major_px, minor_px
        Its semi-axes.
    angle_deg
        Direction of the longer one, clockwise from the top of the grid, 0 to 180.
    """

    major_px: float
    minor_px: float
    angle_deg: float

    @classmethod
    def of(cls, covariance_px2: FloatArray) -> Ellipse:
        """Return the ellipse of a covariance of errors (x, y), shape (2, 2)."""
        (minor, major), axes = np.linalg.eigh(covariance_px2)
        x, y = axes[:, 1]
        return cls(
            CE90_FACTOR * math.sqrt(max(major, 0.0)),
            CE90_FACTOR * math.sqrt(max(minor, 0.0)),
            math.degrees(math.atan2(x, -y)) % 180,
        )


UNKNOWN_ELLIPSE = Ellipse(math.nan, math.nan, math.nan)


@dataclass(frozen=True)
class Accuracy:
    """Radii within which the error of a transform at a random place lies, in pixels.

    Parameters
    ----------
    ce50_px, ce90_px, ce95_px
        With probabilities of 50, 90 and 95 %.
    ce90_range_px
        Interval that holds `ce90_px` with 90 %: it is known from few points only.
    ellipse
        How the errors lie about the place.
    heights_px
        How much of the error heights may make, the same at all places.
    """

    ce50_px: float
    ce90_px: float
    ce95_px: float
    ce90_range_px: tuple[float, float]
    ellipse: Ellipse = UNKNOWN_ELLIPSE
    heights_px: float = math.nan


UNKNOWN = Accuracy(math.nan, math.nan, math.nan, (math.nan, math.nan))


@dataclass(frozen=True)
class Common:
    """What displaces all points alike, so that no check point shows it.

    Parameters
    ----------
    heights_px
        The most that heights may displace all points by, to either side, shape (2,).
    sigma_px
        Standard deviation along an axis of a displacement in any direction.
    """

    heights_px: FloatArray = field(default_factory=lambda: np.zeros(2))
    sigma_px: float = 0.0


NOTHING_COMMON = Common()


@dataclass(frozen=True)
class ErrorModel:
    """What is known of the error of a transform, by its points.

    Its random part is that of the models without one block of points after the other
    ([Efron1993]), with the mean of two variances at the check points: theirs, and what the check
    points share. It has Student's distribution, with one degree of freedom less than there are
    blocks. Its common part is what heights displace all points by, evenly up to the largest, and
    a normal displacement in any direction.

    Parameters
    ----------
    fold_models
        The models without one block of points after the other, between pixel positions.
    check
        Points that took no part.
    common
        What displaces all points alike.
    """

    fold_models: Sequence[PointFunction]
    check: Misses
    common: Common = NOTHING_COMMON

    @property
    def is_unknown(self) -> bool:
        """Whether there are too few blocks, or no check points, to predict anything by."""
        return len(self.fold_models) < 2 or len(self.check.px) == 0

    def accuracy(self, places_px: FloatArray) -> Accuracy:
        """Predict the error at a random one of some places, shape (m, 2)."""
        if self.is_unknown:
            return UNKNOWN
        count, common = len(self.fold_models), self.common
        shared, noise = self._shared
        blocks, factor = self._block_variance_px2, self._factor
        deviations = self._deviations(places_px)
        random = np.random.default_rng(0)
        parts = random.standard_normal((_DRAWS, count)) * factor
        moved = np.einsum("dk,kmx->dmx", parts, deviations)
        alike = random.uniform(-1, 1, (_DRAWS, 1, 1)) * common.heights_px
        # So few blocks know their variance badly: Student's distribution.
        known = random.chisquare(count - 1, (_DRAWS, 1, 1)) / (count - 1)
        alike = alike + random.normal(0, common.sigma_px, (_DRAWS, 1, 2))

        def radii(scale: FloatArray | float, shares: Sequence[float]) -> list[float]:
            error = moved * scale + alike
            return [float(r) for r in np.quantile(np.hypot(error[..., 0], error[..., 1]), shares)]

        ce50, ce90, ce95 = radii(1 / np.sqrt(known), (0.5, 0.9, 0.95))
        freedom = _degrees_of_freedom(blocks, count, shared, noise)
        low, high = (
            radii(math.sqrt(freedom / (2 * float(gammaincinv(freedom / 2, share)))), (0.9,))[0]
            for share in ((1 + _CONFIDENCE) / 2, (1 - _CONFIDENCE) / 2)
        )
        # Heights displace evenly between both limits.
        covariance = factor**2 * np.einsum("kmx,kmy->xy", deviations, deviations) / len(places_px)
        covariance += np.outer(common.heights_px, common.heights_px) / 3
        covariance += common.sigma_px**2 * np.eye(2)
        return Accuracy(
            ce50,
            ce90,
            ce95,
            (min(low, ce90), max(high, ce90)),
            Ellipse.of(covariance),
            float(np.hypot(*common.heights_px)),
        )

    def standard_deviation_px(self, places_px: FloatArray) -> FloatArray:
        """Return the standard deviation of the error along an axis at places, shape (m,).

        What `accuracy` draws from, without what so few blocks leave unknown of the variance;
        infinite where that predicts nothing.
        """
        if self.is_unknown:
            return np.full(len(places_px), np.inf)
        random = (self._deviations(places_px) ** 2).sum(axis=0).mean(axis=-1) * self._factor**2
        # Heights: of an even distribution between both limits.
        alike = float((self.common.heights_px**2).mean()) / 3 + self.common.sigma_px**2
        return np.asarray(np.sqrt(random + alike))

    def _deviations(self, px: FloatArray) -> FloatArray:
        return jackknife_deviations([model(px) for model in self.fold_models])

    @cached_property
    def _shared(self) -> tuple[float, float]:
        return shared_by_neighbours(self.check)

    @cached_property
    def _block_variance_px2(self) -> float:
        """Mean variance along an axis that blocks of points leave at the check points."""
        return float((self._deviations(self.check.px) ** 2).sum(axis=0).mean())

    @cached_property
    def _factor(self) -> float:
        """By how much deviations are larger than those of blocks show.

        Their variance is the mean of what blocks show and of what check points share.
        """
        blocks, shared = self._block_variance_px2, self._shared[0]
        return 1.0 if blocks <= 0 else math.sqrt((blocks + shared) / (2 * blocks))


def shared_by_neighbours(check: Misses) -> tuple[float, float]:
    """Return the variance along an axis of what neighbours have in common, and that of its noise.

    The first is 0 without neighbours. The matching errors of two points are independent, so that
    the mean product of their residuals is the variance of what they share: the error of the
    transform. Points count by their probabilities to be inliers.
    """
    weights, residuals = check.mixture.probability, check.residuals_px
    pairs = np.outer(weights, weights) * _are_neighbours(check.px)
    count = max(float(pairs.sum()), _LEAST_WEIGHT)
    products = residuals @ residuals.T / 2
    shared = max(float((pairs * products).sum()) / count, 0.0)
    squared = (residuals**2).sum(axis=1) / 2
    variance = float((weights * squared).sum()) / max(float(weights.sum()), _LEAST_WEIGHT)
    return shared, variance**2 / count


def _are_neighbours(px: FloatArray) -> Mask:
    """Return which points, (n, 2), are neighbours, shape (n, n)."""
    if len(px) < 2:
        return np.zeros((len(px),) * 2, bool)
    apart = np.hypot(*(px[:, None] - px).transpose(2, 0, 1))
    np.fill_diagonal(apart, np.inf)
    return np.asarray(apart <= NEIGHBOUR_SPACINGS * np.median(apart.min(axis=1)))


def _degrees_of_freedom(
    blocks_px2: float, count: int, shared_px2: float, noise_px4: float
) -> float:
    """Return those of the mean of the two variances, by their own variances ([Satterthwaite1946]).

    What all check points share was drawn once, along two axes, and is found among the noise of the
    products of neighbours. No fewer than Student's distribution has, as noise is no variance.
    """
    by_check = shared_px2**2 + noise_px4
    total = blocks_px2**2 / (count - 1) + by_check
    found = 2 * (blocks_px2 + shared_px2) ** 2 / total if total > 0 else 0.0
    return max(found, count - 1.0)
