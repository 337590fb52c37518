"""Co-register two images of the same place, above all a SAR and an optical one."""

from __future__ import annotations

from ..declaration import NO_VALUES, Values, tool
from ..geometry.judging import USUAL_MAX_ERROR_PX
from ..kinds import AUTO
from ..progress import SILENT, Progress
from ..registration.delivery import register_as
from ..registration.registration import Registration
from ..registration.specification import COREGISTER
from .parameters import general, registration


@tool(title="Co-register images", group="Registration", outputs=registration.OUTPUTS)
def coregister(
    reference: general.Reference,
    input: general.Input,
    output: general.OptionalOutput = None,
    search_radius: registration.SearchRadius = None,
    search_rotation: registration.SearchRotation = None,
    model: registration.Model = AUTO,
    max_error: registration.MaxError = USUAL_MAX_ERROR_PX,
    tie_points: registration.TiePointsOut = None,
    transform: general.TransformOut = None,
    report: registration.ReportOut = None,
    displacement: registration.DisplacementOut = None,
    reference_band: general.ReferenceBand = None,
    input_band: general.InputBand = None,
    reference_mask: registration.ReferenceMask = None,
    input_mask: registration.InputMask = None,
    mask_values: registration.MaskValues = None,
    dem: registration.TerrainDem = None,
    input_dem: registration.InputDem = None,
    surface_model: registration.SurfaceModel = None,
    views: registration.ImageViews = None,
    matching_pixel_size: general.MatchingPixelSize = None,
    output_grid: registration.OutputGrid = "reference",
    workers: general.Workers = None,
    progress: Progress = SILENT,
    parameters: Values = NO_VALUES,
) -> Registration:
    """Co-register two images of the same place, above all a SAR and an optical one.

    A coarse shift is searched for within the search radius, tie points are matched in chips, and a
    robust model is fitted to them. Parts of the reference are held out of all of this; points in
    them decide whether the registration is accepted. A refused registration writes no image.

    With a terrain model, what wrong heights displace the input by is taken out, too.

    The input's pixels are resampled once, by the whole transform. Images without georeferencing
    are matched in pixel coordinates; distances are then in pixels.
    """
    return register_as(COREGISTER, parameters, progress)
