"""Fitting a model directly to the similarity surfaces of all chips.

Picking a peak for each chip discards the information of weak surfaces, and keeps the displacement
of single chips, by layover for example. Summed along a model, surfaces agree on the ground, so the
fit seeks the model with the largest sum of similarities.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from affine import Affine
from numpy.typing import NDArray

from ..errors import TooFewPointsError
from ..geometry.estimation import Fitted
from ..geometry.model_choice import (
    CHIPS_PER_PARAMETER,
    choose_simplest,
    left_out_blocks,
    left_out_scores,
)
from ..geometry.models import PARAMETERS, TERRAIN, Model
from ..geometry.rows import Rows
from ..geometry.terrain import Terrain
from ..rasters.grid import FloatArray, PointFunction, apply_affine, linear_part
from .belief_propagation import Surfaces
from .families import Family, coefficients_of

# Standard deviations of the blur in successive fits: blurred surfaces attract a fit from afar.
_BLURS_PX = (1.5, 0.0)

# The fit has converged when the sum of similarities rises by less than this per pixel.
_SLOPE_PER_PX = 0.01
_STEPS = 60

# Heights depend on where the model places a chip, and are updated this many times.
_HEIGHT_PASSES = 3

# Candidates of "auto", from simple to flexible; see `align`.
MODEL_CANDIDATES = ("translation", "similarity", "affine", "polynomial2", "polynomial3")
LINEAR_CANDIDATES = MODEL_CANDIDATES[:3]
TERRAIN_CANDIDATES = (*LINEAR_CANDIDATES, TERRAIN, *MODEL_CANDIDATES[3:])


# The four weights of a cubic B-spline, and their derivatives, are polynomials of the fractional
# pixel position. These are their coefficients, constant term first, shape (2, 4, 4).
_WEIGHTS = np.array([[1, 4, 1, 0], [-3, 0, 3, 0], [3, -6, 3, 0], [-1, 3, -3, 1]]) / 6
_SPLINE = np.stack([_WEIGHTS, np.diag([1.0, 2.0, 3.0], k=1) @ _WEIGHTS])
_POWERS, _TAPS = np.arange(4), np.arange(-1, 3)


@dataclass(frozen=True)
class Prior:
    """The model by which the input was resampled for matching.

    Parameters
    ----------
    to_nominal
        Takes grid pixels to nominal grid pixels, shapes (n, 2).
    linear
        The linear part common to all places, nominal pixels per pixel, shape (2, 2).
    """

    to_nominal: PointFunction
    linear: FloatArray

    @cached_property
    def to_shift(self) -> FloatArray:
        """The matrix that takes offsets in nominal pixels to offsets in pixels, shape (2, 2)."""
        return np.asarray(np.linalg.inv(self.linear), np.float64)

    @classmethod
    def of_affine(cls, affine: Affine) -> Prior:
        """Return the prior of an affine transform."""
        return cls(lambda px: apply_affine(affine, px), linear_part(affine))


# The prior of an input at its nominal place.
IDENTITY = Prior.of_affine(Affine.identity())


@dataclass(frozen=True)
class _Field(Rows):
    """Surfaces that can be interpolated anywhere: B-spline coefficients of blurred surfaces.

    `px` are the chips' centres, (n, 2); `predicted` are their nominal positions by `prior`.
    """

    px: FloatArray
    predicted: FloatArray
    coefficients: FloatArray
    prior: Prior

    def scores(self, nominal: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return similarity, (n,), at nominal positions, and its gradient there, (n, 2)."""
        linear, side = self.prior.to_shift, self.coefficients.shape[1]
        shift = (nominal - self.predicted) @ linear.T
        # Beyond the window a surface is zero, and so is its gradient.
        place = np.clip(shift + side // 2, 1.0, side - 2.001)
        inside = np.all(place == shift + side // 2, axis=1)
        whole = place.astype(int)
        powers = (place - whole)[..., None] ** _POWERS
        across, down = (powers @ _SPLINE[:, None]).transpose(2, 1, 0, 3)
        chips = np.arange(len(place))[:, None, None]
        rows, cols = (whole[:, axis, None] + _TAPS for axis in (1, 0))
        patch = self.coefficients[chips, rows[..., None], cols[:, None]]
        # Value and derivative along rows and along columns, shape (n, 2, 2).
        found = np.where(inside[:, None, None], down @ patch @ across.swapaxes(1, 2), 0.0)
        return found[:, 0, 0], np.stack([found[:, 0, 1], found[:, 1, 0]], axis=1) @ linear


def align(
    kinds: Sequence[str],
    px: NDArray[np.int_] | FloatArray,
    surfaces: Surfaces,
    prior: Prior,
    start: PointFunction,
    terrain: Terrain | None = None,
) -> Fitted:
    """Fit the simplest model that the surfaces justify (see `choose_simplest`).

    Its score is the similarity at chips that were left out of its fit.

    Parameters
    ----------
    kinds
        Kinds of model to choose from, of `models.DEGREE` or `models.TERRAIN`, from simple to
        flexible.
    px
        The chips' centres in the matching grid, shape (n, 2).
    surfaces
        The chips' own similarity times their weights, about 1 at the peak, without messages from
        neighbours; shape (n, 2 r + 1, 2 r + 1).
    prior
        The model by which the input was resampled for matching.
    start
        The initial model: takes grid pixels, (n, 2), to nominal grid pixels.
    terrain
        Heights at the grid's pixels, for the model that needs them.
    """
    fields = _fields(px, surfaces, prior)

    def fit(kind: str) -> tuple[Fitted, FloatArray]:
        if kind != kinds[0] and len(px) < CHIPS_PER_PARAMETER * PARAMETERS[kind]:
            raise TooFewPointsError(f"{len(px)} chips are too few for the {kind} model")
        return _align(kind, fields, start, terrain)

    return choose_simplest(kinds, fit, fields[-1].px)[0]


def _align(
    kind: str, fields: list[_Field], start: PointFunction, terrain: Terrain | None
) -> tuple[Fitted, FloatArray]:
    """Return the model and the scores of left-out chips."""
    sharp = fields[-1]
    family = Family.of(kind, sharp.px, start, terrain)
    parameters = family.starting(start)
    for each in fields:
        parameters = _maximise(family, each, parameters)
    for _ in range(_HEIGHT_PASSES if family.terrain else 0):
        family = family.raised(parameters)
        parameters = _maximise(family, sharp, parameters)
    models = tuple(
        family.model(_maximise(family.take(~block), sharp.take(~block), parameters))
        for block in left_out_blocks(sharp.px)
    )

    def score(model: Model, block: NDArray[np.bool_]) -> FloatArray:
        part = sharp.take(block)
        return part.scores(model(part.px))[0]

    scores = left_out_scores(sharp.px, models, score)
    return Fitted(family.model(parameters), models), scores


def _fields(px: NDArray[np.int_] | FloatArray, surfaces: Surfaces, prior: Prior) -> list[_Field]:
    """Return the interpolated surfaces, from the most to the least blurred."""
    fields, centres = [], px.astype(float)
    predicted = prior.to_nominal(centres)
    for blur in _BLURS_PX:
        blurred = (cv2.GaussianBlur(s, (0, 0), blur) if blur else s for s in surfaces)
        coefficients = _spline_coefficients(np.stack(list(blurred)).astype(np.float64))
        fields.append(_Field(centres, predicted, coefficients, prior))
    return fields


def _spline_coefficients(values: FloatArray) -> FloatArray:
    """Return the coefficients of cubic B-splines through values, (n, s, s), mirrored at borders."""
    side, middle = _WEIGHTS[0, :2]
    size = values.shape[1]
    splines = middle * np.eye(size) + side * (np.eye(size, k=1) + np.eye(size, k=-1))
    splines[0, 1] = splines[-1, -2] = 2 * side
    inverse = np.linalg.inv(splines)
    return np.asarray(inverse @ values @ inverse.T)


def _maximise(family: Family, field: _Field, start: FloatArray) -> FloatArray:
    from scipy.optimize import minimize  # takes 0.2 s to import; all tools import this module

    design, scale = family.design, family.frame.to_map.a

    def cost(parameters: FloatArray) -> tuple[float, FloatArray]:
        # Parameters are scaled to pixels here, so that steps and gradients are of similar size.
        coefficients, jacobian = coefficients_of(family.kind, parameters / scale)
        nominal = field.px + scale * (design @ coefficients)
        value, slope = field.scores(nominal)
        return -float(value.sum()), -((design.T @ slope).ravel() @ jacobian)

    options = {"gtol": _SLOPE_PER_PX, "maxiter": _STEPS}
    found = minimize(cost, start * scale, jac=True, method="BFGS", options=options)
    return np.asarray(found.x) / scale
