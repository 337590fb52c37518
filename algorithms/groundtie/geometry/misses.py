"""Residuals of points that took no part in a model's fit."""

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
        Positions of the points, shape (n, 2).
    residuals_px
        Residuals against the model, shape (n, 2).
    radius_px
        Radius of the search windows.
    max_error_px
        Largest accepted root mean square error of inliers.
    tolerance_px
        Distance within which a point agrees with the model.
    """

    px: FloatArray
    residuals_px: FloatArray
    radius_px: int
    max_error_px: float
    tolerance_px: float = TOLERANCE_PX

    @cached_property
    def mixture(self) -> Mixture:
        """Normally distributed inliers, and outliers uniformly distributed over the windows."""
        area = (2 * self.radius_px + 1) ** 2
        return fit_mixture(self.residuals_px, area, sigma_range_px(self.max_error_px))

    @property
    def rmse_px(self) -> float:
        """Root mean square error of inliers."""
        return self.mixture.sigma * math.sqrt(2)

    @property
    def agreeing(self) -> int:
        """Number of points that agree with the model."""
        return int((np.hypot(*self.residuals_px.T) <= self.tolerance_px).sum())

    def log10_chance(self, total: int) -> float:
        """Return log10 of the probability that as many of `total` random matches would agree."""
        probability = agreement_probability(self.tolerance_px, self.radius_px)
        return log10_chance(self.agreeing, total, probability)
