"""Register a SAR image to another one: mutual information and SIFT together ([Suri2010] 6.9)."""

from __future__ import annotations

from ..declaration import NO_VALUES, Values, tool
from ..geometry.judging import USUAL_MAX_ERROR_PX
from ..kinds import AUTO
from ..progress import SILENT, Progress
from ..registration.delivery import register_as
from ..registration.registration import Registration
from ..registration.specification import SAR_SAR
from .parameters import general, registration


@tool(title="Match SAR with SAR", group="Registration", outputs=registration.OUTPUTS)
def match_sar_sar(
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
    matching_pixel_size: general.MatchingPixelSize = None,
    output_grid: registration.OutputGrid = "reference",
    workers: general.Workers = None,
    progress: Progress = SILENT,
    parameters: Values = NO_VALUES,
) -> Registration:
    """Register a SAR image to another one: other sensor, incidence angle, orbit or date.

    A coarse shift is searched for on reduced images; SIFT keypoints are matched near where it puts
    them, and refined by mutual information in chips around them; a robust model is fitted. Parts
    of the reference are held out of all of this; points in them decide whether the registration
    is accepted. A refused registration writes no image.

    Give a mask of level ground where there are high buildings or hills: layover displaces them.
    Images without georeferencing are matched in pixel coordinates and may have any rotation;
    distances are then in pixels.
    """
    return register_as(SAR_SAR, parameters, progress)
