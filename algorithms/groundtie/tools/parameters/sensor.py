"""Parameters of the tools for images with RPCs, declared once."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from ...kinds import Choice, Distance, FileIn, MaskIn, Number, RasterIn
from ...sensor.geoids import DATUMS
from ...sensor.rpc_files import READ_SUFFIXES
from .general import MASK_HELP, MATCHED_BAND

SensorImage = Annotated[
    Path,
    RasterIn(
        label="Image with RPCs",
        help="An image in the geometry of its sensor. Its RPCs are in its tags or in a file beside "
        "it that GDAL finds (_RPC.TXT, .RPB, DIMAP).",
    ),
]
Dem = Annotated[
    Path | None,
    RasterIn(
        label="Terrain model",
        help="Heights of the ground, in any CRS; voids are filled from their rims. Without it, "
        "one height holds everywhere.",
    ),
]
DemDatum = Annotated[
    str | None,
    Choice(
        label="Vertical datum",
        help="What the heights of the terrain model count from: the ellipsoid, as RPCs do, or a "
        "geoid (SRTM: EGM96; Copernicus: EGM2008). Taking one for the other moves heights by "
        "up to 100 m.",
        choices=DATUMS,
    ),
]
Geoid = Annotated[
    Path | None,
    RasterIn(
        label="Geoid grid",
        help="Heights of another geoid above the ellipsoid, in place of a vertical datum by name.",
        advanced=True,
    ),
]
DemCover = Annotated[
    float,
    Number(
        label="Least cover of the terrain model",
        help="Share of the image whose heights the terrain model must know; where it does not know "
        "them, there is no data.",
        unit="%",
        minimum=0,
        maximum=100,
        advanced=True,
    ),
]
Height = Annotated[
    float | None,
    Number(
        help="Height above the ellipsoid that holds everywhere without a terrain model; by "
        "default the RPCs' own.",
        unit="m",
        minimum=-1000,
        maximum=10_000,
        advanced=True,
    ),
]
RpcFile = Annotated[
    Path | None,
    FileIn(
        label="RPC file",
        help="RPCs to use in place of the image's own: _RPC.TXT, .RPB or the RPC XML of DIMAP 2 "
        "and 3.",
        suffixes=READ_SUFFIXES,
        advanced=True,
    ),
]
RpcSearchRadius = Annotated[
    float | None,
    Distance(
        help="How far the RPCs may be wrong on the ground. By default 100 m or 20 pixels of the "
        "coarser image, whichever is larger. No hard limit: finer stages look some 20 pixels "
        "further, those of images reduced to 512 pixels where they are larger.",
    ),
]
ImageBand = Annotated[int | None, replace(MATCHED_BAND, label="Band of the image", of="image")]
ImageMask = Annotated[Path | None, MaskIn(label="Mask of the image", help=MASK_HELP, advanced=True)]
