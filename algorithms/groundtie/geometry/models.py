"""Models of the misregistration: maps of the plane onto itself.

A model takes a position on the reference map to the place where the input's own georeferencing
claims this ground to lie. Both are in reference map units. Thesis S eq 3.27–3.32, P eq 2.2–2.7.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

# Degree of the polynomial, and fewest points, from the simplest model to the most flexible.
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
}
KINDS = tuple(PARAMETERS)

_INVERSE_STEPS = 20


class Model(Protocol):
    """What every model can do."""

    @property
    def kind(self) -> str:
        """One of `KINDS`."""

    def __call__(self, xy: ArrayLike) -> FloatArray:
        """Return the claimed positions, shape (n, 2), of reference map positions `xy`."""

    def inverse(self, xy: ArrayLike) -> FloatArray:
        """Return the reference map positions, shape (n, 2), of claimed positions `xy`."""

    def to_json(self) -> dict[str, Any]:
        """Return the model as values that JSON can carry."""


@dataclass(frozen=True)
class Frame:
    """Origin and unit of the coordinates that coefficients refer to, for well-posed numbers."""

    origin: tuple[float, float]
    scale: float

    @classmethod
    def around(cls, xy: FloatArray) -> Frame:
        """Return the frame in which the positions `xy`, shape (n, 2), lie within ±1."""
        low, high = xy.min(axis=0), xy.max(axis=0)
        scale = float(np.max(high - low) / 2) or 1.0
        centre = (low + high) / 2
        return cls((float(centre[0]), float(centre[1])), scale)

    def enter(self, xy: ArrayLike) -> FloatArray:
        """Return map positions in this frame."""
        return np.asarray((np.asarray(xy, float).reshape(-1, 2) - self.origin) / self.scale)

    def leave(self, uv: FloatArray) -> FloatArray:
        """Return positions of this frame on the map."""
        return np.asarray(uv * self.scale + self.origin)


def monomials(uv: FloatArray, degree: int) -> FloatArray:
    """Return the monomials u^i v^j, i + j <= `degree`, by rising degree, shape (n, terms)."""
    u, v = uv[:, 0], uv[:, 1]
    columns = [u ** (total - j) * v**j for total in range(degree + 1) for j in range(total + 1)]
    return np.column_stack(columns)


@dataclass(frozen=True)
class PolynomialModel:
    """Translation to third-degree polynomial: the displacement is a polynomial of the position.

    Parameters
    ----------
    kind
        One of `DEGREE`'s keys; rigid and similarity are constrained polynomials of degree 1.
    frame
        What the coefficients refer to.
    coefficients
        Of the displacement in the frame, shape (terms, 2), in the order of `monomials`.
    """

    kind: str
    frame: Frame
    coefficients: FloatArray

    @classmethod
    def identity(cls, frame: Frame) -> PolynomialModel:
        """Return the translation by nothing."""
        return cls("translation", frame, np.zeros((1, 2)))

    def __call__(self, xy: ArrayLike) -> FloatArray:
        """Return the claimed positions of reference map positions."""
        uv = self.frame.enter(xy)
        return self.frame.leave(uv + monomials(uv, DEGREE[self.kind]) @ self.coefficients)

    def inverse(self, xy: ArrayLike) -> FloatArray:
        """Return the reference map positions of claimed positions."""
        return invert(self, xy)

    def to_json(self) -> dict[str, Any]:
        """Return the model as values that JSON can carry."""
        return {
            "kind": self.kind,
            "origin": list(self.frame.origin),
            "scale": self.frame.scale,
            "coefficients": self.coefficients.tolist(),
        }


@dataclass(frozen=True)
class ThinPlateSpline:
    """Thin-plate spline: an affine part and bending weights at control points (Bookstein 1989).

    Parameters
    ----------
    frame
        What all else refers to.
    knots
        Control points in the frame, shape (n, 2).
    weights
        Bending weights of the displacement, shape (n, 2).
    affine
        Coefficients of the displacement's affine part, shape (3, 2).
    """

    frame: Frame
    knots: FloatArray
    weights: FloatArray
    affine: FloatArray
    kind: str = "tps"

    def __call__(self, xy: ArrayLike) -> FloatArray:
        """Return the claimed positions of reference map positions."""
        uv = self.frame.enter(xy)
        bending = thin_plate_kernel(uv, self.knots) @ self.weights
        return self.frame.leave(uv + bending + monomials(uv, 1) @ self.affine)

    def inverse(self, xy: ArrayLike) -> FloatArray:
        """Return the reference map positions of claimed positions."""
        return invert(self, xy)

    def to_json(self) -> dict[str, Any]:
        """Return the model as values that JSON can carry."""
        return {
            "kind": self.kind,
            "origin": list(self.frame.origin),
            "scale": self.frame.scale,
            "knots": self.knots.tolist(),
            "weights": self.weights.tolist(),
            "affine": self.affine.tolist(),
        }


def thin_plate_kernel(uv: FloatArray, knots: FloatArray) -> FloatArray:
    """Return r² log r for all distances between `uv` (m, 2) and `knots` (n, 2), shape (m, n)."""
    squared = ((uv[:, None, :] - knots[None, :, :]) ** 2).sum(axis=2)
    return np.asarray(0.5 * squared * np.log(np.maximum(squared, 1e-300)))


def invert(model: Model, xy: ArrayLike) -> FloatArray:
    """Return where `model` takes to `xy`, by Newton's method with a numerical Jacobian."""
    target = np.asarray(xy, float).reshape(-1, 2)
    frame: Frame = model.frame  # type: ignore[attr-defined]
    step = frame.scale * 1e-4
    found = target - (model(target) - target)
    for _ in range(_INVERSE_STEPS):
        miss = target - model(found)
        if np.nanmax(np.abs(miss), initial=0.0) < frame.scale * 1e-12:
            break
        along_x = (model(found + [step, 0]) - model(found - [step, 0])) / (2 * step)
        along_y = (model(found + [0, step]) - model(found - [0, step])) / (2 * step)
        determinant = along_x[:, 0] * along_y[:, 1] - along_y[:, 0] * along_x[:, 1]
        dx = (miss[:, 0] * along_y[:, 1] - miss[:, 1] * along_y[:, 0]) / determinant
        dy = (miss[:, 1] * along_x[:, 0] - miss[:, 0] * along_x[:, 1]) / determinant
        found = found + np.column_stack([dx, dy])
    return np.asarray(found)


def model_from_json(values: dict[str, Any]) -> Model:
    """Return the model that `to_json` described; raises KeyError or ValueError if it cannot be."""
    frame = Frame((float(values["origin"][0]), float(values["origin"][1])), float(values["scale"]))
    if values["kind"] == "tps":
        return ThinPlateSpline(
            frame,
            np.asarray(values["knots"], float).reshape(-1, 2),
            np.asarray(values["weights"], float).reshape(-1, 2),
            np.asarray(values["affine"], float).reshape(3, 2),
        )
    terms = (DEGREE[values["kind"]] + 1) * (DEGREE[values["kind"]] + 2) // 2
    coefficients = np.asarray(values["coefficients"], float).reshape(terms, 2)
    return PolynomialModel(values["kind"], frame, coefficients)
