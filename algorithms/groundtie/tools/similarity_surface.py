"""The similarity surface of one window: a measure of similarity at every shift."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from ..context import threads
from ..declaration import Output, tool
from ..kinds import Choice, Distance, FileOut, Number, RasterOut
from ..progress import SILENT, Progress
from ..registration.opening import open_pair
from ..registration.specification import Specification
from ..similarity.binning import BINNINGS
from ..studies.surface_result import SurfaceResult
from ..studies.window_surface import (
    CHOICES,
    DEFAULT_RADIUS_PX,
    GREY_VALUES,
    LARGEST_RADIUS_PX,
    SurfaceSettings,
    Window,
)
from .parameters import general, registration


@tool(
    title="Similarity surface",
    group="Quality",
    outputs=(
        Output("PEAK_RIGHT_PX", "Peak to the right (px)", "peak.right_px"),
        Output("PEAK_DOWN_PX", "Peak downwards (px)", "peak.down_px"),
        Output("PEAK_HEIGHT", "Height of the peak (standard deviations)", "peak.height"),
        Output("SECOND_RATIO", "Second peak's share of the height", "second_ratio"),
    ),
)
def similarity_surface(
    reference: general.Reference,
    input: general.Input,
    output: Annotated[
        Path,
        RasterOut(
            label="Similarity surface",
            help="GeoTIFF with a pixel for every shift; its first band has the measure's values, "
            "the second one robust standard deviations from the slow trend.",
        ),
    ],
    centre_x: Annotated[
        float | None,
        Number(
            help="Where the window's centre lies, in the CRS of the reference; by default the "
            "middle of the overlap.",
        ),
    ] = None,
    centre_y: Annotated[float | None, Number(help="See the centre's x; give both or none.")] = None,
    chip_size: Annotated[
        int,
        Number(
            help="Side of the window, in pixels of the matching grid; even numbers get one more.",
            unit="px",
            integer=True,
            minimum=16,
            maximum=1024,
        ),
    ] = 101,
    search_radius: Annotated[
        float | None,
        Distance(
            help=f"Largest shift; by default {DEFAULT_RADIUS_PX} pixels of the matching grid, "
            f"and at most {LARGEST_RADIUS_PX}.",
        ),
    ] = None,
    similarity: Annotated[
        str,
        Choice(
            help="What is measured: fused (nmi and orientation), mutual information normalised "
            "(nmi) or not (mi), by Rényi's or Tsallis' entropy or by a density ratio (mlmi), the "
            "orientation of edges, correlation of grey values (ncc), cluster reward or "
            "correlation ratio.",
            choices=CHOICES,
        ),
    ] = "fused",
    picture: Annotated[
        Path | None,
        general.picture("The surface with its peaks, to look at."),
    ] = None,
    numbers: Annotated[
        Path | None,
        FileOut(
            help="Peak, its sub-pixel position and covariance, and the second peak.",
            suffixes=(".json",),
        ),
    ] = None,
    entropy_order: Annotated[
        float,
        Number(
            label="Order of the entropy",
            help="Of Rényi's entropy for renyi, of Tsallis' for tsallis; 1 is Shannon's.",
            minimum=-100,
            maximum=100,
            advanced=True,
        ),
    ] = 2.0,
    bins: Annotated[
        int | None,
        Number(
            label="Histogram bins",
            help="Number of grey levels of the joint histogram; by default 8 to 32, by the size "
            "of the window.",
            integer=True,
            minimum=2,
            maximum=256,
            advanced=True,
        ),
    ] = None,
    binning: Annotated[
        str,
        Choice(
            help="Whether grey levels hold equally many pixels, are equally wide, or are all "
            "grey values that there are (slow).",
            choices=(*BINNINGS, GREY_VALUES),
            advanced=True,
        ),
    ] = "equal-frequency",
    gpve_order: Annotated[
        int,
        Number(
            label="Order of the histogram's spline",
            help="Order of the B-spline by which pixels enter the joint histogram: 2 is partial "
            "volume interpolation, 4 the cubic spline; 4 and more are free of artefacts.",
            integer=True,
            minimum=2,
            maximum=7,
            advanced=True,
        ),
    ] = 4,
    sample: Annotated[
        int,
        Number(
            help="For mlmi: number of pixels of the window that are used.",
            integer=True,
            minimum=50,
            maximum=20_000,
            advanced=True,
        ),
    ] = 1000,
    reference_band: general.ReferenceBand = None,
    input_band: general.InputBand = None,
    reference_mask: registration.ReferenceMask = None,
    input_mask: registration.InputMask = None,
    matching_pixel_size: general.MatchingPixelSize = None,
    workers: general.Workers = None,
    seed: general.Seed = 0,
    progress: Progress = SILENT,
) -> SurfaceResult:
    """Show a measure of similarity at every shift of one window.

    A window of the reference is compared with the input at all shifts around its nominal place.
    The result is a raster: the pixel of a shift lies where the window's centre lies when it is so
    shifted, so that the peak lies where the input shows the ground at the reference's centre.

    The surface has one distinct peak if the measure is fit for the images. Nothing is registered
    and no verdict given.
    """
    settings = SurfaceSettings(similarity, bins, binning, gpve_order, entropy_order, sample)
    files = {"output": output, "picture": picture, "numbers": numbers}
    spec = Specification(search_radius_m=0.0, matching_pixel_size_m=matching_pixel_size)
    bands, masks = (reference_band, input_band), (reference_mask, input_mask)
    with (
        threads(workers, progress.part(0.0, 0.9), seed) as context,
        open_pair(reference, input, spec, context, bands, masks) as opened,
    ):
        window = Window.at(opened.pair, (centre_x, centre_y), chip_size, search_radius)
        result = SurfaceResult.measured(window, settings, files, context)
    progress.update(0.9, "writing")
    result.write()
    return result
