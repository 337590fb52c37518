"""A model with a height term: an affine displacement, and one along the line of sight."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from affine import Affine
from numpy.typing import ArrayLike
from rasterio.crs import CRS

from ..errors import GroundTieError, TransformFileError
from ..kinds import plain
from ..rasters.grid import mesh
from .models import TERRAIN, FloatArray, Frame, Model, PolynomialModel
from .terrain import Terrain

# Heights are found along the line of sight to this, in metres: far below what displaces a pixel.
_PRECISION_M = 0.01

# The most steps until then; on a ridge that is steeper than any, 15 do not suffice (test_terrain).
_STEPS = 30

# Where a line of sight meets the ground at less than this slope between both, per metre, it meets
# it more than once nearby (layover): there no step by the slope leads near.
LEAST_SLOPE = 0.2

# Places a side at which heights are compared with those that a stored transform was made with, in
# metres.
_COMPARED, _SAME_M = 3, 0.05


@dataclass(frozen=True)
class TerrainModel(Model):
    """An affine displacement, and one along the line of sight in proportion to a height error.

    Parameters
    ----------
    coefficients
        Shape (4, 2): of the displacement in the frame, in the order of `monomials`, and the
        displacement for each metre of height.
    terrain
        Where heights come from, for positions where the frame leads to.
    origin_m
        The height error that is not counted: the affine part has it.
    """

    coefficients: FloatArray
    terrain: Terrain
    origin_m: float

    @property
    def affine(self) -> PolynomialModel:
        """The model without heights."""
        return PolynomialModel("affine", self.frame, self.coefficients[:3])

    def displacement(self, uv: FloatArray) -> FloatArray:
        """Return the displacement, in the frame, of positions in the frame, both (n, 2)."""
        along_sight = self.rise_m(uv)[:, None] * self.coefficients[3]
        return self.affine.displacement(uv) + along_sight

    def rise_m(self, uv: FloatArray) -> FloatArray:
        """Return the ground's height, (n,), over that which was assumed where it is shown."""
        terrain, leave = self.terrain, self.frame.leave
        ground = terrain.ground_m(leave(uv)) - self.origin_m
        if terrain.assumed is None:
            return ground
        start, along = uv + self.affine.displacement(uv), self.coefficients[3]

        def risen(rise: FloatArray) -> FloatArray:
            return ground - terrain.assumed_m(leave(start + rise[:, None] * along))

        return _settled(risen, len(uv))

    def inverse(self, xy: ArrayLike) -> FloatArray:
        """Return the reference map positions, shape (n, 2), of nominal positions `xy`.

        Along the line of sight that ends there.
        """
        terrain, leave = self.terrain, self.frame.leave
        uv, along = self.frame.enter(xy), self.coefficients[3]
        assumed = terrain.assumed_m(leave(uv)) + self.origin_m
        constant, linear = self.coefficients[0], np.eye(2) + self.coefficients[1:3]

        def seen(rise: FloatArray) -> FloatArray:
            shown = uv - rise[:, None] * along - constant
            return leave(np.asarray(np.linalg.solve(linear.T, shown.T).T, np.float64))

        return seen(_settled(lambda rise: terrain.ground_m(seen(rise)) - assumed, len(uv)))

    def on_map(self, affine: Affine) -> TerrainModel:
        """Return this model of pixel positions as one of map positions."""
        return replace(super().on_map(affine), terrain=self.terrain.seen_from(~affine))

    def to_json(self) -> dict[str, Any]:
        """Return the model as values that JSON can carry."""
        return {
            **super().to_json(),
            "origin_m": self.origin_m,
            **self.terrain.to_json(),
            "heights_m": plain(self._compared_m()),
        }

    @classmethod
    def from_json(
        cls, values: dict[str, Any], frame: Frame, crs: CRS | None, folder: Path | None
    ) -> TerrainModel:
        """Return the model that `to_json` described.

        Parameters
        ----------
        values
            What `to_json` returned.
        frame
            What the coefficients refer to.
        crs
            CRS of the map.
        folder
            Where terrain models are looked for that are not where they were.

        Raises
        ------
        KeyError, TypeError, ValueError
            The values describe none.
        TransformFileError
            A terrain model is not there, or another one.
        """
        stored_paths = values["dem"], values["input_dem"]
        paths = [None if path is None else str(path) for path in stored_paths]
        left, bottom, right, top = (float(bound) for bound in values["region"])
        dem, input_dem = (None if path is None else _found(path, folder) for path in paths)
        coefficients = np.asarray(values["coefficients"], float).reshape(4, 2)
        origin_m = float(values["origin_m"])
        if not np.isfinite([*coefficients.ravel(), origin_m]).all():
            raise ValueError("a number of the model is not finite")
        try:
            terrain = Terrain.open(dem, input_dem, crs, (left, bottom, right, top))
        except GroundTieError as error:
            raise TransformFileError(str(error)) from error
        model = cls(TERRAIN, frame, coefficients, terrain, origin_m)
        stored = np.array(values["heights_m"], float).reshape(-1, 2)
        if not np.allclose(model._compared_m(), stored, 0, _SAME_M, equal_nan=True):
            raise TransformFileError(
                f"the heights of {' and '.join(str(p) for p in paths if p)} are not those that the "
                "transform was made with"
            )
        return model

    def _compared_m(self) -> FloatArray:
        """Return both heights at places of the frame, shape (n, 2)."""
        side = np.linspace(-0.5, 0.5, _COMPARED)
        places = self.frame.leave(mesh(side, side))
        terrain = self.terrain
        return np.column_stack([terrain.ground_m(places), terrain.assumed_m(places)])


def _settled(risen: Callable[[FloatArray], FloatArray], size: int) -> FloatArray:
    """Return what a function of a height, shapes (size,), returns unchanged.

    By secants, kept between a height that is too low and one that is too high once both are known:
    a continuous function has what is sought between them, wherever else it has it.
    """
    before = np.zeros(size)
    rise = risen(before)
    missed = -rise
    low, high = np.where(missed < 0, 0.0, -np.inf), np.where(missed < 0, np.inf, 0.0)
    for _ in range(_STEPS):
        still = rise - risen(rise)
        if not np.nanmax(np.abs(still), initial=0.0) > _PRECISION_M:
            break
        low, high = np.where(still < 0, rise, low), np.where(still < 0, high, rise)
        with np.errstate(invalid="ignore", divide="ignore"):
            slope = (still - missed) / (rise - before)
            step = -still / slope
        # In layover: on towards the other side, twice as far each time.
        onward = -np.sign(still) * 2 * np.abs(rise - before)
        step = np.where(slope > LEAST_SLOPE, step, onward)
        before, missed = rise, still
        rise = rise + step
        is_beyond = ((rise <= low) | (rise >= high)) & np.isfinite(high - low)
        rise = np.where(is_beyond, (low + high) / 2, rise)
    return rise


def _found(path: str, folder: Path | None) -> Path:
    """Return a terrain model's file, or the one of its name in a folder if it is gone."""
    beside = Path() if folder is None else folder
    # No other names that GDAL knows: whoever wrote the transform could have anything opened.
    for file in (beside / path, beside / Path(path).name):
        if file.is_file():
            return file
    raise TransformFileError(f"{path}, whose heights the transform needs, is not there")
