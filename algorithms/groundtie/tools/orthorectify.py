"""Orthorectify an image by its RPCs and a terrain model."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from rasterio.crs import CRS
from rasterio.errors import CRSError

from ..context import threads
from ..declaration import tool
from ..errors import ParameterError
from ..kinds import Crs, RasterOut
from ..progress import SILENT, Progress
from ..rasters.atomic import Outputs
from ..rasters.grid import require_map
from ..rasters.reading import open_raster
from ..registration.orthorectification import write_orthoimage
from ..registration.sensor_input import Ground, open_sensor_image
from ..sensor.heights import require_crs
from .parameters import general, sensor
from .results import SIZE_OUTPUTS, WrittenRaster


@dataclass(frozen=True)
class OrthoResult(WrittenRaster):
    """What `orthorectify` made: the raster, and the heights that were used, in words."""

    heights: str

    def summary(self) -> dict[str, Any]:
        """Return the result as values that JSON can carry."""
        return {**super().summary(), "heights": self.heights}

    def lines(self) -> list[str]:
        """Return the result as lines of text."""
        return [*super().lines(), self.heights]


@tool(
    title="Orthorectify",
    group="Sensor models",
    outputs=SIZE_OUTPUTS,
)
def orthorectify(
    image: sensor.SensorImage,
    output: Annotated[
        Path,
        RasterOut(
            label="Orthoimage",
            help="GeoTIFF with the image's bands, data type, nodata value, colours and metadata. "
            + general.COG_HELP,
            like="image",
        ),
    ],
    dem: sensor.Dem = None,
    dem_datum: sensor.DemDatum = None,
    reference: Annotated[Path | None, general.like_reference("image")] = None,
    pixel_size: Annotated[
        float | None, general.pixel_size_of_result("; by default that of the image on the ground")
    ] = None,
    crs: Annotated[
        str | None,
        Crs(
            label="CRS",
            help="CRS of the result, as EPSG:32632; by default the UTM zone of the image.",
        ),
    ] = None,
    height: sensor.Height = None,
    geoid: sensor.Geoid = None,
    dem_cover: sensor.DemCover = 0.0,
    rpc: sensor.RpcFile = None,
    resampling: general.Resampling = "cubic",
    workers: general.Workers = None,
    progress: Progress = SILENT,
) -> OrthoResult:
    """Orthorectify an image by its RPCs and a terrain model.

    Every pixel of the map is looked up in the image where the RPCs see the ground at the height
    that the terrain model has there. All bands are resampled once. Pixels that the image does not
    see, or whose height is not known, hold no data. Places that others hide, as behind houses in a
    surface model, show what hides them.
    """
    if reference is not None and (pixel_size is not None or crs is not None):
        raise ParameterError("give either a reference, which has CRS and pixel size, or these")
    ground = Ground(dem, dem_datum, geoid, height, dem_cover / 100)
    with threads(workers, progress) as context, ExitStack() as stack:
        source, model = open_sensor_image(image, rpc, stack)
        grid, map_crs = None, _crs(crs)
        if reference is not None:
            like = stack.enter_context(open_raster(reference))
            grid, map_crs = like.grid, require_crs(like)
        oriented = ground.orient(source, model, map_crs, stack, progress)
        staged = stack.enter_context(Outputs()).stage(output)
        target = write_orthoimage(oriented, staged, context, grid, pixel_size, resampling)
    return OrthoResult(output, target, oriented.heights)


def _crs(text: str | None) -> CRS | None:
    try:
        return None if text is None else require_map(CRS.from_user_input(text))
    except (CRSError, ValueError) as error:
        raise ParameterError(f"crs is not understood: {text}") from error
