"""Co-register two images of the same place, above all a SAR and an optical one."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from ..declaration import tool
from ..matching.surface_fit import AUTO
from ..progress import SILENT, Progress
from ..registration.delivery import register_as
from ..registration.registration import Registration
from ..registration.specification import COREGISTER
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
    InputDem,
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
    SurfaceModel,
    TerrainDem,
    TiePointsOut,
    Views,
)


@tool(title="Co-register images", group="Registration", outputs=OUTPUTS)
def coregister(
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
    dem: TerrainDem = None,
    input_dem: InputDem = None,
    surface_model: SurfaceModel = None,
    views: Views = None,
    matching_pixel_size: MatchingPixelSize = None,
    output_grid: OutputGrid = "reference",
    workers: Workers = None,
    progress: Progress = SILENT,
    parameters: Mapping[str, Any] = MappingProxyType({}),
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
