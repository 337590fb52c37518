"""Parameters of tools that register, declared once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from ...declaration import Output
from ...geometry.models import KINDS
from ...geometry.tie_point_files import SUFFIXES
from ...kinds import (
    AUTO,
    Choice,
    Distance,
    MaskIn,
    Number,
    RasterIn,
    RasterOut,
    SurfaceIn,
    Text,
    VectorOut,
    Views,
)
from ...registration.registered_output import OUTPUT_GRIDS
from .general import MASK_HELP, report_page

Model = Annotated[
    str,
    Choice(
        help="Which misregistration is taken out; auto takes the simplest model that the "
        "points justify.",
        choices=(AUTO, *KINDS),
    ),
]
MaxError = Annotated[
    float,
    Number(
        label="Largest error",
        help="The registration is refused if its root mean square error at check points, "
        "which take no part in the fit, is larger.",
        unit="px",
        minimum=0.1,
        maximum=100,
    ),
]
TiePointsOut = Annotated[
    Path | None,
    VectorOut(
        help="Lines from where a point of the input nominally lies to where it is.",
        suffixes=SUFFIXES,
        shown=True,
    ),
]
DisplacementOut = Annotated[
    Path | None,
    RasterOut(
        help="GeoTIFF of three bands over the overlap: by how much the input is moved to the east "
        "and to the north, and the standard deviation of that; in metres, without georeferencing "
        "in pixels to the right and down.",
        advanced=True,
    ),
]
ReportOut = Annotated[
    Path | None,
    report_page("A page that shows the result and how far to trust it", "a refused registration"),
]
SearchRadius = Annotated[
    float | None,
    Distance(
        help="How far the input may lie from its right place. By default 100 m or 20 pixels of "
        "the coarser image, whichever is larger; match_sar_sar and match_optical search a quarter "
        "of the input's longer side where there is no georeferencing. No hard limit: finer stages "
        "look some 20 pixels further, those of images reduced to 512 pixels where they are larger.",
    ),
]
SearchRotation = Annotated[
    float | None,
    Number(
        label="Largest rotation",
        help="How far the input may be rotated, either way, against its nominal geotransform. By "
        "default not at all; match_sar_sar and match_optical search any rotation where there is "
        "no georeferencing.",
        unit="°",
        minimum=0,
        maximum=180,
    ),
]
ReferenceMask = Annotated[
    Path | None, MaskIn(label="Mask of the reference", help=MASK_HELP, advanced=True)
]
InputMask = Annotated[Path | None, MaskIn(label="Mask of the input", help=MASK_HELP, advanced=True)]
_MASK_VALUES = (
    "What of a mask takes no part: values as 3,8-10; scl, qa-pixel, fmask, hls-fmask or udm2 for "
    "clouds and their shadows in these missions' masks; inside for a vector layer of what takes no "
    "part. By default 0, and what lies outside of a layer. Without a mask one is taken that lies "
    "beside the image by the mission's names; none takes none."
)
ReferenceMaskValues = Annotated[
    str | None,
    Text(label="Values of the reference's mask", help=_MASK_VALUES, advanced=True),
]
MaskValues = Annotated[
    str | None,
    Text(
        label="Values of the masks",
        help=f"{_MASK_VALUES} With two masks that differ, those of the reference first, as in "
        "'1; scl'.",
        advanced=True,
    ),
]
TerrainDem = Annotated[
    Path | None,
    RasterIn(
        label="Terrain model",
        help="Heights of the ground, in any CRS. Where the input was orthorectified with others, "
        "or with one height, it is displaced in proportion to the difference: model auto may "
        "take this out, too, if the points justify it.",
        advanced=True,
    ),
]
InputDem = Annotated[
    Path | None,
    RasterIn(
        label="Terrain model of the input",
        help="The heights that the input was orthorectified with; by default, one height "
        "everywhere. Goes with a terrain model.",
        advanced=True,
    ),
]
SURFACE_HEIGHTS = (
    "Heights of roofs, canopies and ground (DSM), or a vector layer of buildings with a field "
    "height in metres."
)
SURFACE_MODEL = SurfaceIn(
    help=f"{SURFACE_HEIGHTS} Only ground that both images show takes part: no layover, radar "
    "shadow, relief displacement or cast shadow. Needs the views of both images.",
    advanced=True,
)
SurfaceModel = Annotated[Path | None, SURFACE_MODEL]
_VIEWS = (
    "From where both images were taken, for the surface model: STAC items or products' metadata "
    "(.json, .xml, .imd), or words, that "
    "of the reference first, as in 'radar azimuth=280 incidence=35; camera azimuth=250 "
    "incidence=12 sun-azimuth=155 sun-elevation=48'. Azimuths from the ground to the sensor or "
    "sun, clockwise from north, incidence from the vertical. By default what lies beside each "
    "image: a STAC item of its own name, or its product's metadata."
)
_TERRAIN_VIEW = (
    "If the reference is a terrain model, how it is rendered: 'terrain sun azimuth=155' for a "
    "camera's image, 'terrain radar' for a radar's; without azimuth a radar stands in the west, "
    "and register tries azimuths. If it is a surface model of a town, 'surface radar azimuth=280 "
    "incidence=35' for a radar image; 'surface radar' takes these from the input's metadata."
)
ImageViews = Annotated[str | None, Views(help=f"{_VIEWS} {_TERRAIN_VIEW}", advanced=True)]
SurfaceViews = Annotated[str | None, Views(help=_VIEWS, advanced=True)]
TerrainView = Annotated[str | None, Views(label="View", help=_TERRAIN_VIEW, advanced=True)]
OutputGrid = Annotated[
    str,
    Choice(
        help="Grid of the registered image: the reference's pixels exactly, so that both "
        "stack; pixels like the input's own; or, for a pure shift, the input's untouched "
        "pixels with a corrected geotransform. The last two reach beyond the overlap, where "
        "nothing has checked the transform.",
        choices=OUTPUT_GRIDS,
        advanced=True,
    ),
]

# What a registration returns to QGIS models.
OUTPUTS = (
    Output("CHECK_RMSE_PX", "Error at check points (px)", "verdict.check_rmse_px"),
    Output("CE90_M", "CE90 of the transform (m)", "verdict.ce90_m"),
    Output("POINTS", "Number of tie points", "verdict.points"),
    Output("REASON", "Reason of the verdict", "verdict.reason", text=True),
)
