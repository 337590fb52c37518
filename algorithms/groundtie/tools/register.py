"""Register two images without choosing how: the images decide."""

from __future__ import annotations

from ..declaration import NO_VALUES, Values, tool
from ..geometry.judging import USUAL_MAX_ERROR_PX
from ..progress import SILENT, Progress
from ..registration.automatic import register_anything
from ..registration.refinement import RefinedRpc
from ..registration.registration import Registration
from .parameters import general, registration, sensor


@tool(title="Register images", group="Registration", outputs=registration.OUTPUTS)
def register(
    reference: general.Reference,
    input: general.Input,
    output: general.OptionalGeoTiff = None,
    max_error: registration.MaxError = USUAL_MAX_ERROR_PX,
    dem: sensor.Dem = None,
    dem_datum: sensor.DemDatum = None,
    input_dem: registration.InputDem = None,
    views: registration.TerrainView = None,
    tie_points: registration.TiePointsOut = None,
    transform: general.TransformOut = None,
    report: registration.ReportOut = None,
    displacement: registration.DisplacementOut = None,
    reference_band: general.ReferenceBand = None,
    input_band: general.InputBand = None,
    reference_mask: registration.ReferenceMask = None,
    input_mask: registration.InputMask = None,
    mask_values: registration.MaskValues = None,
    workers: general.Workers = None,
    progress: Progress = SILENT,
    parameters: Values = NO_VALUES,
) -> Registration | RefinedRpc:
    """Register an image to another one of the same place; the images decide how.

    Radar images, a camera's images and pairs of both are matched as match_sar_sar, match_optical
    and `coregister` do; if that is refused, another way that makes sense is tried, and rotation and
    scale are searched for. If the input has RPCs, they are refined and the input is
    orthorectified, with the terrain model if one is given. For other inputs, the terrain model
    serves to remove displacements by wrong heights, if the points justify that. The result names
    what was tried, and why; the probability of agreement by chance counts all of it. A refused
    registration writes no image.
    """
    return register_anything(parameters, progress)
