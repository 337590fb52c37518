"""Parameters of tools, most of them of several, declared once."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from ...context import MOST_WORKERS
from ...kinds import Band, Choice, Distance, FileOut, Number, RasterIn, RasterOut, Text
from ...rasters.warping import METHODS

Reference = Annotated[
    Path, RasterIn(label="Reference image", help="The image whose georeferencing is right.")
]
Input = Annotated[Path, RasterIn(label="Input image", help="The image to be registered.")]
COG_HELP = "A name that ends in .cog.tif makes it a Cloud Optimized GeoTIFF."
MASK_HELP = (
    "A raster whose zeros take no part, a vector layer of what takes part (polygons, and "
    "lines as 11 m wide), or a classifier of train_feature_classifier (.json)."
)
_GEOTIFF = RasterOut(
    label="Registered image",
    help="GeoTIFF with the input's bands, data type, nodata value, colours and metadata. "
    + COG_HELP,
    like="input",
)
_OR_VRT = replace(
    _GEOTIFF,
    help=f"{_GEOTIFF.help} A .vrt, for a shift alone, puts the input's own file in its right "
    "place: no pixel is written.",
    suffixes=(*_GEOTIFF.suffixes, ".vrt"),
)
Output = Annotated[Path, _OR_VRT]
OptionalOutput = Annotated[Path | None, replace(_OR_VRT, optional_in_python=True)]
OptionalGeoTiff = Annotated[Path | None, replace(_GEOTIFF, optional_in_python=True)]
Resampling = Annotated[
    str,
    Choice(
        help="How values between the input's pixels are found. Where output pixels are larger "
        "than 1.5 input pixels, the mean of the area is taken first, but for nearest. Images "
        "with a palette are always resampled by nearest.",
        choices=METHODS,
        advanced=True,
    ),
]
_THREADS = Number(
    help="Number of threads; by default one per processor.",
    integer=True,
    minimum=1,
    maximum=MOST_WORKERS,
    common=True,
)
Workers = Annotated[int | None, _THREADS]
_ROWS_HELP = "Number of rows that run at the same time; by default one per processor."
RowWorkers = Annotated[int | None, replace(_THREADS, help=_ROWS_HELP, common=False)]
Scheduler = Annotated[
    str | None,
    Text(
        help="Address of a Dask scheduler, as tcp://host:8786, whose workers do the work instead.",
        advanced=True,
    ),
]

Seed = Annotated[
    int,
    Number(
        help="Seed of random samples: the same seed gives the same result.",
        integer=True,
        minimum=0,
        maximum=2**31 - 1,
        advanced=True,
    ),
]

MATCHED_BAND = Band(
    label="Band of the reference",
    help="The band that is matched; by default the mean of all bands.",
    of="reference",
    advanced=True,
)
ReferenceBand = Annotated[int | None, MATCHED_BAND]
_INPUT_BAND_HELP = f"{MATCHED_BAND.help} A registered image has all bands."
InputBand = Annotated[
    int | None,
    replace(MATCHED_BAND, label="Band of the input", help=_INPUT_BAND_HELP, of="input"),
]
MatchingPixelSize = Annotated[
    float | None,
    Distance(
        label="Pixel size for matching",
        help="Pixel size at which the images are compared; by default that of the coarser image, "
        "twice that for a radar image and a terrain model.",
        minimum=1e-6,
        advanced=True,
    ),
]
Radar = Annotated[Path, RasterIn(label="Radar image", help="A SAR image, as amplitude or complex.")]
_RADAR_BAND_HELP = "The band that is looked at; by default the mean of all bands."
RadarBand = Annotated[
    int | None, replace(MATCHED_BAND, label="Band", help=_RADAR_BAND_HELP, of="input")
]
MaskOut = Annotated[
    Path,
    RasterOut(label="Mask", help="GeoTIFF that is 1 where pixels take part and 0 elsewhere."),
]
HighPercent = Annotated[
    float,
    Number(
        label="Brightest part masked",
        help="Share that takes no part: strong scatterers as walls and corners. Means over "
        "4 × 4 pixels are compared.",
        unit="%",
        minimum=0,
        maximum=90,
        advanced=True,
    ),
]
LowPercent = Annotated[
    float,
    Number(
        label="Darkest part masked",
        help="Share of the radar image that takes no part because it is dark: radar shadow, but "
        "roads and water, too.",
        unit="%",
        minimum=0,
        maximum=90,
        advanced=True,
    ),
]
MaskWidth = Annotated[
    float,
    Distance(
        label="Width of lines",
        help="Window by which skeletons of long regions are broadened.",
        minimum=0.1,
        maximum=500,
        advanced=True,
    ),
]
MaskGrowth = Annotated[
    float,
    Distance(
        label="Growth of what is masked",
        help="What lies within this distance of masked pixels takes no part either.",
        maximum=200,
        advanced=True,
    ),
]
TransformOut = Annotated[
    Path | None,
    FileOut(
        help="The transform, for the tool warp or a script.",
        suffixes=(".json",),
    ),
]


def report_page(shows: str, refused: str, *, advanced: bool = False) -> FileOut:
    """Return the kind of a report, beside which its numbers are put."""
    return FileOut(
        help=f"{shows}; its numbers are put beside it as JSON. It is written for {refused}, too.",
        suffixes=(".html",),
        numbers=True,
        advanced=advanced,
        shown=True,
    )


def picture(help: str) -> FileOut:
    """Return the kind of a picture to look at."""
    return FileOut(help=help, suffixes=(".png",))


def like_reference(otherwise: str) -> RasterIn:
    """Return the kind of the raster whose grid the result gets."""
    help = "The result gets exactly the grid of this raster, so that the two stack. By default the "
    return RasterIn(label="Reference image", help=f"{help}result covers all of the {otherwise}.")


def pixel_size_of_result(otherwise: str) -> Distance:
    """Return the kind of the result's pixel size."""
    return Distance(help=f"Pixel size of the result{otherwise}.", minimum=1e-6)
