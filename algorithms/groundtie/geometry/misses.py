"""By how much a model misses points that took no part in its fit."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..rasters.grid import FloatArray
from .chance import agreement_probability, log10_chance
from .judging import TOLERANCE_PX, sigma_range_px
from .robust import Mixture, fit_mixture


@dataclass(frozen=True)
class Misses:
    """Residuals of held-out points, inliers and outliers among them.

    Parameters
    ----------
    px
        Where the points lie, shape (n, 2).
    residuals_px
        By how much the model misses them, shape (n, 2).
    radius_px
        Radius of the windows in which they were searched for.
    max_error_px
        Largest root mean square error of inliers that is accepted.
    tolerance_px
        Within which a point agrees with the model.
    """

    px: FloatArray
    residuals_px: FloatArray
    radius_px: int
    max_error_px: float
    tolerance_px: float = TOLERANCE_PX

    @cached_property
    def mixture(self) -> Mixture:
        """Inliers, normally distributed, and outliers anywhere in the windows."""
        area = (2 * self.radius_px + 1) ** 2
        return fit_mixture(self.residuals_px, area, sigma_range_px(self.max_error_px))

    @property
    def rmse_px(self) -> float:
        """Root mean square error of inliers."""
        return self.mixture.sigma * math.sqrt(2)

    @property
    def agreeing(self) -> int:
        """How many points agree."""
        return int((np.hypot(*self.residuals_px.T) <= self.tolerance_px).sum())

    def log10_chance(self, total: int) -> float:
        """Return log10 of the probability that as many of so many random matches would agree."""
        probability = agreement_probability(self.tolerance_px, self.radius_px)
        return log10_chance(self.agreeing, total, probability)
