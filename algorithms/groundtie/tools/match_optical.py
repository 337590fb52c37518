"""Register optical images to one another by keypoints and chips ([Patel2017] chapters 4, 5)."""

from __future__ import annotations

from ..declaration import NO_VALUES, Values, tool
from ..geometry.judging import USUAL_MAX_ERROR_PX
from ..kinds import AUTO
from ..progress import SILENT, Progress
from ..registration.delivery import register_as
from ..registration.registration import Registration
from ..registration.specification import OPTICAL
from .parameters import general, registration


@tool(title="Match optical images", group="Registration", outputs=registration.OUTPUTS)
def match_optical(
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
    """Register optical images to one another: other bands, dates or sensors, day and night.

    A coarse shift is searched for on reduced images; keypoints are matched near where it puts
    them, and chips all over the images near where the model of the keypoints does; the final model
    is fitted to the chips. Parts of the reference are held out of all of this; points in them
    decide whether the registration is accepted. A refused registration writes no image.

    Images without georeferencing are matched in pixel coordinates and may have any rotation and
    a scale of up to 2; distances are then in pixels.
    """
    return register_as(OPTICAL, parameters, progress)
