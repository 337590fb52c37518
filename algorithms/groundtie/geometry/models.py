"""Models of the misregistration: maps of the plane onto itself.

A model takes a position on the reference map to its nominal position, where the input's own
georeferencing places this ground. Both are in reference map units. [Suri2010] eq 3.27–3.32,
[Patel2017] eq 2.2–2.7.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from affine import Affine
from numpy.typing import ArrayLike

from ..rasters.grid import FloatArray, apply_affine, compose

if TYPE_CHECKING:
    from typing import Self  # Python 3.11; annotations alone need it


# Model that needs heights (see `terrain`).
TERRAIN = "terrain"

# Degree of the polynomial, and number of parameters, from the simplest model to the most flexible.
DEGREE = {
    "translation": 0,
    "rigid": 1,
    "similarity": 1,
    "affine": 1,
    "polynomial2": 2,
    "polynomial3": 3,
}
PARAMETERS = {
    "translation": 2,
    "rigid": 3,
    "similarity": 4,
    "affine": 6,
    "polynomial2": 12,
    "polynomial3": 20,
    "tps": 20,
    TERRAIN: 8,
}
# Models whose linear part is a rotation, and a scale.
SHAPE_PRESERVING = ("rigid", "similarity")
# Models of the plane alone.
KINDS = tuple(kind for kind in PARAMETERS if kind != TERRAIN)

# The inverse has converged when its miss is below the precision, as a share of the frame, and does
# not exist where the last miss is above the largest: a hundredth of a pixel in 10 000.
_INVERSE_PRECISION, _LARGEST_MISS = 1e-12, 1e-6
_INVERSE_STEPS = 20


@dataclass(frozen=True)
class Frame:
    """The coordinates that coefficients refer to: `to_map` takes them to the map.

    Rigid and similarity models preserve shapes in these coordinates.
    """

    to_map: Affine

    @classmethod
    def around(cls, xy: FloatArray) -> Frame:
        """Return the frame in which the positions `xy`, shape (n, 2), lie within ±1."""
        low, high = xy.min(axis=0), xy.max(axis=0)
        scale = float(np.max(high - low) / 2) or 1.0
        return cls(compose(Affine.translation(*((low + high) / 2)), Affine.scale(scale)))

    def enter(self, xy: ArrayLike) -> FloatArray:
        """Return map positions in this frame."""
        return apply_affine(~self.to_map, xy)

    def leave(self, uv: FloatArray) -> FloatArray:
        """Return positions of this frame on the map."""
        return apply_affine(self.to_map, uv)


def fewest_points(kind: str) -> int:
    """Return how many points, of two coordinates each, determine a model."""
    return -(-PARAMETERS[kind] // 2)


def monomials(uv: FloatArray, degree: int) -> FloatArray:
    """Return the monomials u^i v^j, i + j <= `degree`, by rising degree, shape (n, terms)."""
    u, v = uv[:, 0], uv[:, 1]
    columns = [u ** (total - j) * v**j for total in range(degree + 1) for j in range(total + 1)]
    return np.column_stack(columns)


@dataclass(frozen=True, eq=False)
class Model(ABC):
    """Base of all models: a displacement that depends on the position in a frame.

    Parameters
    ----------
    kind
        One of `PARAMETERS`.
    frame
        Frame of the coefficients.
    """

    kind: str
    frame: Frame

    @abstractmethod
    def displacement(self, uv: FloatArray) -> FloatArray:
        """Return the displacement, in the frame, of positions in the frame, both (n, 2)."""

    def to_json(self) -> dict[str, Any]:
        """Return the model as values that JSON can carry."""
        arrays = {k: v.tolist() for k, v in vars(self).items() if isinstance(v, np.ndarray)}
        return {"kind": self.kind, "frame": list(self.frame.to_map)[:6], **arrays}

    def __call__(self, xy: ArrayLike) -> FloatArray:
        """Return the nominal positions, shape (n, 2), of reference map positions `xy`."""
        uv = self.frame.enter(xy)
        return self.frame.leave(uv + self.displacement(uv))

    def inverse(self, xy: ArrayLike) -> FloatArray:
        """Return the reference map positions, shape (n, 2), of nominal positions `xy`.

        Newton's method with a numerical Jacobian; NaN where it finds no inverse, as beyond a fold
        of a polynomial.
        """
        target = self.frame.enter(xy)
        # Start at the frame's origin: without georeferencing, nominal positions are far from it.
        uv = self._newton_step(np.zeros_like(target), target)
        for _ in range(_INVERSE_STEPS):
            miss = target - uv - self.displacement(uv)
            if np.nanmax(np.abs(miss), initial=0.0) < _INVERSE_PRECISION:
                break
            uv = self._newton_step(uv, target)
        miss = np.abs(target - uv - self.displacement(uv)).max(axis=1)
        return np.where(miss[:, None] <= _LARGEST_MISS, self.frame.leave(uv), np.nan)

    def on_map(self, affine: Affine) -> Self:
        """Return this model, which takes pixel positions, as a model of map positions.

        `affine` takes the pixels to the map.
        """
        return replace(self, frame=Frame(compose(affine, self.frame.to_map)))

    def _newton_step(self, uv: FloatArray, target: FloatArray) -> FloatArray:
        step = 1e-4
        miss = target - uv - self.displacement(uv)
        along_u = self._slope(uv, np.array([step, 0.0])) + [1, 0]
        along_v = self._slope(uv, np.array([0.0, step])) + [0, 1]
        determinant = along_u[:, 0] * along_v[:, 1] - along_v[:, 0] * along_u[:, 1]
        du = (miss[:, 0] * along_v[:, 1] - miss[:, 1] * along_v[:, 0]) / determinant
        dv = (miss[:, 1] * along_u[:, 0] - miss[:, 0] * along_u[:, 1]) / determinant
        return uv + np.column_stack([du, dv])

    def _slope(self, uv: FloatArray, step: FloatArray) -> FloatArray:
        rise = self.displacement(uv + step) - self.displacement(uv - step)
        return np.asarray(rise / (2 * np.abs(step).max()))


@dataclass(frozen=True, eq=False)
class PolynomialModel(Model):
    """Translation to third-degree polynomial: the displacement is a polynomial of the position.

    Rigid and similarity models are constrained polynomials of degree 1.

    Parameters
    ----------
    coefficients
        Shape (terms, 2): of the displacement in the frame, in the order of `monomials`.
    """

    coefficients: FloatArray

    def displacement(self, uv: FloatArray) -> FloatArray:
        """Return the displacement, in the frame, of positions in the frame, both (n, 2)."""
        return monomials(uv, DEGREE[self.kind]) @ self.coefficients


@dataclass(frozen=True, eq=False)
class ThinPlateSpline(Model):
    """Thin-plate spline: an affine part and bending weights at control points ([Bookstein1989]).

    Parameters
    ----------
    knots
        Control points in the frame, shape (n, 2).
    weights
        Bending weights of the displacement, shape (n, 2).
    affine
        Coefficients of the displacement's affine part, shape (3, 2).
    """

    knots: FloatArray
    weights: FloatArray
    affine: FloatArray

    def displacement(self, uv: FloatArray) -> FloatArray:
        """Return the displacement, in the frame, of positions in the frame, both (n, 2)."""
        bending = thin_plate_kernel(uv, self.knots) @ self.weights
        return np.asarray(bending + monomials(uv, 1) @ self.affine)


def thin_plate_kernel(uv: FloatArray, knots: FloatArray) -> FloatArray:
    """Return r² log r for all distances between `uv` (m, 2) and `knots` (n, 2), shape (m, n)."""
    squared = ((uv[:, None, :] - knots[None, :, :]) ** 2).sum(axis=2)
    return np.asarray(0.5 * squared * np.log(np.maximum(squared, 1e-300)))


def shift_model(dx: float, dy: float) -> Model:
    """Return a translation in map units as a model; (0, 0) is the identity."""
    return PolynomialModel("translation", Frame(Affine.identity()), np.array([[dx, dy]]))
