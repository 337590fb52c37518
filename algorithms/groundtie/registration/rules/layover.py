"""Rules on layover, which displaces elevated objects between two radar images."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from ...geometry.judging import TOLERANCE_PX
from ...rasters.grid import FloatArray
from ..evidence import LAYOVER
from ..layover import count_on_line, scatter_along_line_px
from .rule import ON_GROUND, Rule


class LayoverEvidence(Protocol):
    """What registrations and poses have for the rules on layover.

    Parameters
    ----------
    layover_factor
        See `evidence.RegistrationEvidence`.
    check_residuals_px, fit_residuals_px
        Of all points that took no part in the fit, and of those that made it, shape (n, 2).
    radius_px
        Radius of the search for the first.
    max_error_px
        Largest root mean square error that is accepted.
    """

    layover_factor: float | None
    check_residuals_px: FloatArray
    fit_residuals_px: FloatArray
    radius_px: int
    max_error_px: float


# Check points along a line, over those that agree: from here on it is open which are the ground.
# Measured on pairs that were registered right: up to 0.56; on others: from 0.78 (suite sar_sar).
_LAYOVER_SHARE = 2 / 3


def _layover_of_check_points(evidence: LayoverEvidence) -> str | None:
    if evidence.layover_factor is None:
        return None
    residuals = evidence.check_residuals_px
    agreeing = int((np.hypot(*residuals.T) <= TOLERANCE_PX).sum())
    on_line = count_on_line(residuals, evidence.radius_px)
    if on_line < max(_LAYOVER_SHARE * agreeing, 1):
        return None
    return (
        f"{on_line} of {len(residuals)} check points lie along a line beside the {agreeing} that "
        "agree, as layover displaces elevated objects"
    )


def _layover_of_fit_points(evidence: LayoverEvidence) -> str | None:
    if evidence.layover_factor is None:
        return None
    scatter = scatter_along_line_px(evidence.fit_residuals_px)
    if evidence.layover_factor * scatter <= evidence.max_error_px:
        return None
    return (
        f"matched points scatter by {scatter:.1f} px along a line more than across it, as layover "
        "scatters heights"
    )


LAYOVER_RULES: tuple[Rule, ...] = (
    Rule(
        "layover of check points",
        LAYOVER,
        "between two radar images, check points that disagree lie along one line, "
        f"{_LAYOVER_SHARE:.2f} times as many as agree",
        "suite sar_sar",
        ON_GROUND,
        _layover_of_check_points,
    ),
    Rule(
        "layover of fit points",
        LAYOVER,
        "between two radar images, points of the fit scatter so far along one line that heights "
        "displace the model by more than the largest error",
        "[Mauchly1940]; suite sar_sar",
        ON_GROUND,
        _layover_of_fit_points,
    ),
)
