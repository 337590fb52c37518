"""Fitting a model directly to the similarity surfaces of all chips.

Picking a peak for each chip throws away what weak surfaces know, and what draws single chips, as
layover does, draws their peaks. Summed along a model, surfaces agree on the ground: the model
with the largest sum of similarities is sought.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from affine import Affine
from numpy.typing import NDArray
from scipy.ndimage import spline_filter1d
from scipy.optimize import minimize

from ..geometry.models import DEGREE, PARAMETERS, Frame, Model, PolynomialModel, monomials
from ..geometry.robust import block_folds, standard_errors
from .chips import Surfaces

FloatArray = NDArray[np.float64]
Positions = Callable[[FloatArray], FloatArray]

# Surfaces are blurred by these, one after the other, so that the fit is caught from afar.
_BLURS_PX = (1.5, 0.0)

# The fit has arrived when the sum of similarities rises by less than this per pixel.
_SLOPE_PER_PX = 0.01
_STEPS = 60

# From simple to flexible, those that "auto" chooses from; see `choose_alignment`.
CANDIDATES = ("translation", "similarity", "affine", "polynomial2", "polynomial3")
LINEAR_CANDIDATES = CANDIDATES[:3]

# Chips for each parameter below which a model is not considered.
_CHIPS_PER_PARAMETER = 2

# A more flexible model must raise the similarity by so many standard errors: rotation, scale and
# shear of a georeferenced image are common, bending is not, and extrapolates badly.
_STANDARD_ERRORS = {
    "similarity": 1.0,
    "affine": 1.0,
    "polynomial2": 2.0,
    "polynomial3": 2.0,
}


@dataclass(frozen=True)
class Alignment:
    """A model that was fitted to surfaces.

    Parameters
    ----------
    model
        From pixel positions of the matching grid to where the input claims them to be, in pixels
        of the same grid.
    fold_models
        The same fitted without one block of chips after the other, to tell how the model varies.
    left_out_score
        Mean similarity at chips that were left out of the fit, for the models compared.
    """

    model: Model
    fold_models: tuple[Model, ...]
    left_out_score: dict[str, float]


@dataclass(frozen=True)
class _Field:
    """Surfaces that can be looked up anywhere: B-spline coefficients of blurred surfaces.

    `px` are the chips' centres, (n, 2); `to_shift` takes claimed pixel positions to places on
    the resampled input, whose distance from the centre is the shift.
    """

    px: FloatArray
    coefficients: FloatArray
    to_shift: Affine

    def take(self, which: NDArray[np.bool_]) -> _Field:
        return _Field(self.px[which], self.coefficients[which], self.to_shift)

    def scores(self, claimed: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return similarity, (n,), at claimed positions, and its gradient to these, (n, 2)."""
        t = self.to_shift
        linear = np.array([[t.a, t.b], [t.d, t.e]])
        shift = claimed @ linear.T + [t.c, t.f] - self.px
        radius = self.coefficients.shape[1] // 2
        # Beyond the window a surface says nothing and pulls nowhere.
        place = np.clip(shift + radius, 1.0, 2 * radius - 1.001)
        inside = np.all(place == shift + radius, axis=1)
        whole = np.floor(place).astype(int)
        (wx, dx), (wy, dy) = (_cubic_weights(place[:, k] - whole[:, k]) for k in (0, 1))
        taps = np.arange(-1, 3)
        rows, cols = whole[:, 1, None] + taps, whole[:, 0, None] + taps
        patch = self.coefficients[
            np.arange(len(place))[:, None, None], rows[:, :, None], cols[:, None, :]
        ]
        value = np.einsum("nij,ni,nj->n", patch, wy, wx)
        along_x = np.einsum("nij,ni,nj->n", patch, wy, dx)
        along_y = np.einsum("nij,ni,nj->n", patch, dy, wx)
        slope = np.where(inside[:, None], np.column_stack([along_x, along_y]), 0.0)
        return np.where(inside, value, 0.0), slope @ linear


def align(
    kind: str, px: NDArray[np.int_], surfaces: Surfaces, prior: Affine, start: Positions
) -> Alignment:
    """Fit a polynomial model to surfaces.

    Parameters
    ----------
    kind
        One of `models.DEGREE`.
    px
        The chips' centres in the matching grid, shape (n, 2).
    surfaces
        Their similarity, unsupported by neighbours, by how much each counts, about 1 at its peak;
        shape (n, 2 r + 1, 2 r + 1).
    prior
        From grid pixels to claimed grid pixels: what the input was resampled by for matching.
    start
        What to start from: takes grid pixels, (n, 2), to claimed grid pixels.
    """
    return _align(kind, _fields(px, surfaces, prior), start)


def choose_alignment(
    px: NDArray[np.int_],
    surfaces: Surfaces,
    prior: Affine,
    start: Positions,
    candidates: Sequence[str] = CANDIDATES,
) -> Alignment:
    """Fit the simplest polynomial model that the surfaces justify.

    A more flexible model is taken only if it raises the similarity at chips that were left out
    of its fit by more standard errors than `_STANDARD_ERRORS` asks for. Parameters as `align`, and
    the candidates, from simple to flexible.
    """
    fields = _fields(px, surfaces, prior)
    chosen = _align(candidates[0], fields, start)
    kept = _left_out_scores(fields[-1], chosen)
    scores = chosen.left_out_score
    for kind in candidates[1:]:
        if len(px) < _CHIPS_PER_PARAMETER * PARAMETERS[kind]:
            break
        tried = _align(kind, fields, start)
        scores = scores | tried.left_out_score
        left_out = _left_out_scores(fields[-1], tried)
        if standard_errors(left_out - kept, fields[-1].px) > _STANDARD_ERRORS[kind]:
            chosen, kept = tried, left_out
    return Alignment(chosen.model, chosen.fold_models, scores)


def _align(kind: str, fields: list[_Field], start: Positions) -> Alignment:
    sharp = fields[-1]
    frame = Frame.around(sharp.px)
    parameters = _starting(kind, frame, sharp.px, start)
    for field in fields:
        parameters = _maximise(kind, frame, field, parameters)
    folds = block_folds(sharp.px)
    models = tuple(
        _model(kind, frame, _maximise(kind, frame, sharp.take(folds != fold), parameters))
        for fold in np.unique(folds)
    )
    found = Alignment(_model(kind, frame, parameters), models, {})
    mean = float(_left_out_scores(sharp, found).sum()) / len(sharp.px)
    return replace(found, left_out_score={kind: mean})


def _left_out_scores(field: _Field, alignment: Alignment) -> FloatArray:
    """Return the similarity of each chip by a model that has not seen it, shape (n,)."""
    folds = block_folds(field.px)
    scores = np.zeros(len(folds))
    for fold, model in zip(np.unique(folds), alignment.fold_models, strict=True):
        part = field.take(folds == fold)
        scores[folds == fold] = part.scores(model(part.px))[0]
    return scores


def _fields(px: NDArray[np.int_], surfaces: Surfaces, prior: Affine) -> list[_Field]:
    """Return the surfaces to look up, from the most to the least blurred."""
    fields = []
    for blur in _BLURS_PX:
        blurred = (cv2.GaussianBlur(s, (0, 0), blur) if blur else s for s in surfaces)
        coefficients = np.stack(list(blurred)).astype(np.float64)
        for axis in (1, 2):
            coefficients = spline_filter1d(coefficients, order=3, axis=axis)
        fields.append(_Field(px.astype(float), coefficients, ~prior))
    return fields


def _cubic_weights(t: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the cubic B-spline's four weights and their derivatives at offsets `t`, (n, 4)."""
    weights = [(1 - t) ** 3, 3 * t**3 - 6 * t**2 + 4, -3 * t**3 + 3 * t**2 + 3 * t + 1, t**3]
    slopes = [-3 * (1 - t) ** 2, 9 * t**2 - 12 * t, -9 * t**2 + 6 * t + 3, 3 * t**2]
    return np.column_stack(weights) / 6, np.column_stack(slopes) / 6


def _maximise(kind: str, frame: Frame, field: _Field, start: FloatArray) -> FloatArray:
    design = monomials(frame.enter(field.px), DEGREE[kind])
    scale = frame.to_map.a

    def cost(parameters: FloatArray) -> tuple[float, FloatArray]:
        # Parameters count in pixels here, so that steps and gradients are of one size.
        coefficients, jacobian = _coefficients(kind, parameters / scale)
        claimed = field.px + scale * (design @ coefficients)
        value, slope = field.scores(claimed)
        return -float(value.sum()), -((design.T @ slope).ravel() @ jacobian)

    options = {"gtol": _SLOPE_PER_PX, "maxiter": _STEPS}
    found = minimize(cost, start * scale, jac=True, method="BFGS", options=options)
    return np.asarray(found.x) / scale


def _coefficients(kind: str, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a model's coefficients, (terms, 2), and their derivatives, (2 terms, parameters)."""
    if kind == "rigid":
        x, y, angle = parameters
        cosine, sine = np.cos(angle), np.sin(angle)
        jacobian = np.zeros((6, 3))
        jacobian[0, 0] = jacobian[1, 1] = 1
        jacobian[2:, 2] = [-sine, cosine, -cosine, -sine]
        return np.array([[x, y], [cosine - 1, sine], [-sine, cosine - 1]]), jacobian
    if kind == "similarity":
        x, y, growth, turn = parameters
        jacobian = np.zeros((6, 4))
        jacobian[0, 0] = jacobian[1, 1] = 1
        jacobian[2:, 2] = [1, 0, 0, 1]
        jacobian[2:, 3] = [0, 1, -1, 0]
        return np.array([[x, y], [growth, turn], [-turn, growth]]), jacobian
    return parameters.reshape(-1, 2), np.eye(len(parameters))


def _starting(kind: str, frame: Frame, px: FloatArray, start: Positions) -> FloatArray:
    """Return the parameters of the model of a kind that is nearest to another model."""
    target = (start(px) - px) / frame.to_map.a
    design = monomials(frame.enter(px), DEGREE[kind])
    coefficients = np.linalg.lstsq(design, target, rcond=None)[0]
    if kind not in ("rigid", "similarity"):
        return np.asarray(coefficients.ravel())
    growth = (coefficients[1, 0] + coefficients[2, 1]) / 2
    turn = (coefficients[1, 1] - coefficients[2, 0]) / 2
    shift = list(coefficients[0])
    if kind == "rigid":
        return np.array([*shift, np.arctan2(turn, 1 + growth)])
    return np.array([*shift, growth, turn])


def _model(kind: str, frame: Frame, parameters: FloatArray) -> Model:
    return PolynomialModel(kind, frame, _coefficients(kind, parameters)[0])
