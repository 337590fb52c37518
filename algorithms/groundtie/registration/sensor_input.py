"""Shared input of tools for images with RPCs: the source of heights, and the oriented image."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from rasterio.crs import CRS

from ..errors import NoOverlapError, ParameterError
from ..progress import Progress
from ..rasters.grid import Grid
from ..rasters.reading import RasterSource, open_raster
from ..sensor.geoids import DATUMS, ELLIPSOIDAL, declared_datum, find_geoid
from ..sensor.orientation import Orientation, orient, seen_at
from ..sensor.rpc import RPC, VALID_RANGE
from ..sensor.rpc_files import rpc_of

# Filled voids below this share of an image are not stated: rims are only known in reduced pixels.
_LEAST_FILLED = 0.005


@dataclass(frozen=True)
class Ground:
    """The source of heights, as a user gives it.

    Parameters
    ----------
    dem, datum, geoid
        A terrain model, and the zero of its heights: a datum's name or a geoid's grid.
    height_m
        The height without a terrain model; None: the RPCs' own.
    least_cover
        Share of an image that the terrain model must cover.

    Raises
    ------
    ParameterError
        They do not go together.
    """

    dem: Path | None
    datum: str | None
    geoid: Path | None = None
    height_m: float | None = None
    least_cover: float = 0.0

    def __post_init__(self) -> None:
        if self.dem is None and (self.datum is not None or self.geoid is not None):
            raise ParameterError("a vertical datum or geoid goes with a terrain model (dem)")
        if self.dem is not None and self.height_m is not None:
            raise ParameterError("give either a terrain model (dem) or one height")
        if self.dem is not None and (self.datum is None) == (self.geoid is None):
            raise ParameterError(
                "state what the heights of the terrain model count from: either dem_datum "
                f"({', '.join(DATUMS)}) or a geoid grid"
            )

    def _note(self, orientation: Orientation) -> str:
        """Return in words which heights are used, and the share of the image that they cover."""
        if self.dem is not None:
            share, filled = orientation.known_share, orientation.filled_share
            partly = "" if share == 1 else f", which covers {_percent(share)} of the image"
            has_voids = filled >= _LEAST_FILLED
            voids = f"; {_percent(filled)} are voids that are filled" if has_voids else ""
            above = "the ellipsoid" if self.datum == ELLIPSOIDAL else self.datum or self.geoid
            return f"heights of {self.dem} above {above}{partly}{voids}"
        height = orientation.rpc.offset[2] if self.height_m is None else self.height_m
        return f"no terrain model: the height is {height:g} m above the ellipsoid everywhere"

    def _require_range(self, rpc: RPC) -> None:
        low, high = rpc.heights_m(VALID_RANGE)
        if self.height_m is not None and not low <= self.height_m <= high:
            raise ParameterError(
                f"the RPCs do not hold at a height of {self.height_m:g} m, only from {low:.0f} to "
                f"{high:.0f} m above the ellipsoid"
            )

    def orient(
        self,
        source: RasterSource,
        rpc: RPC,
        crs: CRS | None,
        stack: ExitStack,
        progress: Progress,
    ) -> OrientedImage:
        """Locate an image on a map, by default on that of its UTM zone.

        Rasters are opened within `stack`; `progress` receives which heights are used.

        Raises
        ------
        ParameterError
            The terrain model itself names another vertical datum, or the RPCs do not hold at the
            height.
        GeoreferencingError, NoOverlapError, RasterContentError
            See `orient` and `find_geoid`.
        """

        def opened(path: Path) -> RasterSource:
            return stack.enter_context(open_raster(path))

        self._require_range(rpc)
        dem = None if self.dem is None else opened(self.dem)
        declared = None if dem is None else declared_datum(dem.grid.crs)
        if declared is not None and self.datum is not None and declared != self.datum:
            raise ParameterError(
                f"{self.dem} states that its heights count from {declared}, not {self.datum}"
                + ("" if declared in DATUMS else ": give the grid of that datum's geoid (geoid)")
            )
        geoid = self.geoid
        if geoid is None and self.datum is not None:
            geoid = find_geoid(self.datum)
        grid = None if geoid is None else opened(geoid)
        found = orient(source, rpc, crs or _utm_of(source, rpc), dem, grid, self.height_m)
        if found.known_share < self.least_cover:
            raise NoOverlapError(
                f"{self.dem} covers only {_percent(found.known_share)} of the area of "
                f"{source.path}, less than {_percent(self.least_cover)}"
            )
        heights = self._note(found) + _piece_note(source.grid)
        progress.update(0.0, heights)
        return OrientedImage(source, found, heights)


def _piece_note(grid: Grid) -> str:
    """Return a warning if an image counts its pixels from elsewhere than its own corner.

    A piece that was cut from an image does so, as rasterio writes it. GDAL would ignore it, too.
    """
    a, b, col, d, e, row = grid.transform[:6]
    is_piece = (a, b, d, e) == (1, 0, 0, 1) and (col, row) != (0, 0)
    if grid.crs is not None or not grid.is_georeferenced or not is_piece:
        return ""
    return (
        f"; the image counts its pixels from {col:g}, {row:g}, as a piece of a larger image does: "
        "its RPCs must be those of the piece"
    )


def _percent(share: float) -> str:
    # A share of less than all must read neither as all nor as nothing.
    return f"{min(max(round(100 * share), 1), 99) if share < 1 else 100} %"


def open_sensor_image(
    image: Path, rpc_file: Path | None, stack: ExitStack
) -> tuple[RasterSource, RPC]:
    """Open an image in sensor geometry, and return it with its RPCs."""
    source = stack.enter_context(open_raster(image, allow_sensor_geometry=True))
    return source, rpc_of(source, rpc_file)


@dataclass(frozen=True)
class OrientedImage:
    """An image located by its RPCs and heights, as they were delivered.

    Parameters
    ----------
    source
        The image, open.
    orientation
        How it sees the ground, by its RPCs.
    heights
        Which heights are used, in words.
    """

    source: RasterSource
    orientation: Orientation
    heights: str


def open_oriented_image(
    image: Path,
    rpc_file: Path | None,
    ground: Ground,
    crs: CRS | None,
    stack: ExitStack,
    progress: Progress,
) -> OrientedImage:
    """Open an image in sensor geometry and locate it on a map; see `Ground.orient`."""
    source, rpc = open_sensor_image(image, rpc_file, stack)
    return ground.orient(source, rpc, crs, stack, progress)


def _utm_of(source: RasterSource, rpc: RPC) -> CRS:
    """Return the UTM zone (WGS 84) that an image's centre lies in."""
    seen = seen_at(rpc, source.grid.size, rpc.offset[2])
    longitude, latitude = np.median(seen, axis=0).tolist()
    zone = int((longitude + 180) // 6) % 60 + 1
    return CRS.from_epsg((32600 if latitude >= 0 else 32700) + zone)
