"""Prediction of a transform's accuracy at a random place, from its tie points and check points.

The residual of a check point is not the error of the transform: it includes the matching error of
the point itself. The error of the transform has three sources: its variation with the choice of
points (jackknife), the residual that neighbouring check points share, and displacements common to
all points. The latter are due to heights, and to their residual effect if the ground is uncertain.
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

# Lattice points adjacent along a side or a diagonal are neighbours: at most √2 spacings apart.
NEIGHBOUR_SPACINGS = 1.5

# With this many draws at each place, quantiles are accurate to 1 or 2 %.
_DRAWS = 1000

# A smaller sum of inlier weights counts as no inlier.
_LEAST_WEIGHT = 1e-9

# Probability that the interval contains the true figure.
_CONFIDENCE = 0.9


@dataclass(frozen=True)
class Ellipse:
    """The ellipse that holds 90 % of the errors at a random place, by their covariance.

    Parameters
    ----------
    major_px, minor_px
        Semi-axes.
    angle_deg
        Direction of the major axis, clockwise from the top of the grid, 0 to 180.
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
        Radii that hold the error with probabilities of 50, 90 and 95 %.
    ce90_range_px
        Interval that contains `ce90_px` with a probability of 90 %; few points leave it uncertain.
    ellipse
        Distribution of the errors about the place.
    heights_px
        Contribution of heights to the error, at most; the same at all places.
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
    """Displacements common to all points, which check points cannot reveal.

    Parameters
    ----------
    heights_px
        Largest displacement of all points by heights, to either side, shape (2,).
    sigma_px
        Standard deviation along an axis of an isotropic displacement.
    """

    heights_px: FloatArray = field(default_factory=lambda: np.zeros(2))
    sigma_px: float = 0.0


NOTHING_COMMON = Common()


@dataclass(frozen=True)
class ErrorModel:
    """The error of a transform, modelled from its points.

    The random part follows the scatter of the models that each leave out one block of points
    ([Efron1993]). Its variance is the mean of two variances at the check points: that of these
    models, and that which neighbouring check points share. It has Student's distribution, with one
    degree of freedom less than there are blocks. The common part displaces all points: uniformly
    distributed up to the largest displacement by heights, plus an isotropic normal displacement.

    Parameters
    ----------
    fold_models
        Models that each leave out one block of points, between pixel positions.
    check
        Points that took no part in the fit.
    common
        Displacements common to all points.
    """

    fold_models: Sequence[PointFunction]
    check: Misses
    common: Common = NOTHING_COMMON

    @property
    def is_unknown(self) -> bool:
        """Whether there are too few blocks, or no check points, for a prediction."""
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
        # A few blocks determine their variance poorly: hence Student's distribution.
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
        # Variance of the uniform distribution of the displacement by heights.
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

        This is the deviation that `accuracy` draws from, without the widening for the uncertainty
        of a variance from few blocks. Infinite if the error is unknown.
        """
        if self.is_unknown:
            return np.full(len(places_px), np.inf)
        random = (self._deviations(places_px) ** 2).sum(axis=0).mean(axis=-1) * self._factor**2
        # Variance of the uniform distribution of the displacement by heights.
        alike = float((self.common.heights_px**2).mean()) / 3 + self.common.sigma_px**2
        return np.asarray(np.sqrt(random + alike))

    def _deviations(self, px: FloatArray) -> FloatArray:
        return jackknife_deviations([model(px) for model in self.fold_models])

    @cached_property
    def _shared(self) -> tuple[float, float]:
        return shared_by_neighbours(self.check)

    @cached_property
    def _block_variance_px2(self) -> float:
        """Mean jackknife variance along an axis at the check points."""
        return float((self._deviations(self.check.px) ** 2).sum(axis=0).mean())

    @cached_property
    def _factor(self) -> float:
        """Ratio of the predicted deviations to those of the jackknife.

        The predicted variance is the mean of the jackknife's and of that which check points share.
        """
        blocks, shared = self._block_variance_px2, self._shared[0]
        return 1.0 if blocks <= 0 else math.sqrt((blocks + shared) / (2 * blocks))


def shared_by_neighbours(check: Misses) -> tuple[float, float]:
    """Return the variance along an axis that neighbours share, and the variance of its noise.

    The shared variance is 0 without neighbours. The matching errors of two points are independent,
    so that the mean product of their residuals is the variance of the part they share: the error
    of the transform. Points are weighted by their probabilities to be inliers.
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
    """Return the degrees of freedom of the mean of the two variances ([Satterthwaite1946]).

    The error that all check points share is a single draw along two axes, estimated amid the noise
    of the neighbours' products. The result is no fewer than Student's distribution has: that noise
    must not reduce it further.
    """
    by_check = shared_px2**2 + noise_px4
    total = blocks_px2**2 / (count - 1) + by_check
    found = 2 * (blocks_px2 + shared_px2) ** 2 / total if total > 0 else 0.0
    return max(found, count - 1.0)
