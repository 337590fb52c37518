"""Register optical images to one another by keypoints and chips ([Patel2017] chapters 4, 5)."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from ..declaration import tool
from ..matching.surface_fit import AUTO
from ..progress import SILENT, Progress
from ..registration.delivery import register_as
from ..registration.registration import Registration
from ..registration.specification import OPTICAL
from .common import (
    Input,
    InputBand,
    MatchingPixelSize,
    OptionalOutput,
    Reference,
    ReferenceBand,
    TransformOut,
    Workers,
)
from .registration_parameters import (
    OUTPUTS,
    DisplacementOut,
    InputMask,
    InputMaskValues,
    Mask,
    MaxError,
    Model,
    OutputGrid,
    ReferenceMask,
    ReferenceMaskValues,
    ReportOut,
    SearchRadius,
    SearchRotation,
    TiePointsOut,
)


@tool(title="Match optical images", group="Registration", outputs=OUTPUTS)
def match_optical(
    reference: Reference,
    input: Input,
    output: OptionalOutput = None,
    search_radius: SearchRadius = None,
    search_rotation: SearchRotation = None,
    model: Model = AUTO,
    max_error: MaxError = 3.0,
    tie_points: TiePointsOut = None,
    transform: TransformOut = None,
    report: ReportOut = None,
    displacement: DisplacementOut = None,
    reference_band: ReferenceBand = None,
    input_band: InputBand = None,
    reference_mask: ReferenceMask = None,
    reference_mask_values: ReferenceMaskValues = None,
    input_mask: InputMask = None,
    input_mask_values: InputMaskValues = None,
    mask: Mask = AUTO,
    matching_pixel_size: MatchingPixelSize = None,
    output_grid: OutputGrid = "reference",
    workers: Workers = None,
    progress: Progress = SILENT,
    parameters: Mapping[str, Any] = MappingProxyType({}),
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
