"""The displacement field of a registration as a raster, with its standard deviation."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from affine import Affine

from ..rasters.grid import FloatArray, Grid, compose, mesh, metres_per_unit_at
from ..rasters.lattice import lattice
from ..rasters.metadata import BandInfo
from ..rasters.reading import RasterSource
from ..rasters.writing import create_like, one_band
from .evidence import RegistrationEvidence

_ON_MAP = ("dx: move to the east", "dy: move to the north")
_ON_PIXELS = ("dx: move to the right", "dy: move down")
_SIGMA = "sigma: standard deviation of dx and of dy"


def displacement_field(evidence: RegistrationEvidence) -> tuple[FloatArray, Grid]:
    """Return the displacement of an input to its right place, with its standard deviation.

    Parameters
    ----------
    evidence
        Of an accepted registration.

    Returns
    -------
    field
        dx, dy and their standard deviation, shape (3, h, w), in metres east and north (in pixels
        right and down without georeferencing); NaN where the input shows nothing.
    grid
        The matching grid in pixels that are as large as linear interpolation between them allows.
    """
    matching, transform = evidence.grid, evidence.estimate.transform

    def field_px(xy: FloatArray) -> FloatArray:
        px = matching.map_to_pixel(xy)
        moved = px - matching.map_to_pixel(transform.model(xy))
        return np.column_stack([moved, evidence.error.standard_deviation_px(px)])

    nodes = lattice(matching, field_px)
    values = np.array(nodes.values[:, 1:-1, 1:-1])
    rows, cols = values.shape[1:]
    place = compose(matching.transform, Affine.scale(nodes.step))
    grid = matching.on_same_map(place, cols, rows)
    px = mesh(np.arange(cols), np.arange(rows))
    xy = grid.pixel_to_map(px)
    # Of each place, as the scale of a map in degrees or of Mercator differs over a scene.
    x_m, y_m = metres_per_unit_at(xy, matching.crs).T.reshape(2, rows, cols)
    t, (x, y) = matching.transform, values[:2].copy()
    values[0] = (t.a * x + t.b * y) * x_m
    values[1] = (t.d * x + t.e * y) * y_m
    values[2] *= np.maximum(np.hypot(t.a * x_m, t.d * y_m), np.hypot(t.b * x_m, t.e * y_m))
    shown = transform.input_grid.contains(transform(xy)).reshape(rows, cols)
    return np.where(shown, values, np.nan), grid


def write_displacement(evidence: RegistrationEvidence, like: RasterSource, path: Path) -> None:
    """Write the displacement field as a GeoTIFF of three bands.

    Parameters
    ----------
    evidence
        Of an accepted registration.
    like
        The reference.
    path
        The file; see `atomic.Outputs.stage`.

    Raises
    ------
    OutputError
        The file cannot be written.
    """
    field, grid = displacement_field(evidence)
    on_map = grid.is_georeferenced
    plain = BandInfo.plain("float32", float("nan"))
    bands = tuple(
        replace(plain, description=name, unit="m" if on_map else "px")
        for name in (*(_ON_MAP if on_map else _ON_PIXELS), _SIGMA)
    )
    kind = replace(one_band(like, "float32"), bands=bands)
    with create_like(kind, grid, path, nodata=float("nan")) as file:
        file.write(field.astype(np.float32))
