"""Statistics of errors: RMSE, mean, median, CE90, largest, bias and standard deviation."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..rasters.grid import FloatArray


@dataclass(frozen=True)
class Statistics:
    """Errors in one unit, summarised; NaN where nothing was measured.

    Parameters
    ----------
    rmse, mean, median
        Of the errors' lengths.
    ce90
        Radius of the circle that holds 90 % of the errors (quantile of their lengths).
    largest
        Largest length.
    bias, std
        Mean and standard deviation along both axes: RMSE² is the sum of all four squared.
    """

    rmse: float
    mean: float
    median: float
    ce90: float
    largest: float
    bias: tuple[float, float]
    std: tuple[float, float]

    @classmethod
    def of(cls, errors: FloatArray) -> Statistics:
        """Measure errors, shape (n, 2)."""
        if len(errors) == 0:
            nan = math.nan
            return cls(nan, nan, nan, nan, nan, (nan, nan), (nan, nan))
        lengths = np.hypot(*errors.T)
        bias, std = errors.mean(axis=0), errors.std(axis=0)
        return cls(
            float(np.sqrt((lengths**2).mean())),
            float(lengths.mean()),
            float(np.median(lengths)),
            # Hazen's quantile is the least biased of the simple ones at few points.
            float(np.percentile(lengths, 90, method="hazen")),
            float(lengths.max()),
            (float(bias[0]), float(bias[1])),
            (float(std[0]), float(std[1])),
        )

    def scaled(self, factor: float) -> Statistics:
        """Return the numbers in another unit."""
        bias, std = ((factor * x, factor * y) for x, y in (self.bias, self.std))
        lengths = ("rmse", "mean", "median", "ce90", "largest")
        return Statistics(**{n: factor * getattr(self, n) for n in lengths}, bias=bias, std=std)

    def summary(self, unit: str, axes: tuple[str, str]) -> dict[str, float]:
        """Return the numbers by names that end in the unit."""
        values = {name: getattr(self, name) for name in ("rmse", "mean", "median", "ce90")}
        values["max"] = self.largest
        for name, pair in (("bias", self.bias), ("std", self.std)):
            values |= {f"{name}_{axis}": value for axis, value in zip(axes, pair, strict=True)}
        return {f"{name}_{unit}": value for name, value in values.items()}
