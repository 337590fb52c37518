"""Models as values that JSON can carry, read back."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from affine import Affine
from rasterio.crs import CRS

from ..rasters.grid import is_invertible
from .models import (
    DEGREE,
    TERRAIN,
    FloatArray,
    Frame,
    Model,
    PolynomialModel,
    ThinPlateSpline,
)
from .terrain import TerrainModel


def model_from_json(
    values: dict[str, Any], crs: CRS | None = None, folder: Path | None = None
) -> Model:
    """Return the model that `to_json` described.

    Parameters
    ----------
    values
        What `to_json` returned.
    crs
        CRS of the map.
    folder
        Where terrain models are looked for that are not where they were.

    Raises
    ------
    KeyError, TypeError, ValueError
        The values describe none.
    GroundTieError
        A terrain model cannot be opened, or is another one.
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
    terms = (DEGREE[kind] + 1) * (DEGREE[kind] + 2) // 2
    return PolynomialModel(kind, frame, _pairs(values["coefficients"], terms))


def _pairs(values: Any, count: int = -1) -> FloatArray:
    pairs = np.asarray(values, float).reshape(count, 2)
    if not np.isfinite(pairs).all():
        raise ValueError("a number of the model is not finite")
    return pairs
