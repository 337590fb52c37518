"""The verdict: accepted or refused with a reason, on points that took no part in the fit."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from ..geometry.chance import agreement_probability, log10_chance
from ..geometry.estimation import Estimate
from ..geometry.judging import (
    CE90_FACTOR,
    FEWEST_CHECK_POINTS,
    LARGEST_LOG10_CHANCE,
    SMALLEST_INLIER_SHARE,
    TOLERANCE_PX,
    sigma_range_px,
)
from ..geometry.robust import distances, find_consensus, fit_mixture
from ..geometry.tie_points import TiePoints
from ..rasters.grid import FloatArray, Grid

# From this share on, more agree than roofs alone do. Measured where a dense town was matched whole
# and a wrong registration accepted: 28 to 56 %; on other scenes as bright: from 72 %.
_CLEAR_SHARE = 2 / 3

# Check points that agree on another transform within this distance make it a rival, if they are
# more by so many and by this factor.
_RIVAL_TOLERANCE_PX = 3.0
_RIVAL_POINTS = 3
_RIVAL_SHARE = 1.25

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
    rule
        Name of the rule that decided; empty where none is named.
    advice
        What to try next, in a sentence; empty where there is nothing to try.
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
    rule: str = ""
    advice: str = ""

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
    if chance > largest_log10_chance or agreeing < FEWEST_CHECK_POINTS:
        why = f"{agreeing} of {len(check)} check points agree, as they may by chance"
        return Verdict(False, why, *counts, log10_chance=chance)
    if agreeing < SMALLEST_INLIER_SHARE * len(check):
        why = f"only {agreeing} of {len(check)} check points agree"
        return Verdict(False, why, *counts, log10_chance=chance)
    on_another = _agreeing_on_another(grid.map_to_pixel(counted.reference_xy), residuals)
    if on_another:
        why = f"{on_another} of {len(check)} check points agree on another transform"
        return Verdict(False, why, *counts, log10_chance=chance)
    area = (2 * radius_px + 1) ** 2
    sigma = fit_mixture(residuals, area, sigma_range_px(max_error_px)).sigma
    lattice = _lattice(grid)
    spread = float(np.sqrt(np.mean(estimate.spread_px(lattice) ** 2)))
    rmse, ce90 = sigma * math.sqrt(2), sigma * CE90_FACTOR
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
