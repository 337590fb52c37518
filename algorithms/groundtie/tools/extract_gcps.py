"""Extract ground control for an image with RPCs from a reference image and a terrain model."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from ..declaration import NO_VALUES, Output, Values, tool
from ..geometry.judging import USUAL_MAX_ERROR_PX
from ..kinds import VectorOut
from ..progress import SILENT, Progress
from ..registration.sensor_jobs import GcpResult, extract_control
from ..sensor.control_points import SUFFIXES
from .parameters import general, registration, sensor


@tool(
    title="Extract ground control",
    group="Sensor models",
    outputs=(
        Output("POINTS", "Number of points that are used", "points_used"),
        Output("CHECK_RMSE_PX", "Error at check points (px)", "verdict.check_rmse_px"),
    ),
)
def extract_gcps(
    image: sensor.SensorImage,
    reference: general.Reference,
    output: Annotated[
        Path,
        VectorOut(
            label="Ground control points",
            help="Points with position in the image and on the map, height, covariance and scores; "
            ".txt holds options of gdal_translate.",
            suffixes=SUFFIXES,
        ),
    ],
    dem: sensor.Dem = None,
    dem_datum: sensor.DemDatum = None,
    search_radius: sensor.RpcSearchRadius = None,
    max_error: registration.MaxError = USUAL_MAX_ERROR_PX,
    height: sensor.Height = None,
    geoid: sensor.Geoid = None,
    dem_cover: sensor.DemCover = 0.0,
    rpc: sensor.RpcFile = None,
    image_band: sensor.ImageBand = None,
    image_mask: sensor.ImageMask = None,
    reference_band: general.ReferenceBand = None,
    reference_mask: registration.ReferenceMask = None,
    mask_values: registration.MaskValues = None,
    surface_model: registration.SurfaceModel = None,
    views: registration.SurfaceViews = None,
    matching_pixel_size: general.MatchingPixelSize = None,
    workers: general.Workers = None,
    progress: Progress = SILENT,
    parameters: Values = NO_VALUES,
) -> GcpResult:
    """Extract ground control for an image with RPCs from a reference image and a terrain model.

    The image is projected onto the reference's map by its RPCs and matched there as `coregister`
    does; what is found is carried back into the image. A coarse error of the RPCs within the search
    radius is found first. Held-out points decide whether the points can be trusted; if not,
    nothing is written.
    """
    return extract_control(parameters, progress)
