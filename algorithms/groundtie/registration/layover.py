"""Displacement of matches by heights, estimated from their scatter.

Layover and relief displacement move elevated objects by amounts that depend on the view, but
everywhere in a pair along the same line on the map. Heights therefore scatter matched chips along
this line and not across it, whereas matching errors go in all directions.
"""

from __future__ import annotations

import math

import numpy as np

from ..geometry.misses import Misses
from ..matching.survey import SURVEY_RADIUS_PX, Survey
from ..rasters.grid import FloatArray

# Ratio of the mean displacement by heights, by which a model through elevated objects is off, to
# their scatter. Measured by the suite sar_sar: 2 to 6 with keypoints; 7 to 9 with chips, which see
# several heights at once. Roofs of one height scatter little.
KEYPOINTS_MEAN_OVER_SCATTER = 3.0
CHIPS_MEAN_OVER_SCATTER = 6.0

# The same ratio for heights that are distributed evenly from the ground up.
_EVEN_MEAN_OVER_SCATTER = math.sqrt(3)

# Scatter along a line is due to heights unless chance explains it by two tests, each at the usual
# level of 5 %.
_SIGNIFICANCE = 0.05


def mean_of_heights_px(
    survey: Survey | None, layover_factor: float | None, max_error_px: float
) -> FloatArray:
    """Return the mean displacement of all matches by heights, from chips' scatter, shape (2,).

    All may be displaced by as much to either side where a mask leaves more ground than elevated
    objects. Callers double it where the ground may be the lowest of the matched surfaces.
    """
    if survey is None or len(survey.centres) == 0:
        return np.zeros(2)
    shifts = survey.shifts_px
    misses = Misses(survey.centres.astype(float), shifts, SURVEY_RADIUS_PX, max_error_px)
    scatter = scatter_along_line(shifts, misses.mixture.probability)
    return (layover_factor or _EVEN_MEAN_OVER_SCATTER) * scatter


def scatter_along_line(residuals_px: FloatArray, weights: FloatArray) -> FloatArray:
    """Return the scatter of residuals along a line in excess of the scatter across it.

    n pairs of normal variates have a sphericity of w or less with probability w^((n − 2) / 2)
    [Mauchly1940]; a few wrong matches hide the line from it. The mean of n unit vectors at twice
    the angles of the residuals is r or longer with probability exp(−n r²) [Mardia2000], however far
    the matches lie.

    Parameters
    ----------
    residuals_px
        Shape (n, 2).
    weights
        Their probabilities to be inliers, shape (n,).

    Returns
    -------
    float64 array (2,)
        Along the line, as long as the standard deviation; 0 if chance may explain it.
    """
    count = float(weights.sum())
    if count < 3:
        return np.zeros(2)
    (across, along), axes = np.linalg.eigh(np.cov(residuals_px.T, aweights=weights))
    sphericity = max(across * along / max(((across + along) / 2) ** 2, 1e-12), 1e-12)
    directed = abs(weights @ np.exp(2j * np.arctan2(*residuals_px.T))) / count
    by_chance = sphericity ** ((count - 2) / 2), math.exp(-count * directed**2)
    if min(by_chance) > _SIGNIFICANCE:
        return np.zeros(2)
    return np.asarray(math.sqrt(along - across) * axes[:, 1])
