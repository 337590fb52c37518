"""Gradient-free climbing by the methods of Powell and of Nelder and Mead (scipy).

Sources: [Powell1964], [Nelder1965].
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import scipy.optimize

from .climbing import PEAK_PX, PRECISION_PX, ClimbingSearch, Place, PoseSpace, Similarity

POWELL, NELDER_MEAD = "Powell", "Nelder-Mead"

# Required precision of the similarity: NMI changes by some thousandths.
_SIMILARITY = 1e-6

# Largest number of evaluations in a climb.
_LONGEST = 400


def climb(
    similarity: Similarity, space: PoseSpace, start: Place, rng: np.random.Generator, method: str
) -> Place:
    """Return the best place found from a start by a method of scipy, which uses no randomness."""
    options: dict[str, Any] = {"maxfev": _LONGEST}
    if method == POWELL:
        options |= {"xtol": PRECISION_PX, "ftol": _SIMILARITY}
    else:
        options |= {
            "xatol": PRECISION_PX,
            "fatol": np.inf,
            "initial_simplex": _simplex(space, start),
        }
    found = scipy.optimize.minimize(
        lambda values: -similarity(space.settle(values)),
        start,
        method=method,
        bounds=space.bounds,
        options=options,
    )
    return max(space.settle(found.x), start, key=similarity)


def _simplex(space: PoseSpace, start: Place) -> list[Place]:
    """Return the start, and one place per dimension a peak's width towards the farther limit."""
    towards = np.where(space.bounds.mean(axis=1) < start, -PEAK_PX, PEAK_PX)
    return [start, *(space.settle(start + side) for side in np.diag(towards))]


# Powell climbs along one direction after the other, Nelder–Mead by a simplex that adapts.
powell = ClimbingSearch(partial(climb, method=POWELL))
nelder_mead = ClimbingSearch(partial(climb, method=NELDER_MEAD))
