"""What an orthoimage is displaced by: the ground's height over that which it was made with.

A sensor sees a place along a line. An orthoimage shows the place where this line meets the heights
that it was made with, so that the error of these displaces it along the line.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from affine import Affine
from numpy.typing import ArrayLike
from rasterio.crs import CRS

from ..errors import (
    GeoreferencingError,
    GroundTieError,
    NoOverlapError,
    TransformFileError,
)
from ..rasters.grid import Grid, apply_affine, compose, mesh, reproject
from ..rasters.reading import open_raster
from ..rasters.surfaces import RasterSurface, surface_around
from .models import TERRAIN, FloatArray, Frame, Model, PolynomialModel

# Heights are found along the line of sight to this, in metres: far below what displaces a pixel.
_PRECISION_M = 0.01
_STEPS = 15

# Where a line of sight meets the ground at less than this slope between both, per metre, it meets
# it more than once nearby (layover): there steps are no larger than from such a slope.
_LEAST_SLOPE = 0.2

# Places a side at which heights are compared with those that a stored transform was made with, in
# metres, and those that must be known.
_COMPARED, _SAME_M = 3, 0.05
_ASKED = 33


@dataclass(frozen=True)
class Terrain:
    """Heights of the ground, and those that an orthoimage was made with.

    Parameters
    ----------
    ground
        Heights of the ground at map positions.
    assumed
        Those that the orthoimage was made with; None: one height everywhere.
    region
        Least x and y of the map that are asked for, and the largest: within, voids are filled, and
        the outermost heights hold beyond the rasters.
    plane
        Takes the positions that are asked for, of a map or of a grid's pixels, to the map.
    """

    ground: RasterSurface
    assumed: RasterSurface | None
    region: tuple[float, float, float, float]
    plane: Affine = field(default_factory=Affine.identity)

    @classmethod
    def open(
        cls,
        dem: Any,
        input_dem: Any | None,
        crs: CRS | None,
        region: tuple[float, float, float, float],
    ) -> Terrain:
        """Open terrain models for positions on a map.

        Parameters
        ----------
        dem, input_dem
            The rasters, of any CRS; what `open_raster` takes.
        crs
            CRS of the map.
        region
            See `Terrain`.

        Raises
        ------
        GeoreferencingError, NoOverlapError, RasterContentError
            One of them cannot be located, lies elsewhere or holds no value there.
        """
        assumed = None if input_dem is None else _surface(input_dem, crs, region)
        return cls(_surface(dem, crs, region), assumed, region)

    def seen_from(self, affine: Affine) -> Terrain:
        """Return this terrain for positions on a lattice that `affine` takes to what was asked."""
        return replace(self, plane=compose(self.plane, affine))

    def ground_m(self, xy: FloatArray) -> FloatArray:
        """Return the height of the ground, (n,), at positions (n, 2); NaN if unknown."""
        return self.ground.at(apply_affine(self.plane, xy))

    def assumed_m(self, xy: FloatArray) -> FloatArray:
        """Return the height, (n,), that the orthoimage was made with at positions (n, 2)."""
        if self.assumed is None:
            return np.zeros(len(xy))
        return self.assumed.at(apply_affine(self.plane, xy))

    def require_cover(self, grid: Grid, within: Grid, crs: CRS | None) -> None:
        """Refuse terrain models that do not cover where a grid and another one meet.

        Raises
        ------
        NoOverlapError
            Heights are unknown at a part of it.
        """
        xy = grid.pixel_to_map(grid.lattice(_ASKED))
        xy = xy[within.contains(within.map_to_pixel(reproject(xy, crs, within.crs)))]
        for surface in (self.ground, self.assumed):
            if surface is None:
                continue
            own = surface.source.grid
            known = own.contains(own.map_to_pixel(reproject(xy, crs, own.crs)))
            if not known.all():
                raise NoOverlapError(
                    f"{surface.source.path} covers only {100 * known.mean():.0f} % of where the "
                    "images overlap: give a terrain model of all of it"
                )

    def to_json(self) -> dict[str, Any]:
        """Return where the heights come from as values that JSON can carry."""
        assumed = self.assumed
        return {
            "dem": _place(self.ground),
            "input_dem": None if assumed is None else _place(assumed),
            "region": list(self.region),
        }


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
        """Return this model of lattice positions as one of map positions."""
        terrain = self.terrain.seen_from(~affine)
        return replace(self, frame=self.frame.seen_from(affine), terrain=terrain)

    def to_json(self) -> dict[str, Any]:
        """Return the model as values that JSON can carry."""
        return {
            "kind": self.kind,
            "frame": list(self.frame.to_map)[:6],
            "coefficients": self.coefficients.tolist(),
            "origin_m": self.origin_m,
            **self.terrain.to_json(),
            "heights_m": [
                [float(height) if np.isfinite(height) else None for height in place]
                for place in self._compared_m().tolist()
            ],
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
        paths = [None if values[name] is None else str(values[name]) for name in _FILES]
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


_FILES = ("dem", "input_dem")


def _settled(risen: Callable[[FloatArray], FloatArray], size: int) -> FloatArray:
    """Return what a function of a height, shapes (size,), returns unchanged; by secants."""
    before = np.zeros(size)
    rise = risen(before)
    missed = -rise
    for _ in range(_STEPS):
        still = rise - risen(rise)
        if not np.nanmax(np.abs(still), initial=0.0) > _PRECISION_M:
            break
        with np.errstate(invalid="ignore", divide="ignore"):
            slope = (still - missed) / (rise - before)
        slope = np.where(slope > _LEAST_SLOPE, slope, np.where(slope <= 0, 1.0, _LEAST_SLOPE))
        before, missed = rise, still
        rise = rise - still / slope
    return rise


def _surface(
    raster: Any, crs: CRS | None, region: tuple[float, float, float, float]
) -> RasterSurface:
    # Not closed: whoever has the transform may ask for heights at any time.
    source = open_raster(raster)
    grid = source.grid
    if (grid.crs is None) != (crs is None):
        raise GeoreferencingError(f"only one of {source.path} and the reference has a CRS")

    left, bottom, right, top = region
    last = np.array([grid.width, grid.height]) - 1

    def to_px(xy: FloatArray) -> FloatArray:
        px = grid.map_to_pixel(reproject(xy, crs, grid.crs))
        asked = np.all((xy >= [left, bottom]) & (xy <= [right, top]), axis=1)
        return np.where(asked[:, None], np.clip(px, 0, last), px)

    xy = mesh(np.linspace(left, right, _ASKED), np.linspace(bottom, top, _ASKED))
    return surface_around(source, to_px, xy)


def _place(surface: RasterSurface) -> str:
    path = Path(surface.source.path)
    return str(path.resolve() if path.exists() else path)


def _found(path: str, folder: Path | None) -> Path:
    """Return a terrain model's file, or the one of its name in a folder if it is gone."""
    beside = Path() if folder is None else folder
    # No other names that GDAL knows: whoever wrote the transform could have anything opened.
    for file in (beside / path, beside / Path(path).name):
        if file.is_file():
            return file
    raise TransformFileError(f"{path}, whose heights the transform needs, is not there")
