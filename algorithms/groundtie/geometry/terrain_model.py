"""A model with a height term: affine displacement plus relief displacement."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from affine import Affine
from numpy.typing import ArrayLike, NDArray
from rasterio.crs import CRS

from ..errors import GroundTieError, TransformFileError
from ..kinds import plain
from ..rasters.grid import mesh
from .models import TERRAIN, FloatArray, Frame, Model, PolynomialModel
from .terrain import Terrain

IntArray = NDArray[np.intp]

# Heights are found along the line of sight to this precision, in metres: far below the height that
# displaces by a pixel.
_PRECISION_M = 0.01

# Largest number of steps. On a ridge steeper than any real one, 15 do not suffice (test_terrain).
_STEPS = 30

# Below this slope, per metre, between line of sight and ground, the line meets the ground more than
# once nearby (layover), and a secant step does not approach a solution.
LEAST_SLOPE = 0.2

# A stored transform's heights are compared with the terrain models at this many places a side, to
# this tolerance in metres.
_COMPARED, _SAME_M = 3, 0.05


@dataclass(frozen=True)
class TerrainModel(Model):
    """An affine displacement, plus one along the line of sight proportional to a height error.

    Parameters
    ----------
    coefficients
        Shape (4, 2): the affine displacement in the frame, in the order of `monomials`, and the
        displacement for each metre of height.
    terrain
        Source of the heights, for the positions that the frame leads to.
    origin_m
        Height error that the affine part already contains; it is subtracted.
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
        """Return the ground's height, (n,), above the assumed height where the image shows it."""
        terrain, leave = self.terrain, self.frame.leave
        ground = terrain.ground_m(leave(uv)) - self.origin_m
        if terrain.assumed is None:
            return ground
        start, along = uv + self.affine.displacement(uv), self.coefficients[3]

        def risen(rise: FloatArray, places: IntArray) -> FloatArray:
            shown = leave(start[places] + rise[:, None] * along)
            return ground[places] - terrain.assumed_m(shown)

        return _settled(risen, len(uv))

    def inverse(self, xy: ArrayLike) -> FloatArray:
        """Return the reference map positions, shape (n, 2), of nominal positions `xy`.

        They lie where the line of sight to the nominal position meets the ground.
        """
        terrain, leave = self.terrain, self.frame.leave
        uv, along = self.frame.enter(xy), self.coefficients[3]
        assumed = terrain.assumed_m(leave(uv)) + self.origin_m
        constant, linear = self.coefficients[0], np.eye(2) + self.coefficients[1:3]

        def seen(rise: FloatArray, places: IntArray | slice = slice(None)) -> FloatArray:
            shown = uv[places] - rise[:, None] * along - constant
            return leave(np.asarray(np.linalg.solve(linear.T, shown.T).T, np.float64))

        def risen(rise: FloatArray, places: IntArray) -> FloatArray:
            return terrain.ground_m(seen(rise, places)) - assumed[places]

        return seen(_settled(risen, len(uv)))

    def on_map(self, affine: Affine) -> TerrainModel:
        """Return this model, which takes pixel positions, as a model of map positions."""
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
            Result of `to_json`.
        frame
            Frame of the coefficients.
        crs
            CRS of the map.
        folder
            Folder to search for terrain models that are no longer at their stored path.

        Raises
        ------
        KeyError, TypeError, ValueError
            The values do not describe a model.
        TransformFileError
            A terrain model is missing, or its heights differ from the stored ones.
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
        """Return ground and assumed heights at places of the frame, shape (n, 2)."""
        side = np.linspace(-0.5, 0.5, _COMPARED)
        places = self.frame.leave(mesh(side, side))
        terrain = self.terrain
        return np.column_stack([terrain.ground_m(places), terrain.assumed_m(places)])


def _settled(risen: Callable[[FloatArray, IntArray], FloatArray], size: int) -> FloatArray:
    """Return the fixed points, shape (size,), of a function of heights at places.

    `risen` takes heights and the numbers of their places, both (n,). Secant steps, kept within a
    bracket once one height is known to be too low and one too high: a continuous function has a
    fixed point between them, even if it has others elsewhere. Few places, those in layover, take
    many steps: the others are left out as soon as they are found.
    """
    found, places, before = np.empty(size), np.arange(size), np.zeros(size)
    found[:] = rise = risen(before, places)
    missed = -rise
    low, high = np.where(missed < 0, 0.0, -np.inf), np.where(missed < 0, np.inf, 0.0)
    for _ in range(_STEPS):
        still = rise - risen(rise, places)
        found[places[np.isnan(still)]] = np.nan
        is_open = np.abs(still) > _PRECISION_M
        if not is_open.any():
            break
        places, still, missed = places[is_open], still[is_open], missed[is_open]
        before, rise, low, high = before[is_open], rise[is_open], low[is_open], high[is_open]
        low, high = np.where(still < 0, rise, low), np.where(still < 0, high, rise)
        with np.errstate(invalid="ignore", divide="ignore"):
            slope = (still - missed) / (rise - before)
            step = -still / slope
        # In layover: onward to the other side of the fixed point, twice as far each time.
        onward = -np.sign(still) * 2 * np.abs(rise - before)
        step = np.where(slope > LEAST_SLOPE, step, onward)
        before, missed = rise, still
        rise = rise + step
        is_beyond = ((rise <= low) | (rise >= high)) & np.isfinite(high - low)
        rise = np.where(is_beyond, (low + high) / 2, rise)
        found[places] = rise
    return found


def _found(path: str, folder: Path | None) -> Path:
    """Return a terrain model's file or, if it is gone, the file of that name in a folder."""
    beside = Path() if folder is None else folder
    # Plain files only: with GDAL's other names, a transform's author could have anything opened.
    for file in (beside / path, beside / Path(path).name):
        if file.is_file():
            return file
    raise TransformFileError(f"{path}, whose heights the transform needs, is not there")
