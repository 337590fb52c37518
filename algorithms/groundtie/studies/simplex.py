"""Powell's and Nelder and Mead's ways to climb, which need no gradient (scipy).

Sources: [Powell1964], [Nelder1965].
"""

from __future__ import annotations

from concurrent.futures import Executor
from functools import partial
from typing import Any

import numpy as np
import scipy.optimize

from ..pose.pose import PoseFound, PoseLimits
from ..rasters.patch import Patch
from ..similarity.surface import SimilaritySettings
from .objective import (
    EFFORT,
    Counted,
    Effort,
    Place,
    PoseSpace,
    bin_pair,
    search_by_climbing,
    spread_px,
)

POWELL, NELDER_MEAD = "Powell", "Nelder-Mead"

# How exact places and similarities are wanted: NMI changes by some thousandths.
_PLACE_PX = 0.05
_SIMILARITY = 1e-6

# Sides of the first simplex: about as wide as a peak of the similarity.
_SIMPLEX_PX = 4.0

# A climb ends after so many evaluations.
_LONGEST = 400

# Ends of climbs that are the same place, in pixels.
_SAME_PX = 1.0


def climb(
    similarity: Counted, space: PoseSpace, start: Place, rng: np.random.Generator, method: str
) -> Place:
    """Return the best place found from a start by a method of scipy; nothing is drawn."""
    options: dict[str, Any] = {"maxfev": _LONGEST}
    if method == POWELL:
        options |= {"xtol": _PLACE_PX, "ftol": _SIMILARITY}
    else:
        options |= {"xatol": _PLACE_PX, "fatol": np.inf, "initial_simplex": _simplex(space, start)}
    found = scipy.optimize.minimize(
        lambda values: -similarity(space.settle(values)),
        start,
        method=method,
        bounds=space.bounds,
        options=options,
    )
    return max(space.settle(found.x), start, key=similarity)


def _simplex(space: PoseSpace, start: Place) -> list[Place]:
    """Return the start and a place beside it in every dimension, towards the farther limit."""
    towards = np.where(space.bounds.mean(axis=1) < start, -_SIMPLEX_PX, _SIMPLEX_PX)
    return [start, *(space.settle(start + side) for side in np.diag(towards))]


def _search(
    method: str,
    reference: Patch,
    input: Patch,
    limits: PoseLimits,
    settings: SimilaritySettings,
    effort: Effort,
) -> list[PoseFound]:
    pair = bin_pair(reference, input, settings)
    if pair is None:
        return []
    space = PoseSpace(limits, spread_px(reference.values.shape))
    return search_by_climbing(pair, space, partial(climb, method=method), effort, _SAME_PX)


def powell(
    reference: Patch,
    input: Patch,
    limits: PoseLimits,
    settings: SimilaritySettings,
    executor: Executor | None = None,
    *,
    effort: Effort = EFFORT,
) -> list[PoseFound]:
    """Search for a pose by Powell's method: along one direction after the other.

    Parameters
    ----------
    reference, input, limits, settings
        As in `pose.PoseSearch`; the similarity must be one of joint histograms.
    executor
        Not used: every evaluation depends on those before.
    effort
        Where and how often to start.
    """
    return _search(POWELL, reference, input, limits, settings, effort)


def nelder_mead(
    reference: Patch,
    input: Patch,
    limits: PoseLimits,
    settings: SimilaritySettings,
    executor: Executor | None = None,
    *,
    effort: Effort = EFFORT,
) -> list[PoseFound]:
    """Search for a pose with Nelder and Mead's simplex; parameters as of `powell`."""
    return _search(NELDER_MEAD, reference, input, limits, settings, effort)
