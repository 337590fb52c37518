"""The verdict: accepted or refused with a reason, on points that took no part in the fit."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from ..geometry.chance import agreement_probability, log10_chance
from ..geometry.estimation import Estimate
from ..geometry.robust import distances, find_consensus, fit_mixture
from ..geometry.tie_points import TiePoints
from ..rasters.grid import FloatArray, Grid

# A check point agrees with the model within this distance, in matching pixels.
TOLERANCE_PX = 2.0

# Chance agreement must be less likely than this (log10).
LARGEST_LOG10_CHANCE = -3.0

# Standard deviation that right check points may turn out to have: at least so many pixels, and
# at most so many times what the largest error allows, so that errors above it are still seen.
_SMALLEST_SIGMA_PX = 0.1
_SIGMA_BEYOND = 1.5

# Fewer check points that agree measure nothing: at least so many, and this share of all. In dense
# cities roofs that lay over agree with each other at some places, more often than by chance.
_FEWEST_CHECK_POINTS = 3

# What is left of a dense town's roofs agrees, too, and three points always agree on an affine
# model: where its ground was matched, three of nine are not enough.
LOG10_CHANCE_ON_GROUND = -4.0
_SMALLEST_SHARE = 0.25

# From this share on, more agree than roofs alone do. Measured where a dense town was matched whole
# and a wrong registration accepted: 28 to 56 %; on other scenes as bright: from 72 %.
_CLEAR_SHARE = 2 / 3

# Check points that agree on another transform within this distance make it a rival, if they are
# more by so many and by this factor.
_RIVAL_TOLERANCE_PX = 3.0
_RIVAL_POINTS = 3
_RIVAL_SHARE = 1.25

# 90 % of a circular normal distribution lies within this many standard deviations of an axis.
_CE90 = math.sqrt(-2 * math.log(0.1))

_LATTICE = 9


@dataclass(frozen=True)
class Verdict:
    """Whether a registration can be trusted.

    Parameters
    ----------
    accepted
        Whether it can.
    reason
        Why, or why not, in a sentence.
    fit_points, fit_points_used
        How many points the fit had, and how many of them it used.
    check_points, check_points_agreeing
        How many points were held out, and how many of them agree with the model.
    check_rmse_px, check_rmse_m
        Root mean square error at right check points, in matching pixels and metres.
    check_ce90_px, check_ce90_m
        Radius within which 90 % of these errors lie.
    log10_chance
        log10 of the probability that random matches would agree as well.
    spread_px
        Standard deviation of the model's predictions over the overlap (root mean square).
    extrapolated_share
        Share of the overlap outside of the hull of the points that were used.
    """

    accepted: bool
    reason: str
    fit_points: int = 0
    fit_points_used: int = 0
    check_points: int = 0
    check_points_agreeing: int = 0
    check_rmse_px: float = math.nan
    check_rmse_m: float = math.nan
    check_ce90_px: float = math.nan
    check_ce90_m: float = math.nan
    log10_chance: float = 0.0
    spread_px: float = math.nan
    extrapolated_share: float = math.nan

    @property
    def points(self) -> int:
        """How many points the registration rests on: used in the fit, or agreeing with it."""
        return self.fit_points_used + self.check_points_agreeing

    @property
    def is_clear(self) -> bool:
        """Whether more check points agree than roofs of a dense town do among themselves."""
        return self.check_points_agreeing >= _CLEAR_SHARE * self.check_points

    @property
    def chance(self) -> float:
        """Probability that random matches would agree as well (0 where it is too small)."""
        return float(10.0**self.log10_chance)

    def summary(self) -> dict[str, Any]:
        """Return the verdict as values that JSON can carry; what is not finite is None."""
        values = asdict(self) | {"points": self.points, "chance": self.chance}
        unknown = {k for k, v in values.items() if isinstance(v, float) and not math.isfinite(v)}
        return {k: None if k in unknown else v for k, v in values.items()}


def refuse(reason: str, fit_points: int = 0) -> Verdict:
    """Return the verdict on a registration that did not come as far as check points."""
    return Verdict(False, reason, fit_points)


def judge(
    estimate: Estimate,
    check: TiePoints,
    grid: Grid,
    max_error_px: float,
    radius_px: int,
    largest_log10_chance: float = LARGEST_LOG10_CHANCE,
) -> Verdict:
    """Judge an estimate by check points.

    Parameters
    ----------
    estimate
        The transform and the points of the fit.
    check
        Check points, searched for around what the transform predicts.
    grid
        The matching grid, cut to the overlap.
    max_error_px
        Largest root mean square error at check points, in matching pixels.
    radius_px
        Radius of the search for check points.
    largest_log10_chance
        Logarithm of the chance, that random matches agree as well, which refuses.
    """
    counted = check.take(check.used)
    residuals = counted.residual_on(grid, estimate.transform)
    agreeing = int((np.hypot(*residuals.T) <= TOLERANCE_PX).sum())
    # Matches without a peak inside their window count as such that do not agree.
    chance = log10_chance(agreeing, len(check), agreement_probability(TOLERANCE_PX, radius_px))
    counts = len(estimate.points), int(estimate.points.used.sum()), len(check), agreeing
    if chance > largest_log10_chance or agreeing < _FEWEST_CHECK_POINTS:
        why = f"{agreeing} of {len(check)} check points agree, as they may by chance"
        return Verdict(False, why, *counts, log10_chance=chance)
    if agreeing < _SMALLEST_SHARE * len(check):
        why = f"only {agreeing} of {len(check)} check points agree"
        return Verdict(False, why, *counts, log10_chance=chance)
    on_another = _agreeing_on_another(grid.map_to_pixel(counted.reference_xy), residuals)
    if on_another:
        why = f"{on_another} of {len(check)} check points agree on another transform"
        return Verdict(False, why, *counts, log10_chance=chance)
    sigmas = _SMALLEST_SIGMA_PX, _SIGMA_BEYOND * max_error_px / math.sqrt(2)
    sigma = fit_mixture(residuals, (2 * radius_px + 1) ** 2, sigmas).sigma
    lattice = _lattice(grid)
    spread = float(np.sqrt(np.mean(estimate.spread_px(lattice) ** 2)))
    rmse, ce90 = sigma * math.sqrt(2), sigma * _CE90
    reason = "check points confirm the registration"
    accepted = True
    if rmse > max_error_px:
        accepted = False
        reason = f"error at check points is {rmse:.2f} px, above {max_error_px:g} px"
    elif spread > max_error_px:
        accepted = False
        reason = f"the points do not hold the model: it varies by {spread:.2f} px over the overlap"
    used = estimate.points.take(estimate.points.used)
    return Verdict(
        accepted,
        reason,
        *counts,
        rmse,
        rmse * grid.pixel_size_m,
        ce90,
        ce90 * grid.pixel_size_m,
        chance,
        spread,
        _extrapolated_share(grid.map_to_pixel(used.reference_xy), grid),
    )


def _agreeing_on_another(px: FloatArray, residuals: FloatArray) -> int:
    """Return how many check points agree on another transform, if clearly more than on this one.

    A model that is right in one part of the scene and wrong in another has check points that
    agree, and others that agree on what it should be.
    """
    own = int((np.hypot(*residuals.T) <= _RIVAL_TOLERANCE_PX).sum())
    rival = find_consensus(px, px + residuals, _RIVAL_TOLERANCE_PX)
    others = int((distances(rival, px, px + residuals) <= _RIVAL_TOLERANCE_PX).sum())
    # Three points always agree on an affine model, and one or two more may by chance.
    return others if others >= max(own + _RIVAL_POINTS, _RIVAL_SHARE * own) else 0


def _lattice(grid: Grid) -> FloatArray:
    cols, rows = np.meshgrid(
        np.linspace(0, grid.width - 1, _LATTICE), np.linspace(0, grid.height - 1, _LATTICE)
    )
    return np.column_stack([cols.ravel(), rows.ravel()])


def _extrapolated_share(px: FloatArray, grid: Grid) -> float:
    try:
        hull = ConvexHull(px)
    except (QhullError, ValueError):
        return 1.0
    return float(np.clip(1 - hull.volume / (grid.width * grid.height), 0, 1))
