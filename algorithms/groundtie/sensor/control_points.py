"""Ground control points: image positions whose ground position and height are known."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rasterio.crs import CRS

from ..errors import GeoreferencingError, TransformFileError
from ..geometry.georeferencer import SUFFIX as GEOREFERENCER
from ..geometry.georeferencer import write_georeferencer
from ..geometry.point_tables import SIGMA
from ..geometry.tie_point_files import SUFFIXES as TIE_POINT_SUFFIXES
from ..geometry.tie_point_files import read_tie_points, write_tie_points
from ..geometry.tie_points import EDITED, USED, TiePoints
from ..geometry.transform import Transform
from ..rasters.atomic import writing
from ..rasters.grid import LON_LAT, FloatArray, Grid, crs_name, reproject
from .adjustment import Control
from .control_formats import GDAL_FIRST, HEIGHT, read_others
from .control_formats import SUFFIXES as OTHER_SUFFIXES
from .geoids import ELLIPSOIDAL, declared_datum, horizontal
from .orientation import Orientation, SensorGrid
from .rpc import RPC

CORRELATION = "sigma_correlation"

# Standard deviation, in pixels, of points that state none.
_USUAL_SIGMA_PX = 1.0

_NO_HEIGHT = "no height"

# Options for `gdal_translate --optfile`.
GDAL_SUFFIX = ".txt"
SUFFIXES = (*TIE_POINT_SUFFIXES, GDAL_SUFFIX)
READ_SUFFIXES = (*TIE_POINT_SUFFIXES, *OTHER_SUFFIXES)


@dataclass(frozen=True)
class ControlPoints(TiePoints):
    """Ground control points of an image with RPCs; their covariances are in image pixels².

    Parameters
    ----------
    crs
        CRS of the map.
    height_m
        Height above the ellipsoid, shape (n,).
    """

    crs: CRS
    height_m: FloatArray = field(kw_only=True)

    @classmethod
    def of(cls, points: TiePoints, height_m: FloatArray, crs: CRS) -> ControlPoints:
        """Return points on a map with heights, shape (n,); those of unknown height are rejected."""
        is_known = np.isfinite(height_m)
        known = vars(points.reject(~is_known, _NO_HEIGHT))
        return cls(**{**known, "crs": crs, "height_m": np.where(is_known, height_m, 0.0)})

    @property
    def by_hand(self) -> int:
        """Number of points that a person moved or added."""
        return int(self.edited.sum())

    @property
    def without_height(self) -> NDArray[np.bool_]:
        """Which points are rejected as the height of the ground is not known there, (n,)."""
        return np.asarray(self.state == f"rejected: {_NO_HEIGHT}")

    @property
    def lon_lat(self) -> FloatArray:
        """Longitude and latitude, shape (n, 2)."""
        return reproject(self.reference_xy, self.crs, LON_LAT)

    def seen_by(self, rpc: RPC, size: tuple[int, int]) -> Control:
        """Return the points with their image positions by RPCs.

        Raises
        ------
        GeoreferencingError
            The RPCs cannot place a point that is used.
        """
        expected_px = rpc.project(self.lon_lat, self.height_m)
        self.require_placed(np.isfinite(expected_px).all(axis=1) | ~self.used)
        return Control(
            expected_px,
            self.input_px,
            self.covariance_px2,
            size,
        )

    def require_placed(self, placed: NDArray[np.bool_]) -> None:
        """Raise `GeoreferencingError` if RPCs cannot place some of the points."""
        if not placed.all():
            raise GeoreferencingError(
                f"the RPCs cannot place {np.sum(~placed)} of {len(self)} points, the first at "
                f"{self.reference_xy[~placed][0].tolist()} on the map and "
                f"{self.input_px[~placed][0].tolist()} in the image: check these positions and "
                "the points' CRS"
            )

    def write(self, path: str | os.PathLike[str], orientation: Orientation, grid: Grid) -> None:
        """Write the points in the format that the suffix of `path` names (see `SUFFIXES`).

        Residuals and lines refer to `orientation`: a line leads from the map position that it gives
        a point's pixel to the point itself. `grid` is the image's own. A vertical part of the map's
        CRS is left out: the points' heights are above the ellipsoid.

        Raises
        ------
        OutputError
            The file cannot be written, or its suffix is not known.
        """
        crs = horizontal(self.crs)
        if crs != self.crs:
            replace(self, crs=crs).write(path, orientation, grid)
            return
        if Path(path).suffix.lower() == GDAL_SUFFIX:
            with writing(path):
                Path(path).write_text(self._gdal_options(), encoding="utf-8")
            return
        # The points may lie on another map than the image is oriented on.
        by = replace(orientation, crs=horizontal(orientation.crs))
        seen = SensorGrid(grid.transform, by.crs, grid.width, grid.height, by)
        transform = Transform.nominal(self.crs, seen)
        if Path(path).suffix.lower() == GEOREFERENCER:
            with writing(path):
                # The Georeferencer's image positions refer to the image's own grid.
                write_georeferencer(Path(path), self, transform, grid)
            return
        covariance = self.covariance_px2
        sigma = np.sqrt(covariance[:, 0, 0] * covariance[:, 1, 1])
        more = {HEIGHT: self.height_m, CORRELATION: covariance[:, 0, 1] / sigma, **self.more}
        write_tie_points(path, replace(self, more=more), transform)

    def _gdal_options(self) -> str:
        """Return the points of the fit as options of gdal_translate."""
        kept = self.take(self.fit)
        lines = [f"-a_srs {_word(self.crs)}"]
        px = kept.input_px + GDAL_FIRST
        for (col, row), (x, y), height in zip(px, kept.reference_xy, kept.height_m, strict=True):
            lines.append(f"-gcp {col:.6f} {row:.6f} {x:.17g} {y:.17g} {height:.4f}")
        return "\n".join(lines) + "\n"


def _word(crs: CRS) -> str:
    """Return a CRS as a word of GDAL's option files."""
    name = crs_name(crs)
    # GDAL quotes and escapes as JSON does.
    return json.dumps(name, ensure_ascii=False) if '"' in name else name


def left_out(count: int) -> str:
    """Return in words how many points are left out for want of a height."""
    return f"points left out, as the height of the ground is not known there: {count}"


def read_control_points(
    path: Path, orientation: Orientation, grid: Grid, image: str = ""
) -> ControlPoints:
    """Read ground control points, or tie points that a person set in QGIS.

    Parameters
    ----------
    path
        A `.gpkg`, `.geojson`, `.csv` or `.points` file (see `geometry.tie_point_files`), or one of
        another program (see `control_formats`). Points without a height get that of the ground;
        points without a sigma get one of 1 px.
    orientation
        Supplies missing heights, and the CRS of the map if the file does not state it.
    grid
        The image's own grid.
    image
        The image's name: a file of another program may hold points of several images.

    Raises
    ------
    TransformFileError
        The file cannot be read or understood, holds no points, or states heights in a CRS whose
        vertical datum is not the ellipsoid.
    """
    stored = read_others(path, image)
    if stored is None:
        # The Georeferencer's image positions refer to the image's own geotransform, if any. Those
        # of other formats are pixels, whatever the nominal geotransform.
        is_georeferencer = path.suffix.lower() == GEOREFERENCER
        own = replace(grid, crs=None) if is_georeferencer else grid.on_own_pixels()
        stored = read_tie_points(path, own, (HEIGHT, CORRELATION, *SIGMA))
    if len(stored) == 0:
        raise TransformFileError(f"{path} holds no points")
    crs = stored.crs or orientation.crs
    height = stored.more[HEIGHT]
    datum = declared_datum(crs)
    if datum not in (None, ELLIPSOIDAL) and np.isfinite(height).any():
        raise TransformFileError(
            f"{path} states heights above {datum}, but those of control points count from the "
            "ellipsoid: convert them, or leave the heights out to take the terrain model's"
        )
    lon_lat = reproject(stored.reference_xy, crs, LON_LAT)
    height = np.where(np.isfinite(height), height, orientation.heights.at(lon_lat))
    state = np.where(stored.used, USED, "rejected: in the file")
    unknown = np.full(len(stored), np.nan)
    spread = (stored.more.get(name, unknown) for name in (*SIGMA, CORRELATION))
    points = replace(
        TiePoints.unmeasured(stored.reference_xy, stored.input_px, None, state.tolist()),
        covariance_px2=_covariances(*spread),
        is_check=stored.is_check,
        more={EDITED: stored.more[EDITED]} if EDITED in stored.more else {},
        states_fit=stored.states_fit,
    )
    return ControlPoints.of(points, height, crs)


def _covariances(x: FloatArray, y: FloatArray, correlation: FloatArray) -> FloatArray:
    x, y = (np.where(np.isfinite(sigma), sigma, _USUAL_SIGMA_PX) for sigma in (x, y))
    covariance = np.where(np.isfinite(correlation), correlation, 0.0) * x * y
    return np.stack([np.stack([x**2, covariance], -1), np.stack([covariance, y**2], -1)], -2)
