"""Powell's and Nelder and Mead's ways to climb, which need no gradient (scipy).

Sources: [Powell1964], [Nelder1965].
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import scipy.optimize

from .climbing import PEAK_PX, PRECISION_PX, ClimbingSearch, Place, PoseSpace, Similarity

POWELL, NELDER_MEAD = "Powell", "Nelder-Mead"

# How exact similarities are wanted: NMI changes by some thousandths.
_SIMILARITY = 1e-6

# A climb ends after so many evaluations.
_LONGEST = 400


def climb(
    similarity: Similarity, space: PoseSpace, start: Place, rng: np.random.Generator, method: str
) -> Place:
    """Return the best place found from a start by a method of scipy; nothing is drawn."""
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
    """Return the start and a place a peak's width away in each dimension, towards the far limit."""
    towards = np.where(space.bounds.mean(axis=1) < start, -PEAK_PX, PEAK_PX)
    return [start, *(space.settle(start + side) for side in np.diag(towards))]


# Along one direction after the other; and by a simplex that moves, grows and shrinks.
powell = ClimbingSearch(partial(climb, method=POWELL))
nelder_mead = ClimbingSearch(partial(climb, method=NELDER_MEAD))
