"""Whether two radar images were registered by what stands on the ground, and not by the ground.

What stands leans towards the radar, by other amounts from other incidence angles and orbits, but
anywhere in a pair along the same line on the map. So heights show: matches are exact across this
line and scattered along it, where errors of matching go in all directions.
"""

from __future__ import annotations

import math

import numpy as np

from ..geometry.chance import log10_false_alarms
from ..geometry.estimation import Estimate
from ..geometry.judging import LARGEST_LOG10_CHANCE, TOLERANCE_PX
from ..geometry.tie_points import TiePoints
from ..rasters.grid import FloatArray, Grid

# Points lie on a line if they are no further from it, in matching pixels.
_LINE_PX = 1.0

# Check points that lean, over those that agree: from here on nobody knows which are the ground.
# Measured on pairs that were registered right: up to 0.56; on others: from 0.78.
_LEANING_SHARE = 2 / 3

# A model through what stands is off by the mean of its heights, which is as many times what they
# scatter by. Measured: 2 to 6 with features; 7 to 9 with chips, which see several heights at once.
# A plain of roofs scatters little.
FEATURES_MEAN_OVER_SCATTER = 3.0
CHIPS_MEAN_OVER_SCATTER = 6.0


def leaning(
    estimate: Estimate,
    check: TiePoints,
    grid: Grid,
    max_error_px: float,
    radius_px: int,
    mean_over_scatter: float = FEATURES_MEAN_OVER_SCATTER,
) -> str | None:
    """Return why a registration may be that of what stands, in a sentence; None: it is not.

    Parameters
    ----------
    estimate, check, grid, max_error_px, radius_px
        See `verdict.judge`.
    mean_over_scatter
        How many times what heights move the matched points' scatter by, they move the model.
    """
    residuals = check.residual_on(grid, estimate.transform)
    far = residuals[np.hypot(*residuals.T) > TOLERANCE_PX]
    agreeing = len(residuals) - len(far)
    on_line = _on_a_line(far, radius_px)
    if on_line >= max(_LEANING_SHARE * agreeing, 1):
        return (
            f"{on_line} of {len(check)} check points lie along a line beside the {agreeing} that "
            "agree: ground and what stands on it; give a mask of the ground"
        )
    used = estimate.points.take(estimate.points.used)
    scatter = _scatter_along_a_line(used.residual_on(grid, estimate.transform))
    if mean_over_scatter * scatter > max_error_px:
        return (
            f"matched points scatter by {scatter:.1f} px along a line more than across it, as "
            "heights do; give a mask of the ground"
        )
    return None


def _on_a_line(residuals: FloatArray, radius_px: int) -> int:
    """Return how many residuals lie on one line through zero; 0 if random ones may, too."""
    if len(residuals) == 0:
        return 0
    direction = residuals / np.hypot(*residuals.T)[:, None]
    across = residuals[:, 0] * direction[:, None, 1] - residuals[:, 1] * direction[:, None, 0]
    most = int((np.abs(across) <= _LINE_PX).sum(axis=1).max())
    # The longest such strip runs from corner to corner of the search window.
    probability = min(math.sqrt(2) * 2 * _LINE_PX / (2 * radius_px + 1), 1.0)
    alarms = log10_false_alarms(most, len(residuals), probability, 1)
    return most if alarms <= LARGEST_LOG10_CHANCE else 0


def _scatter_along_a_line(residuals: FloatArray) -> float:
    """Return what residuals scatter by along a line beyond what they do across it, in pixels.

    0 if residuals without a direction may do so, too: n pairs of normal variates are as far from
    spherical as w, or further, with probability w^((n − 2) / 2) (Mauchly 1940).
    """
    if len(residuals) < 3:
        return 0.0
    across, along = np.linalg.eigvalsh(np.cov(residuals.T))
    sphericity = across * along / max(((across + along) / 2) ** 2, 1e-12)
    if (len(residuals) - 2) / 2 * math.log10(max(sphericity, 1e-12)) > LARGEST_LOG10_CHANCE:
        return 0.0
    return float(np.sqrt(along - across))
