"""Thresholds by which tie points and transforms are judged throughout the package.

A threshold of one rule alone stands beside that rule (`registration.rules`).

Agreement counts as evidence if it is sufficiently unlikely by chance. Source: [Moisan2004]; the
numbers were chosen on the shared pairs, as described in docs/method-verdict.md.
"""

from __future__ import annotations

import math

# Distance within which a point or chip agrees with a model, with another point or chip, or with its
# match back, in matching pixels.
TOLERANCE_PX = 2.0

# A second peak at least this share as high as the first may be the correct one. Measured: up to
# 0.76 on correctly registered pairs, 0.43 to 0.98 on very noisy images that were registered wrongly
# (suites real and attacks).
RIVAL_HEIGHT = 0.8

# Smallest number, and smallest share, of held-out points that must agree for a measurement. In
# dense cities, roofs in layover agree with each other in places, more often than by chance.
FEWEST_CHECK_POINTS = 3
SMALLEST_INLIER_SHARE = 0.25

# An overlay in both images makes some chips agree on a pose without rotation and scale; for such a
# pose, more than half of the chips must agree. Measured (suite attacks): up to 0.52 for wrong poses
# of this kind, from 0.64 on for correct ones. Poses with rotation or scale are correct from 0.33 on
# (suite rotated_pairs).
SMALLEST_SHARE_UNROTATED = 0.55

# The probability of agreement by chance must be below this (log10). Three of nine agree by chance
# with 10^-3.2: of eleven attacks that were accepted on no more than that, four were wrong, because
# of parts that had moved and of repetition (suite attacks).
LARGEST_LOG10_CHANCE = -4.0

# A finding less probable by chance than this is evidence against a registration.
SIGNIFICANCE = 1e-3

# Largest root mean square error allowed by default.
USUAL_MAX_ERROR_PX = 3.0

# 90 % of a circular normal distribution lie within this many per-axis standard deviations.
CE90_FACTOR = math.sqrt(-2 * math.log(0.1))

# A hundredth of a pixel is the limit of measurement.
SMALLEST_PX = 0.01
_SIGMA_BEYOND = 1.5


def sigma_range_px(max_error_px: float) -> tuple[float, float]:
    """Return the range allowed for the standard deviation of held-out inliers, in pixels.

    The upper limit exceeds the deviation of the largest allowed error, so that larger errors are
    still measured. It is at least that of the usual limit: errors do not depend on the limit set.
    """
    largest = _SIGMA_BEYOND * max(max_error_px, USUAL_MAX_ERROR_PX) / math.sqrt(2)
    return SMALLEST_PX, largest


def ce90_of_rmse(rmse_px: float) -> float:
    """Return the radius that holds 90 % of circular normal errors, from their RMSE."""
    return rmse_px / math.sqrt(2) * CE90_FACTOR
