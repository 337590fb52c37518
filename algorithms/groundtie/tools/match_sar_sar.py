"""Register a SAR image to another one: mutual information and SIFT together ([Suri2010] 6.9)."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from ..declaration import tool
from ..matching.surface_fit import AUTO
from ..progress import SILENT, Progress
from ..registration.delivery import register_as
from ..registration.registration import Registration
from ..registration.specification import SAR_SAR
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


@tool(title="Match SAR with SAR", group="Registration", outputs=OUTPUTS)
def match_sar_sar(
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
