"""Least-squares fits of the models of `models` to pairs of positions."""

from __future__ import annotations

import numpy as np

from ..errors import TooFewPointsError
from ..rasters.grid import FloatArray
from .models import (
    DEGREE,
    SHAPE_PRESERVING,
    Frame,
    Model,
    PolynomialModel,
    ThinPlateSpline,
    fewest_points,
    monomials,
    thin_plate_kernel,
)

# Stiffness of the thin-plate spline: residual variance of a point against bending energy, in frame
# units. A knot then bends its neighbourhood, a tenth of the scene, rather than a single pixel.
TPS_STIFFNESS = 1e-2

# Singular values below this share of the largest are due to rounding.
ROUNDING = 1e-9


def fit_model(
    kind: str,
    xy: FloatArray,
    nominal_xy: FloatArray,
    weights: FloatArray | None = None,
    frame: Frame | None = None,
) -> Model:
    """Fit a model to pairs of positions by weighted least squares.

    Parameters
    ----------
    kind
        One of `models.KINDS`.
    xy, nominal_xy
        Positions on the reference map, and their nominal positions, shape (n, 2).
    weights
        Weight of each pair, shape (n,); by default all equal. Zero leaves a pair out.
    frame
        Frame of the coefficients; by default the one around `xy`.

    Raises
    ------
    TooFewPointsError
        Fewer pairs have a weight than half the model's parameters, or a spline's points are
        collinear.
    """
    weights = np.ones(len(xy)) if weights is None else weights
    taken = weights > 0
    needed = fewest_points(kind)
    if taken.sum() < needed:
        raise TooFewPointsError(
            f"the {kind} model needs at least {needed} points; there are {taken.sum()}"
        )
    frame = frame or Frame.around(xy[taken])
    uv, nominal_uv, weights = frame.enter(xy[taken]), frame.enter(nominal_xy[taken]), weights[taken]
    if kind == "tps":
        return _fit_thin_plate(frame, uv, nominal_uv - uv, weights)
    if kind in SHAPE_PRESERVING:
        coefficients = _fit_similarity(uv, nominal_uv, weights, scaled=kind == "similarity")
    else:
        coefficients = _solve(monomials(uv, DEGREE[kind]), nominal_uv - uv, weights)
    return PolynomialModel(kind, frame, coefficients)


def require_determined(kind: str, xy: FloatArray) -> None:
    """Raise an error if places do not determine a model; least squares would still return one.

    Parameters
    ----------
    kind
        One of `models.KINDS`.
    xy
        Places of the pairs, shape (n, 2).

    Raises
    ------
    TooFewPointsError
        All lie at one place, on a line, or on a curve of the polynomial's degree.
    """
    degree = DEGREE.get(kind, 1)
    if len(xy) == 0 or degree == 0:
        return
    uv = Frame.around(xy).enter(xy)
    if not uv.any():
        raise TooFewPointsError(f"the {kind} model needs points that do not all lie at one place")
    if kind not in SHAPE_PRESERVING and _is_deficient(monomials(uv, degree)):
        where = "a line" if degree == 1 else f"a curve of degree {degree}"
        raise TooFewPointsError(f"the {kind} model needs points that do not all lie on {where}")


def _is_deficient(design: FloatArray) -> bool:
    """Return whether the columns of a matrix are linearly dependent."""
    sizes = np.linalg.svd(design, compute_uv=False)
    return bool(len(sizes) < design.shape[1] or sizes[-1] <= ROUNDING * sizes[0])


def _solve(design: FloatArray, target: FloatArray, weights: FloatArray) -> FloatArray:
    root = np.sqrt(weights)[:, None]
    return np.asarray(np.linalg.lstsq(design * root, target * root, rcond=None)[0])


def _fit_similarity(
    uv: FloatArray, nominal_uv: FloatArray, weights: FloatArray, *, scaled: bool
) -> FloatArray:
    """Coefficients of rotation, shift and, if `scaled`, scale, in closed form ([Umeyama1991])."""
    share = (weights / weights.sum())[:, None]
    centre, nominal_centre = (share * uv).sum(axis=0), (share * nominal_uv).sum(axis=0)
    z = (uv - centre) @ [1, 1j]
    nominal_z = (nominal_uv - nominal_centre) @ [1, 1j]
    turn = np.sum(weights * nominal_z * z.conj())
    with np.errstate(invalid="ignore"):  # coincident points have no direction: NaN
        turn = turn / np.sum(weights * np.abs(z) ** 2) if scaled else turn / np.abs(turn)
    linear = np.array([[turn.real, turn.imag], [-turn.imag, turn.real]])
    return np.vstack([nominal_centre - centre @ linear, linear - np.eye(2)])


def _fit_thin_plate(
    frame: Frame, uv: FloatArray, displacement: FloatArray, weights: FloatArray
) -> ThinPlateSpline:
    """Smoothing thin-plate spline ([Wahba1990]): residuals are traded against bending energy."""
    count = len(uv)
    affine_part = monomials(uv, 1)
    if _is_deficient(affine_part):
        raise TooFewPointsError("the tps model needs points that do not all lie on a line")
    stiffness = TPS_STIFFNESS * weights.mean() / weights
    system = np.zeros((count + 3, count + 3))
    system[:count, :count] = thin_plate_kernel(uv, uv) + np.diag(stiffness)
    system[:count, count:] = affine_part
    system[count:, :count] = affine_part.T
    target = np.vstack([displacement, np.zeros((3, 2))])
    solution: FloatArray = np.asarray(np.linalg.solve(system, target), np.float64)
    return ThinPlateSpline("tps", frame, uv, solution[:count], solution[count:])
