"""The transform of a registration: reference map position ↔ input pixel position."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from affine import Affine
from numpy.typing import ArrayLike
from rasterio.crs import CRS
from rasterio.errors import CRSError

from ..errors import ParameterError, TransformFileError
from ..rasters.grid import (
    FloatArray,
    Grid,
    PointFunction,
    crs_from_text,
    crs_to_text,
    finite,
    full_turn,
    is_invertible,
    near_longitude,
    reproject,
)
from ..strict_json import read_json
from ..wording import reason_of
from .models import DEGREE, TERRAIN, Frame, Model, PolynomialModel, ThinPlateSpline, shift_model
from .terrain_model import TerrainModel

FORMAT = "groundtie-transform/1"


@dataclass(frozen=True, eq=False)
class Transform:
    """Reference map position ↔ input pixel position, for any number of positions at a time.

    Positions are array-likes of shape (..., 2), x before y and column before row; results are
    arrays of the same shape. A single position has the shape (2,).

    The model takes a reference map position to its nominal position, where the input's
    georeferencing places this ground. That georeferencing takes the nominal position to a pixel.

    Parameters
    ----------
    model
        The misregistration, in reference map units.
    crs
        CRS of the reference map.
    input_grid
        The input's own georeferencing.
    """

    model: Model
    crs: CRS | None
    input_grid: Grid

    @classmethod
    def nominal(cls, crs: CRS | None, input_grid: Grid) -> Transform:
        """Return the transform by the input's own georeferencing, unchanged."""
        return cls(shift_model(0.0, 0.0), crs, input_grid)

    def __call__(self, xy: ArrayLike) -> FloatArray:
        """Return the input pixels (col, row), centres at integers, of map positions (..., 2).

        Raises
        ------
        ParameterError
            The positions have another shape.
        """
        positions = as_positions(xy)
        moved = self.model(self._at_model(positions.reshape(-1, 2)))
        nominal = self.input_grid.to_own_map(moved, self.crs)
        return self.input_grid.map_to_pixel(nominal).reshape(positions.shape)

    def of_map(self, crs: CRS | None) -> PointFunction:
        """Return the function from positions (n, 2) on a map of another CRS to input pixels."""
        return lambda xy: self(reproject(xy, crs, self.crs))

    def nominal_xy(self, px: ArrayLike) -> FloatArray:
        """Return the nominal reference map positions of input pixels (col, row), (..., 2).

        Raises
        ------
        ParameterError
            The positions have another shape.
        """
        positions = as_positions(px)
        xy = self.input_grid.pixel_to_map(positions.reshape(-1, 2))
        return reproject(xy, self.input_grid.crs, self.crs).reshape(positions.shape)

    def onto_reference(self, grid: Grid) -> FloatArray:
        """Return the matrix, (2, 2), from nominal to reference pixels of a grid.

        Differences of nominal pixels, (n, 2), times the matrix are in the grid's pixels on the
        reference; the transform may scale and rotate between them. The matrix is the mean over the
        grid, from side to side along columns and rows, and ignores heights.
        """
        model = self.model.affine if isinstance(self.model, TerrainModel) else self.model
        size = np.array(grid.size, float)
        ends = grid.centre_px + np.vstack([np.diag(-size), np.diag(size)]) / 2
        first, last = np.split(grid.map_to_pixel(model(grid.pixel_to_map(ends))), 2)
        return np.asarray(np.linalg.inv((last - first) / size[:, None]), np.float64)

    def inverse(self, px: ArrayLike) -> FloatArray:
        """Return the reference map positions of input pixels (col, row), (..., 2).

        Raises
        ------
        ParameterError
            The positions have another shape.
        """
        nominal = self.nominal_xy(px)
        at_model = self._at_model(nominal.reshape(-1, 2))
        return self.model.inverse(at_model).reshape(nominal.shape)

    def _at_model(self, xy: FloatArray) -> FloatArray:
        """Return reference map positions, (n, 2), with longitudes near those of the model."""
        return xy if self._longitude is None else near_longitude(xy, self._longitude, self.crs)

    @cached_property
    def _longitude(self) -> float | None:
        """Longitude of the model's place, on a map with longitudes.

        None: the model has no place, or the input spans half a turn or more, so that the turn in
        which a position lies is ambiguous.
        """
        turn = full_turn(self.crs)
        if turn is None or self.model.frame.to_map == Affine.identity():
            return None
        longitude = float(self.model.frame.leave(np.zeros((1, 2)))[0, 0])
        outline = finite(self.nominal_xy(self.input_grid.outline()))
        around = near_longitude(outline, longitude, self.crs)[:, 0]
        is_on_one_side = len(around) > 0 and np.ptp(around) < turn / 2
        return longitude if is_on_one_side else None

    def to_json(self) -> dict[str, Any]:
        """Return the transform as values that JSON can carry."""
        return {
            "format": FORMAT,
            "crs": crs_to_text(self.crs),
            "model": self.model.to_json(),
            "input": self.input_grid.to_json(),
        }

    @classmethod
    def from_json(cls, values: dict[str, Any], folder: Path | None = None) -> Transform:
        """Return the transform that `to_json` described.

        Parameters
        ----------
        values
            Result of `to_json`.
        folder
            Folder to search for terrain models that are no longer at their stored path.

        Raises
        ------
        TransformFileError
            The values do not describe a transform.
        """
        try:
            if not isinstance(values, Mapping):
                raise TransformFileError("not a transform: no object of names and values")
            if values["format"] != FORMAT:
                raise TransformFileError(f"not a {FORMAT} file but {values['format']!r:.60}")
            grid, crs = Grid.from_json(values["input"]), crs_from_text(values["crs"])
            return cls(model_from_json(values["model"], crs, folder), crs, grid)
        except (KeyError, TypeError, ValueError, CRSError, OverflowError) as error:
            if isinstance(error, TransformFileError):
                raise
            reason = f"{error} is missing" if isinstance(error, KeyError) else error
            raise TransformFileError(f"not a transform: {reason}") from error


def as_positions(values: ArrayLike) -> FloatArray:
    """Return positions as an array, shape (..., 2); an empty array may have any shape.

    Raises
    ------
    ParameterError
        The positions are not numbers, or the last axis is not (x, y), as when all x precede all y.
    """
    try:
        positions = np.asarray(values, float)
    except (TypeError, ValueError) as error:
        raise ParameterError(f"positions must be numbers: {error}") from error
    if positions.size and positions.shape[-1:] != (2,):
        raise ParameterError(f"positions must have the shape (..., 2), not {positions.shape}")
    return positions


def load_transform(path: str | Path) -> Transform:
    """Read a transform from a JSON file.

    Raises
    ------
    TransformFileError
        The file cannot be read or does not hold a transform.
    """
    if not isinstance(path, (str, Path)):
        raise TransformFileError(f"a transform is read from a file, not from {type(path).__name__}")
    try:
        return Transform.from_json(read_json(Path(path)), Path(path).parent)
    except TransformFileError as error:
        raise TransformFileError(f"{path}: {error}") from error
    except (OSError, ValueError) as error:
        raise TransformFileError(f"cannot read the transform {path}: {reason_of(error)}") from error


def model_from_json(
    values: dict[str, Any], crs: CRS | None = None, folder: Path | None = None
) -> Model:
    """Return the model that `to_json` described.

    Parameters
    ----------
    values
        Result of `to_json`.
    crs
        CRS of the map.
    folder
        Folder to search for terrain models that are no longer at their stored path.

    Raises
    ------
    KeyError, TypeError, ValueError
        The values do not describe a model.
    GroundTieError
        A terrain model cannot be opened, or its heights differ from the stored ones.
    """
    kind, frame = values["kind"], Frame(Affine(*(float(number) for number in values["frame"])))
    if not is_invertible(frame.to_map):
        raise ValueError("the model's frame has no size")
    if kind == "tps":
        knots, weights = _pairs(values["knots"]), _pairs(values["weights"])
        if len(knots) != len(weights):
            raise ValueError(f"{len(knots)} knots have {len(weights)} weights")
        return ThinPlateSpline(kind, frame, knots, weights, _pairs(values["affine"], 3))
    if kind == TERRAIN:
        return TerrainModel.from_json(values, frame, crs, folder)
    if kind not in DEGREE:
        raise ValueError(f"there is no model {kind!r:.60}")
    terms = (DEGREE[kind] + 1) * (DEGREE[kind] + 2) // 2
    return PolynomialModel(kind, frame, _pairs(values["coefficients"], terms))


def _pairs(values: Any, count: int = -1) -> FloatArray:
    pairs = np.asarray(values, float).reshape(count, 2)
    if not np.isfinite(pairs).all():
        raise ValueError("a number of the model is not finite")
    return pairs
