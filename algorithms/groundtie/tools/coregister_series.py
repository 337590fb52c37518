"""Register the dates of a series to one reference, or to each other."""

from __future__ import annotations

from concurrent.futures import Executor
from pathlib import Path
from typing import Annotated, Any

from ..declaration import NO_VALUES, Output, Values, tool
from ..geometry.judging import USUAL_MAX_ERROR_PX
from ..kinds import AUTO, Choice, FolderOut, Number, RasterIn, RastersIn, Text
from ..matching.alignment import LINEAR_CANDIDATES
from ..progress import SILENT, Progress
from ..series.call import SeriesCall
from ..series.delivery import TABLE_CSV, TABLE_GPKG
from ..series.series import Series
from ..series.stored import SERIES_JSON
from .parameters import general, registration


@tool(
    title="Co-register a series",
    group="Registration",
    outputs=(
        Output("REGISTERED", "Dates that were registered", "verdict.registered"),
        Output("LEFT_OUT", "Dates that were left out", "verdict.left_out"),
        Output("LOOP_ERROR_PX", "Median error of loops (px)", "loops.median_px"),
    ),
)
def coregister_series(
    output_folder: Annotated[
        Path,
        FolderOut(
            help="Registered dates, series.csv, series.gpkg and series.json; what it holds of an "
            "earlier run with the same files and parameters is not done again.",
            writes=(SERIES_JSON, TABLE_CSV, TABLE_GPKG),
        ),
    ],
    inputs: Annotated[
        tuple[Any, ...],
        RastersIn(
            label="Dates",
            help="Images of one place: files, folders, patterns, CSV tables with a column file, "
            "STAC items (.json).",
        ),
    ],
    reference: Annotated[
        Path | None,
        RasterIn(
            label="Reference image",
            must_have_name=True,
            help="The image whose georeferencing is right; without one the mean displacement of "
            "all dates is zero.",
        ),
    ] = None,
    search_radius: registration.SearchRadius = None,
    model: Annotated[
        str,
        Choice(
            help="Which misregistration is taken out of each date; auto takes for each pair the "
            "simplest that the points justify.",
            choices=(AUTO, *LINEAR_CANDIDATES),
        ),
    ] = AUTO,
    max_error: registration.MaxError = USUAL_MAX_ERROR_PX,
    report: registration.ReportOut = None,
    band: Annotated[
        int | None,
        Number(
            help="The band that is matched, from 1; by default the mean of all bands. Registered "
            "images have all bands.",
            integer=True,
            minimum=1,
            advanced=True,
        ),
    ] = None,
    asset: Annotated[
        str | None,
        Text(
            help="Which asset of STAC items is meant; by default the only one that is a raster.",
            advanced=True,
        ),
    ] = None,
    reference_mask: registration.ReferenceMask = None,
    reference_mask_values: registration.ReferenceMaskValues = None,
    matching_pixel_size: general.MatchingPixelSize = None,
    output_grid: registration.OutputGrid = "reference",
    resampling: general.Resampling = "cubic",
    workers: general.Workers = None,
    scheduler: general.Scheduler = None,
    progress: Progress = SILENT,
    executor: Executor | None = None,
    parameters: Values = NO_VALUES,
) -> Series:
    """Register the dates of a series to one reference, or to each other.

    Every date is registered to the reference and to its neighbours in time; one adjustment of this
    network by least squares gives each date's transform. A date that the reference refuses is
    reached by others. Ways around three dates must lead back to their start. Dates of another
    place, under clouds or too far off are named and left out; the others stand.

    A date that is added later is registered alone. Without georeferencing, distances are in pixels.
    """
    return SeriesCall.of(parameters).run(progress, executor)


# As the project's other results are called in Python.
register_series = coregister_series
