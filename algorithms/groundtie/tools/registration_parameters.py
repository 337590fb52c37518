"""Parameters that registering tools share, declared once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from ..declaration import Output
from ..geometry.models import KINDS
from ..kinds import Choice, FileOut, Number, VectorOut
from ..matching.local import AUTO
from ..registration.registered_output import OUTPUT_GRIDS
from ..studies.pose_searches import SEARCHES

Model = Annotated[
    str,
    Choice(
        label="Model",
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
        label="Tie points",
        help="Lines from where the input claims a point to be to where it is.",
        suffixes=(".gpkg", ".geojson", ".csv", ".points"),
    ),
]
ReportOut = Annotated[
    Path | None,
    FileOut(
        label="Report",
        help="A page that shows the result and how far to trust it; its numbers are put "
        "beside it as JSON. It is written for a refused registration, too.",
        suffixes=(".html",),
    ),
]
Search = Annotated[
    str,
    Choice(
        label="Rough search",
        help="What finds the rough position on a reduced image. By default all shifts are "
        "tried, and rotation-steps where a rotation or scale is searched for.",
        choices=(AUTO, *SEARCHES),
        advanced=True,
    ),
]
SearchScale = Annotated[
    float,
    Number(
        label="Largest scale",
        help="By which factor the input may be larger or smaller than it claims.",
        minimum=1,
        maximum=4,
        advanced=True,
    ),
]
OutputGrid = Annotated[
    str,
    Choice(
        label="Output grid",
        help="Grid of the registered image: the reference's pixels exactly, so that both "
        "stack; pixels like the input's own; or, for a pure shift, the input's untouched "
        "pixels with a corrected geotransform.",
        choices=OUTPUT_GRIDS,
        advanced=True,
    ),
]

# What a registration tells QGIS models.
OUTPUTS = (
    Output("CHECK_RMSE_PX", "Error at check points (px)", "verdict.check_rmse_px"),
    Output("CHECK_CE90_M", "CE90 at check points (m)", "verdict.check_ce90_m"),
    Output("POINTS", "Number of tie points", "verdict.points"),
    Output("REASON", "Reason of the verdict", "verdict.reason", text=True),
)
