"""Layover tests: whether two radar images were registered by elevated objects, not by the ground.

Layover displaces elevated objects towards the radar, by other amounts from other incidence angles
and orbits, but anywhere in a pair along the same line on the map. So heights show in residuals:
matches are exact across this line and scattered along it, where errors of matching go in all
directions.
"""

from __future__ import annotations

import math

import numpy as np

from ..geometry.chance import log10_false_alarms
from ..geometry.judging import LOG10_SIGNIFICANCE, TOLERANCE_PX
from ..rasters.grid import FloatArray

# Points lie on a line if they are no further from it, in matching pixels.
_LINE_PX = 1.0

# A model through elevated objects is off by the mean of their heights, which is as many times what
# they scatter by. Measured by the suite sar_sar: 2 to 6 with keypoints; 7 to 9 with chips, which
# see several heights at once. A plain of roofs scatters little.
KEYPOINTS_MEAN_OVER_SCATTER = 3.0
CHIPS_MEAN_OVER_SCATTER = 6.0

# The same of heights that spread evenly from the ground up: mean over standard deviation.
EVEN_MEAN_OVER_SCATTER = math.sqrt(3)


def count_on_line(residuals_px: FloatArray, radius_px: int) -> int:
    """Return how many residuals beyond the tolerance lie on one line through zero.

    Parameters
    ----------
    residuals_px
        Shape (n, 2).
    radius_px
        Radius of the search window.

    Returns
    -------
    int
        0 if random residuals may do so, too.
    """
    far = residuals_px[np.hypot(*residuals_px.T) > TOLERANCE_PX]
    if len(far) == 0:
        return 0
    direction = far / np.hypot(*far.T)[:, None]
    across = far[:, 0] * direction[:, None, 1] - far[:, 1] * direction[:, None, 0]
    most = int((np.abs(across) <= _LINE_PX).sum(axis=1).max())
    # The longest such strip runs from corner to corner of the search window.
    probability = min(math.sqrt(2) * 2 * _LINE_PX / (2 * radius_px + 1), 1.0)
    alarms = log10_false_alarms(most, len(far), probability, 1)
    return most if alarms <= LOG10_SIGNIFICANCE else 0


def scatter_along_line_px(residuals_px: FloatArray) -> float:
    """Return the length of `scatter_along_line`, in pixels."""
    return float(np.hypot(*scatter_along_line(residuals_px)))


def scatter_along_line(
    residuals_px: FloatArray,
    weights: FloatArray | None = None,
    log10_significance: float = LOG10_SIGNIFICANCE,
) -> FloatArray:
    """Return what residuals scatter by along a line beyond what they do across it.

    n pairs of normal variates are as far from spherical as w, or further, with probability
    w^((n − 2) / 2). Source: [Mauchly1940].

    Parameters
    ----------
    residuals_px
        Shape (n, 2).
    weights
        Their probabilities to be inliers, shape (n,); None: they are.
    log10_significance
        log10 of the largest probability that residuals without a direction would scatter so.

    Returns
    -------
    float64 array (2,)
        Along the line, as long as the standard deviation; 0 if chance may do so, too.
    """
    each = np.ones(len(residuals_px)) if weights is None else weights
    count = float(each.sum())
    if count < 3:
        return np.zeros(2)
    (across, along), axes = np.linalg.eigh(np.cov(residuals_px.T, aweights=each))
    sphericity = across * along / max(((across + along) / 2) ** 2, 1e-12)
    if (count - 2) / 2 * math.log10(max(sphericity, 1e-12)) > log10_significance:
        return np.zeros(2)
    return np.asarray(math.sqrt(along - across) * axes[:, 1])
