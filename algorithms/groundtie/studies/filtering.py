"""Filtered matching: the worst match goes until the rest agree ([Suri2010] 3.4.4, 6.7.1)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..geometry.fitting import fit_model
from ..geometry.models import PARAMETERS
from ..rasters.grid import FloatArray

# Largest residual in standard deviations of all residuals.
_SIGMAS = 2.0

# Smaller residuals are rounding.
_ROUNDING_PX = 1e-6


def filter_matches(
    px: FloatArray, partner_px: FloatArray, kind: str = "affine"
) -> NDArray[np.bool_]:
    """Return which matches remain when the worst is dropped until none is far off.

    A model is fitted to all, the match with the largest residual is dropped, the model is fitted
    again, until all residuals are below so many of their standard deviations. It needs more right
    than wrong matches to start from.

    Parameters
    ----------
    px, partner_px
        Positions that belong together, shape (n, 2).
    kind
        One of `models.KINDS`.

    Returns
    -------
    Shape (n,); all False if there are too few matches for the model.
    """
    kept = np.ones(len(px), bool)
    fewest = PARAMETERS[kind] // 2 + 1
    while kept.sum() >= fewest:
        model = fit_model(kind, px, partner_px, kept.astype(float))
        residuals = np.hypot(*(partner_px - model(px)).T)
        spread = np.sqrt(np.mean(residuals[kept] ** 2))
        worst = int(np.argmax(np.where(kept, residuals, -1.0)))
        if residuals[worst] <= max(_SIGMAS * spread, _ROUNDING_PX):
            return kept
        kept[worst] = False
    return np.zeros(len(px), bool)
