"""The models of one kind at given chips, as functions of the parameters that a fit optimises."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..errors import TooFewPointsError
from ..geometry.models import (
    DEGREE,
    SHAPE_PRESERVING,
    TERRAIN,
    Frame,
    Model,
    PolynomialModel,
    monomials,
)
from ..geometry.rows import Rows
from ..geometry.terrain import Terrain
from ..geometry.terrain_model import TerrainModel
from ..rasters.grid import FloatArray, PointFunction


@dataclass(frozen=True)
class Family(Rows):
    """The models of one kind at given chips, one row per chip.

    Parameters
    ----------
    kind, frame
        The models' kind and the frame of their coefficients.
    px
        The chips' centres, shape (n, 2).
    terrain
        Heights at the grid's pixels; None: the kind needs none.
    rise
        Heights of the chips above the assumed heights, in units of `scale_m` from `origin_m`,
        shape (n, 1); shape (n, 0) for kinds that need no heights.
    """

    kind: str
    frame: Frame
    px: FloatArray
    terrain: Terrain | None
    rise: FloatArray
    origin_m: float = 0.0
    scale_m: float = 1.0

    @classmethod
    def of(cls, kind: str, px: FloatArray, start: PointFunction, terrain: Terrain | None) -> Family:
        """Return the family of a kind; `start` takes the chips to nominal positions."""
        plain = cls(kind, Frame.around(px), px, None, np.zeros((len(px), 0)))
        if kind != TERRAIN:
            return plain
        assert terrain is not None
        rise_m = terrain.ground_m(px) - terrain.assumed_m(start(px))
        origin_m, scale_m = float(np.nanmean(rise_m)), float(np.nanstd(rise_m))
        if not scale_m > 0:
            raise TooFewPointsError("the terrain model has one height at all points")
        found = replace(plain, terrain=terrain, origin_m=origin_m, scale_m=scale_m)
        return found._with_rise(rise_m - origin_m)

    @cached_property
    def design(self) -> FloatArray:
        """Design matrix, by which coefficients, (terms, 2), are multiplied, shape (n, terms)."""
        terms = monomials(self.frame.enter(self.px), DEGREE.get(self.kind, 1))
        return np.hstack([terms, self.rise])

    def model(self, parameters: FloatArray) -> Model:
        """Return the model with the given parameters."""
        coefficients = coefficients_of(self.kind, parameters)[0]
        if self.terrain is None:
            return PolynomialModel(self.kind, self.frame, coefficients)
        scaled = np.vstack([coefficients[:-1], coefficients[-1] / self.scale_m])
        return TerrainModel(self.kind, self.frame, scaled, self.terrain, self.origin_m)

    def starting(self, start: PointFunction) -> FloatArray:
        """Return the parameters of the model of this family nearest to another model."""
        kind, px = self.kind, self.px
        target = (start(px) - px) / self.frame.to_map.a
        coefficients = np.linalg.lstsq(self.design, target, rcond=None)[0]
        if kind not in SHAPE_PRESERVING:
            return np.asarray(coefficients.ravel())
        growth = (coefficients[1, 0] + coefficients[2, 1]) / 2
        turn = (coefficients[1, 1] - coefficients[2, 0]) / 2
        shift = list(coefficients[0])
        if kind == "rigid":
            return np.array([*shift, np.arctan2(turn, 1 + growth)])
        return np.array([*shift, growth, turn])

    def raised(self, parameters: FloatArray) -> Family:
        """Return the family with the heights at which a model places the chips."""
        model = self.model(parameters)
        assert isinstance(model, TerrainModel)
        return self._with_rise(model.rise_m(self.frame.enter(self.px)))

    def _with_rise(self, rise_m: FloatArray) -> Family:
        # Chips of unknown height contribute nothing to the estimate of relief displacement.
        return replace(self, rise=np.nan_to_num(rise_m / self.scale_m)[:, None])


def coefficients_of(kind: str, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
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
