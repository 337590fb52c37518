"""Simultaneous perturbation stochastic approximation (SPSA): climbing with two looks a step.

A look is one evaluation of the similarity. The steepness of the similarity is not known beforehand;
NMI changes by some thousandths. Slopes are therefore divided by their running root mean square, so
that gains are in pixels. Source: [Spall1992], [Spall1998], [Suri2010] eq 4.1–4.4; second order:
[Spall2000], for registration [ColeRhodes2003]; discrete: [Suri2010] 4.4.2.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..rasters.grid import FloatArray
from .climbing import PRECISION_PX, ClimbingSearch, Effort, Place, PoseSpace, Similarity

Measure = Callable[[FloatArray], float]

# Spall's exponents: the smallest values that still converge.
ALPHA, GAMMA = 0.602, 0.101

# A climb ends after this many evaluations without progress: without a gain of more than the rise
# of the usual slope over `PRECISION_PX` ([Suri2010], section 4.4.1).
PATIENCE = 40


@dataclass(frozen=True)
class Gains:
    """SPSA's step and look lengths: a_k = a ((1 + A) / (k + 1 + A))^α and c_k = c / (k + 1)^γ.

    Parameters
    ----------
    step_px
        a: the first step on a slope of the usual steepness.
    look_px
        c: offset of the first two looks from the place, in every dimension.
    steady
        A: approximate number of steps over which the step length hardly decreases.
    """

    step_px: float = 3.0
    look_px: float = 2.0
    steady: float = 5.0

    def step(self, k: int) -> float:
        """Return a_k."""
        return self.step_px * ((1 + self.steady) / (k + 1 + self.steady)) ** ALPHA

    def look(self, k: int) -> float:
        """Return c_k."""
        return self.look_px / (k + 1) ** GAMMA


CONTINUOUS = Gains(look_px=1.0)


class _Slopes:
    """Running estimates: the slopes' root mean square, and for second order the Hessian."""

    def __init__(self, dimensions: int) -> None:
        self.steps = 0
        self._squares = 0.0
        self._hessian = np.zeros((dimensions, dimensions))

    def add(self, slope: float) -> None:
        self.steps += 1
        self._squares += slope**2

    def add_hessian(self, hessian: FloatArray) -> None:
        self._hessian += (hessian - self._hessian) / self.steps

    @property
    def usual(self) -> float:
        return float(np.sqrt(self._squares / max(self.steps, 1)))

    def newton(self, gradient: FloatArray, step_px: float) -> FloatArray:
        """Return the second-order uphill step; without curvature, it is the first-order step.

        Eigenvalues of the Hessian count by magnitude, so that steps leave saddles uphill, too.
        """
        values, vectors = np.linalg.eigh(self._hessian)
        curvature = np.hypot(values, self.usual / step_px)
        return np.asarray(vectors @ ((vectors.T @ gradient) / curvature))


def climb_first_order(
    similarity: Similarity, space: PoseSpace, start: Place, rng: np.random.Generator, gains: Gains
) -> Place:
    """Return the best place found from a start by SPSA of first order.

    In a space of aligned grids (`PoseSpace.origin`) this is discrete SPSA: looks and steps are
    rounded stochastically to whole pixels ([Suri2010], section 4.4.2).
    """

    def uphill(look: Measure, at: FloatArray, slopes: _Slopes) -> FloatArray:
        k = slopes.steps
        c, signs = gains.look(k), rng.choice([-1.0, 1.0], at.size)
        slope = (look(at + c * signs) - look(at - c * signs)) / (2 * c)
        slopes.add(slope)
        return gains.step(k) * slope / (slopes.usual or 1.0) * signs

    return _climb(similarity, space, start, rng, uphill)


def climb_second_order(
    similarity: Similarity, space: PoseSpace, start: Place, rng: np.random.Generator, gains: Gains
) -> Place:
    """Return the best place found from a start by SPSA of second order: four looks a step."""

    def uphill(look: Measure, at: FloatArray, slopes: _Slopes) -> FloatArray:
        k = slopes.steps
        c, signs, others = gains.look(k), *rng.choice([-1.0, 1.0], (2, at.size))
        ahead, behind = at + c * signs, at - c * signs
        high, low = look(ahead), look(behind)
        slope = (high - low) / (2 * c)
        slopes.add(slope)
        bend = (look(ahead + c * others) - high - look(behind + c * others) + low) / (2 * c**2)
        product = bend * np.outer(signs, others)
        slopes.add_hessian((product + product.T) / 2)
        if slopes.usual == 0:
            return np.zeros(at.size)
        return gains.step(k) / gains.step_px * slopes.newton(slope * signs, gains.step_px)

    return _climb(similarity, space, start, rng, uphill)


def _climb(
    similarity: Similarity,
    space: PoseSpace,
    start: Place,
    rng: np.random.Generator,
    uphill: Callable[[Measure, FloatArray, _Slopes], FloatArray],
) -> Place:
    """Step uphill until `PATIENCE` evaluations in a row bring no noticeable improvement."""
    best, mark, waited = start, similarity(start), 0
    slopes = _Slopes(len(start))

    def settle(values: FloatArray) -> Place:
        if space.origin is None:
            return space.settle(values)
        # Round up or down at random: steps are equally long in all dimensions, so that plain
        # rounding would only reach the places of one colour of a chessboard.
        return space.settle(values + rng.uniform(-0.5, 0.5, values.size))

    def look(values: FloatArray) -> float:
        nonlocal best, mark, waited
        place = settle(values)
        value = similarity(place)
        best = max(best, place, key=similarity)
        waited += 1
        if value > mark + PRECISION_PX * slopes.usual:
            mark, waited = value, 0
        return value

    at = np.array(start)
    while waited < PATIENCE:
        at = np.array(settle(at + uphill(look, at, slopes)))
        look(at)
    return best


spsa = ClimbingSearch(partial(climb_first_order, gains=CONTINUOUS))
spsa_second_order = ClimbingSearch(partial(climb_second_order, gains=CONTINUOUS))
discrete_spsa = ClimbingSearch(
    partial(climb_first_order, gains=Gains()), Effort(agreeing=4), on_grid=True
)
