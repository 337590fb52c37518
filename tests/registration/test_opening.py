"""The default search radius of a pair, where none is given, and models that its pixels exclude."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from affine import Affine
from contexts import context
from raster_files import utm_grid, write_raster
from rasterio.crs import CRS

from groundtie.context import Context
from groundtie.errors import ParameterError
from groundtie.rasters.grid import Grid
from groundtie.rasters.pair import default_radius_m
from groundtie.registration.opening import open_pair, usual_radius_m
from groundtie.registration.specification import COREGISTER, OPTICAL, Specification

__all__ = ["context"]


@pytest.mark.parametrize(
    ("pixels_m", "spec", "radius_m"),
    [
        ((1.0, 1.0), COREGISTER, 100.0),
        ((10.0, 30.0), COREGISTER, 600.0),
        ((10.0, 1.0), OPTICAL, 200.0),
        (None, COREGISTER, 20.0),
        (None, OPTICAL, 75.0),
    ],
)
def test_the_usual_radius_is_what_is_searched(
    tmp_path: Path,
    context: Context,
    pixels_m: tuple[float, float] | None,
    spec: Specification,
    radius_m: float,
) -> None:
    values = np.random.default_rng(0).integers(1, 255, (1, 300, 300)).astype(np.uint8)
    grids: list[Grid | None] = [None, None]
    if pixels_m is not None:
        grids = [utm_grid(300, 300, size) for size in pixels_m]
    paths = [
        write_raster(tmp_path / f"{name}.tif", values, grid)
        for name, grid in zip("ab", grids, strict=True)
    ]
    with open_pair(*paths, spec, context) as opened:
        pair = opened.images
        found = usual_radius_m(pair.reference.source.grid, pair.input.source.grid, spec.free)
        assert found == pytest.approx(radius_m)
        assert pair.limits.radius == pytest.approx(radius_m)


@pytest.mark.parametrize(
    ("pixel_m", "is_on_map", "radius"),
    [(1.0, True, 100.0), (10.0, True, 200.0), (1.0, False, 20.0)],
)
def test_the_default_search_radius(pixel_m: float, is_on_map: bool, radius: float) -> None:
    assert default_radius_m(pixel_m, is_on_map) == pytest.approx(radius)


@pytest.mark.parametrize(
    ("latitude", "kind", "is_refused"),
    [
        (5.0, "rigid", False),
        (60.0, "rigid", True),
        (60.0, "similarity", True),
        (60.0, "affine", False),
        (60.0, "auto", False),
    ],
)
def test_shapes_are_preserved_in_square_pixels_alone(
    tmp_path: Path, context: Context, latitude: float, kind: str, is_refused: bool
) -> None:
    values = np.random.default_rng(0).integers(1, 255, (1, 100, 100)).astype(np.uint8)
    grid = Grid(Affine(1e-5, 0, 10.0, 0, -1e-5, latitude), CRS.from_epsg(4326), 100, 100)
    paths = [write_raster(tmp_path / f"{name}.tif", values, grid) for name in "ab"]

    def opened() -> None:
        with open_pair(*paths, replace(COREGISTER, model=kind), context):
            pass

    if is_refused:
        # An ellipsoid's degree of latitude at 60° is 1.996 times one of longitude.
        with pytest.raises(ParameterError, match=r"2 times as long as wide .* model affine"):
            opened()
    else:
        opened()
