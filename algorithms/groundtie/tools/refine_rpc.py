"""Refine the RPCs of an image by ground control, given or matched in a reference image."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from ..declaration import NO_VALUES, Output, Values, tool
from ..geometry.judging import USUAL_MAX_ERROR_PX
from ..kinds import AUTO, Choice, FileIn, FileOut, RasterIn, VectorOut
from ..progress import SILENT, Progress
from ..raster_names import GEOTIFF
from ..registration.refinement import RefinedRpc
from ..registration.sensor_jobs import refine
from ..sensor.bias import KINDS
from ..sensor.control_points import READ_SUFFIXES, SUFFIXES
from ..sensor.rpc_files import SUFFIXES as RPC_SUFFIXES
from .parameters import general, registration, sensor


@tool(
    title="Refine RPCs",
    group="Sensor models",
    outputs=(
        Output("CHECK_RMSE_PX", "Error at held-out points (px)", "verdict.check_rmse_px"),
        Output("BEFORE_RMSE_PX", "Error before (px)", "verdict.before.rmse_px"),
        Output("MODEL", "Model of the bias", "bias.model", text=True),
        Output("REASON", "Reason of the verdict", "verdict.reason", text=True),
    ),
)
def refine_rpc(
    image: sensor.SensorImage,
    output: Annotated[
        Path,
        FileOut(
            label="Refined RPCs",
            help="The RPCs alone, as _RPC.TXT or .RPB, or a copy of the image (.tif) with them.",
            suffixes=(*RPC_SUFFIXES, *GEOTIFF),
        ),
    ],
    reference: Annotated[
        Path | None,
        RasterIn(
            label="Reference image",
            help="The image, above all a SAR one, whose georeferencing is right: ground control "
            "is matched in it.",
        ),
    ] = None,
    gcps: Annotated[
        Path | None,
        FileIn(
            label="Ground control points",
            help="Points of extract_gcps or of a person, in place of a reference; also orthority's "
            "GeoJSON, a raster or VRT with GCPs of GDAL, and ENVI's .pts.",
            suffixes=READ_SUFFIXES,
        ),
    ] = None,
    dem: sensor.Dem = None,
    dem_datum: sensor.DemDatum = None,
    model: Annotated[
        str,
        Choice(
            label="Model of the bias",
            help="What is taken out in the image: a shift, a shift that drifts along the rows, or "
            "an affine change; auto takes the simplest that the points justify and carry.",
            choices=(AUTO, *KINDS),
        ),
    ] = AUTO,
    search_radius: sensor.RpcSearchRadius = None,
    max_error: registration.MaxError = USUAL_MAX_ERROR_PX,
    residuals: Annotated[
        Path | None,
        VectorOut(
            help="The points with lines from where the refined RPCs see them on the map to where "
            "they are.",
            suffixes=SUFFIXES[:3],
            shown=True,
        ),
    ] = None,
    report: Annotated[
        Path | None,
        general.report_page(
            "A page that shows errors before and after and how far to trust them",
            "refused RPCs",
            advanced=True,
        ),
    ] = None,
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
) -> RefinedRpc:
    """Refine the RPCs of an image by ground control, given or matched in a reference image.

    The bias of the RPCs is estimated in the image, by least squares weighted with the points'
    covariances, without the blunders among them, and folded into new RPCs. They are refused, and
    nothing is written, if points that took no part are not nearer than before, if these do not
    agree, or if the points do not determine the model all over the image.
    """
    return refine(parameters, progress)
