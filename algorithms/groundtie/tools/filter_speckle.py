"""Smooth the speckle of a radar image, and keep its edges."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

from ..context import threads
from ..declaration import Output, tool
from ..errors import ParameterError
from ..kinds import Choice, Number, RasterOut
from ..progress import SILENT, Progress
from ..rasters.atomic import Outputs
from ..rasters.reading import open_raster
from ..speckle.filters import FILTERS, SpeckleFilter
from ..speckle.raster_filter import AMPLITUDE, VALUES, RasterFilter, looks_of
from .parameters import general


@dataclass(frozen=True)
class SpeckleResult:
    """The filtered image, and the equivalent number of looks before and after."""

    output: Path
    filter: str
    looks: float
    looks_after: float

    def summary(self) -> dict[str, Any]:
        """Return the result as values that JSON can carry."""
        return {**asdict(self), "output": str(self.output)}

    def lines(self) -> list[str]:
        """Return the result as lines of text."""
        return [
            f"wrote {self.output}",
            f"equivalent number of looks: {self.looks:.1f}, now {self.looks_after:.0f}",
        ]


@tool(
    title="Filter speckle",
    group="Radar",
    outputs=(
        Output("LOOKS", "Equivalent number of looks", "looks"),
        Output("LOOKS_AFTER", "Equivalent number of looks of the result", "looks_after"),
    ),
)
def filter_speckle(
    input: general.Radar,
    output: Annotated[
        Path,
        RasterOut(
            label="Filtered image",
            help="GeoTIFF with the input's bands, data type and nodata value; complex images "
            "become amplitudes.",
        ),
    ],
    filter: Annotated[
        str,
        Choice(
            help="enhanced-frost, lee, kuan and gamma-map adapt to how much the image varies "
            "locally; isef smooths everything alike.",
            choices=tuple(FILTERS),
        ),
    ] = "enhanced-frost",
    window: Annotated[
        int,
        Number(
            help="Side of the window, an odd number; isef smooths as much as the mean of it.",
            unit="px",
            integer=True,
            minimum=3,
            maximum=25,
        ),
    ] = 7,
    looks: Annotated[
        float | None,
        Number(
            help="Equivalent number of looks; by default it is estimated from the image.",
            minimum=0.5,
            maximum=10_000,
        ),
    ] = None,
    values: Annotated[
        str,
        Choice(
            help="Unit of the pixels. Decibels must be made linear before.",
            choices=VALUES,
        ),
    ] = AMPLITUDE,
    damping: Annotated[
        float,
        Number(
            help="Of enhanced-frost: larger values keep more of edges, and of speckle.",
            minimum=0,
            maximum=20,
            advanced=True,
        ),
    ] = 1.0,
    workers: general.Workers = None,
    progress: Progress = SILENT,
) -> SpeckleResult:
    """Smooth the speckle of a radar image, and keep its edges.

    Filters work on intensity: amplitudes are squared before and the root is taken after, so that
    the mean power stays. Each band is filtered by itself; pixels without data are left out.
    """
    if window % 2 == 0:
        raise ParameterError(f"window must be an odd number, not {window}")
    with open_raster(input) as source, threads(workers, progress) as context:
        if looks is None:
            looks = looks_of(source, values)
        job = RasterFilter(source, SpeckleFilter(filter, window, looks, damping), values)
        with Outputs() as outputs:
            staged = outputs.stage(output)
            job.write(staged, context)
            with open_raster(staged) as filtered:
                after = looks_of(filtered, values)
    return SpeckleResult(output, filter, looks, after)
