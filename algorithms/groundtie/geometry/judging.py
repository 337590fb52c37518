"""The numbers by which tie points and transforms are judged, wherever that is done.

Those of one rule alone stand beside it (`registration.rules`).

Agreement is believed where it would be too unlikely by chance. Source: [Moisan2004]; the numbers
were chosen on the shared pairs, as docs/method-verdict.md has it.
"""

from __future__ import annotations

import math

# A point or chip agrees with a model, with another, or with its match back within this distance, in
# matching pixels.
TOLERANCE_PX = 2.0

# A second place that is as high as this share of the first may be the right one. Measured on pairs
# that were registered right: up to 0.76; on images with much noise that were registered wrong: 0.43
# to 0.98 (suites real and attacks).
RIVAL_HEIGHT = 0.8

# Fewer held-out points that agree measure nothing: at least so many, and this share of all. In
# dense cities roofs in layover agree with each other at some places, more often than by chance.
FEWEST_CHECK_POINTS = 3
SMALLEST_INLIER_SHARE = 0.25

# What is drawn into both arrays makes some chips agree on a pose that rotates and scales nothing:
# there, more than half of them must. Measured (suite attacks): wrong such poses up to 0.52, right
# ones from 0.64 on; poses that rotate or scale, right from 0.33 on (suite rotated_pairs).
SMALLEST_SHARE_UNROTATED = 0.55

# Chance agreement must be less likely than this (log10). Three of nine agree by chance with
# 10^-3.2: of eleven attacks that were accepted with no more, four were wrong, by parts that had
# moved and by repetition (suite attacks).
LARGEST_LOG10_CHANCE = -4.0

# What chance explains with less than this is evidence against a registration.
SIGNIFICANCE = 1e-3

# Largest root mean square error that is allowed where nobody asks for another.
USUAL_MAX_ERROR_PX = 3.0

# 90 % of a circular normal distribution lies within this many standard deviations of an axis.
CE90_FACTOR = math.sqrt(-2 * math.log(0.1))

# Below a hundredth of a pixel nothing is measured.
SMALLEST_PX = 0.01
_SIGMA_BEYOND = 1.5


def sigma_range_px(max_error_px: float) -> tuple[float, float]:
    """Return the standard deviations that held-out inliers may turn out to have, in pixels.

    The larger one is so many times what the largest error allows that errors above it are still
    seen; and no less than usual, as how large errors are does not depend on what is asked for.
    """
    largest = _SIGMA_BEYOND * max(max_error_px, USUAL_MAX_ERROR_PX) / math.sqrt(2)
    return SMALLEST_PX, largest


def ce90_of_rmse(rmse_px: float) -> float:
    """Return the radius that holds 90 % of circular normal errors of a root mean square."""
    return rmse_px / math.sqrt(2) * CE90_FACTOR
