"""How far heights displace what matches, by how it scatters.

Layover and relief displacement move elevated objects by other amounts from other views, but
anywhere in a pair along the same line on the map. So heights show in where chips match: exact
across this line and scattered along it, where errors of matching go in all directions.
"""

from __future__ import annotations

import math

import numpy as np

from ..geometry.misses import Misses
from ..matching.survey import SURVEY_RADIUS_PX, Survey
from ..rasters.grid import FloatArray

# A model through elevated objects is off by the mean of their heights, which is as many times what
# they scatter by. Measured by the suite sar_sar: 2 to 6 with keypoints; 7 to 9 with chips, which
# see several heights at once. A plain of roofs scatters little.
KEYPOINTS_MEAN_OVER_SCATTER = 3.0
CHIPS_MEAN_OVER_SCATTER = 6.0

# The same of heights that spread evenly from the ground up: mean over standard deviation.
_EVEN_MEAN_OVER_SCATTER = math.sqrt(3)

# Scatter along a line is that of heights unless chance explains it with more than 5 %, as usual.
_SIGNIFICANCE = 0.05


def mean_of_heights_px(
    survey: Survey | None, layover_factor: float | None, max_error_px: float
) -> FloatArray:
    """Return what heights displace all matches by on average, as they scatter chips, shape (2,).

    So far they may displace all to either side where a mask left more ground than heights; twice
    as far where the ground may be the lowest of what matched.
    """
    if survey is None or len(survey.centres) == 0:
        return np.zeros(2)
    shifts = survey.shifts_px
    misses = Misses(survey.centres.astype(float), shifts, SURVEY_RADIUS_PX, max_error_px)
    scatter = scatter_along_line(shifts, misses.mixture.probability)
    return (layover_factor or _EVEN_MEAN_OVER_SCATTER) * scatter


def scatter_along_line(residuals_px: FloatArray, weights: FloatArray) -> FloatArray:
    """Return what residuals scatter by along a line beyond what they do across it.

    n pairs of normal variates are as far from spherical as w, or further, with probability
    w^((n − 2) / 2). Source: [Mauchly1940].

    Parameters
    ----------
    residuals_px
        Shape (n, 2).
    weights
        Their probabilities to be inliers, shape (n,).

    Returns
    -------
    float64 array (2,)
        Along the line, as long as the standard deviation; 0 if chance may do so, too.
    """
    count = float(weights.sum())
    if count < 3:
        return np.zeros(2)
    (across, along), axes = np.linalg.eigh(np.cov(residuals_px.T, aweights=weights))
    sphericity = across * along / max(((across + along) / 2) ** 2, 1e-12)
    if max(sphericity, 1e-12) ** ((count - 2) / 2) > _SIGNIFICANCE:
        return np.zeros(2)
    return np.asarray(math.sqrt(along - across) * axes[:, 1])
