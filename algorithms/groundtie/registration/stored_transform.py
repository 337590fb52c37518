"""Stored transforms and tie points, for the rasters that they were made with or others."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import (
    GeoreferencingError,
    NoOverlapError,
    NotRegisteredError,
    ParameterError,
    TransformFileError,
)
from ..geometry.tie_point_files import read_tie_points
from ..geometry.transform import Transform, load_transform
from ..rasters.grid import FloatArray, Grid, finite, require_both_or_none
from ..rasters.reading import RasterSource
from .tie_point_evidence import TiePointEvidence, TiePointFit
from .verdict import decide

# The kind of model that is fitted to stored tie points by default.
USUAL_MODEL = "affine"


def load_stored(
    path: Path, model: str | None, source: RasterSource
) -> tuple[Transform, TiePointFit | None]:
    """Return a stored transform, or one that is fitted to stored tie points, and its fit.

    Parameters
    ----------
    path
        A `.json` with a transform, or a file of tie points.
    model
        The kind of model that is fitted to tie points; None: `USUAL_MODEL`.
    source
        The raster that tie points are meant for.

    Raises
    ------
    ParameterError
        A kind of model is given for a transform.
    TransformFileError
        The file cannot be read or understood.
    TooFewPointsError
        There are too few tie points for the model.
    NotRegisteredError
        A rule refuses the tie points.
    """
    if path.suffix.lower() == ".json":
        require_no_model(model, path)
        return load_transform(path), None
    points = read_tie_points(path, source.grid)
    if points.crs is None and source.grid.crs is not None:
        raise TransformFileError(f"{path} does not state the CRS of its map positions")
    if not np.isfinite(
        Transform.nominal(points.crs, source.grid).nominal_xy(points.input_px)
    ).all():
        raise TransformFileError(f"{path} holds points that lie outside of their map's projection")
    evidence = TiePointEvidence.of(points, model or USUAL_MODEL, source.grid)
    verdict = decide(evidence)
    if not verdict.accepted:
        raise NotRegisteredError(f"{path}: {verdict.sentence()}")
    return evidence.transform, evidence.fit()


def require_no_model(model: str | None, transform: Path) -> None:
    """Raise `ParameterError` if a kind of model is given for a stored transform."""
    if model is not None:
        raise ParameterError(
            f"a model (model) is fitted to tie points; {transform} holds a transform, which has one"
        )


def transform_of(found: Transform, source: RasterSource, name: object) -> Transform:
    """Return a transform for a raster, which need not be the one that was registered.

    Parameters
    ----------
    found
        The transform.
    source
        The raster.
    name
        What the transform is called in messages: the file that it comes from.

    Raises
    ------
    GeoreferencingError
        The raster cannot be located: it has another size without georeferencing, or only one of
        raster and transform has a CRS.
    NoOverlapError
        The raster lies elsewhere.
    """
    own, registered = source.grid, found.input_grid
    if own.crs is not None and found.crs is None:
        raise GeoreferencingError(
            f"{name} does not state the CRS of its map, but {source.path} has one: take the "
            "raster that it was made with, or one without georeferencing"
        )
    if own.is_georeferenced and registered.is_georeferenced:
        require_both_or_none(own.crs, registered.crs, f"{source.path} and {name}")
        seen = own.to_pixels_of(registered)(own.pixel_to_map(own.outline()))
        if not _boxes_meet(seen, registered):
            raise NoOverlapError(f"{source.path} does not lie where {name} was made for")
        return Transform(found.model, found.crs, own)
    if own.size != registered.size:
        raise GeoreferencingError(
            f"{source.path} has {own.width} × {own.height} pixels, but {name} was made for "
            f"{registered.width} × {registered.height}, and not both are georeferenced"
        )
    return found


def _boxes_meet(px: FloatArray, grid: Grid) -> bool:
    px = finite(px)
    size = np.array(grid.size) - 0.5
    return len(px) > 0 and bool(np.all((px.max(axis=0) > -0.5) & (px.min(axis=0) < size)))
