"""Register two images without choosing how: the images decide."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from ..declaration import tool
from ..progress import SILENT, Progress
from ..registration.automatic import OrthorectifiedRpc, register_anything
from ..registration.registration import Registration
from .common import (
    Input,
    InputBand,
    OptionalGeoTiff,
    Reference,
    ReferenceBand,
    TransformOut,
    Workers,
)
from .registration_parameters import (
    OUTPUTS,
    InputDem,
    InputMask,
    InputMaskValues,
    MaxError,
    ReferenceMask,
    ReferenceMaskValues,
    ReportOut,
    TerrainView,
    TiePointsOut,
)
from .sensor_parameters import Dem, DemDatum


@tool(title="Register images", group="Registration", outputs=OUTPUTS)
def register(
    reference: Reference,
    input: Input,
    output: OptionalGeoTiff = None,
    max_error: MaxError = 3.0,
    dem: Dem = None,
    dem_datum: DemDatum = None,
    input_dem: InputDem = None,
    views: TerrainView = None,
    tie_points: TiePointsOut = None,
    transform: TransformOut = None,
    report: ReportOut = None,
    reference_band: ReferenceBand = None,
    input_band: InputBand = None,
    reference_mask: ReferenceMask = None,
    reference_mask_values: ReferenceMaskValues = None,
    input_mask: InputMask = None,
    input_mask_values: InputMaskValues = None,
    workers: Workers = None,
    progress: Progress = SILENT,
    parameters: Mapping[str, Any] = MappingProxyType({}),
) -> Registration | OrthorectifiedRpc:
    """Register an image to another one of the same place; the images decide how.

    Radar images, a camera's images and pairs of both are matched as match_sar_sar, match_optical
    and `coregister` do; if that is refused, another way that makes sense is tried, and rotation and
    scale are searched for. An image with RPCs has them refined, and is orthorectified, by a
    terrain model if one is given; what wrong heights displace another one by is taken out by it, if
    the points justify that. The result names what was tried, and why; the probability of
    agreement by chance counts all of it. A refused registration writes no image.
    """
    return register_anything(parameters, progress)
