"""Co-register two images of the same place, above all a SAR and an optical one."""

from __future__ import annotations

import time
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

from ..declaration import Output as ResultOutput
from ..declaration import tool
from ..geometry.models import KINDS
from ..kinds import Choice, Distance, FileOut, Number, VectorOut
from ..masks.choice import MASKS, NONE
from ..progress import SILENT, Progress
from ..quality.report import Report
from ..rasters.pair import Image, default_radius_m, make_pair
from ..rasters.reading import RasterSource, bounded_cache, open_raster
from ..search.layout import lay_out_chips
from ..search.local import AUTO, LocalSearch
from ..search.pose import PoseSearch
from ..search.pose_searches import DEFAULT_SEARCH, SEARCHES
from ..search.rough import RoughSearch
from ..similarity.binning import BINNINGS
from ..similarity.surface import SIMILARITIES, SimilaritySettings
from .common import (
    GpveOrder,
    HighPercent,
    Input,
    InputBand,
    InputMask,
    LowPercent,
    MaskGrowth,
    MatchingPixelSize,
    Output,
    Reference,
    ReferenceBand,
    ReferenceMask,
    Resampling,
    Seed,
    TransformOut,
    Workers,
    worker_count,
)
from .masking import MASK_IMAGES, MaskRequest
from .registered_output import OUTPUT_GRIDS, RegisteredOutput, model_for_grid
from .registration import (
    RegistrationFiles,
    RegistrationResult,
    accepted_or_refused,
    register,
)


@tool(
    title="Co-register images",
    group="Registration",
    outputs=(
        ResultOutput("CHECK_RMSE_PX", "Error at check points (px)", "verdict.check_rmse_px"),
        ResultOutput("CHECK_CE90_M", "CE90 at check points (m)", "verdict.check_ce90_m"),
        ResultOutput("POINTS", "Number of tie points", "verdict.points"),
        ResultOutput("REASON", "Reason of the verdict", "verdict.reason", text=True),
    ),
)
def coregister(
    reference: Reference,
    input: Input,
    output: Output,
    search_radius: Annotated[
        float | None,
        Distance(
            label="Search radius",
            help="How far the input may lie from its right place. By default 100 m or 20 pixels "
            "of the coarser image, whichever is larger.",
        ),
    ] = None,
    similarity: Annotated[
        str,
        Choice(
            label="Similarity",
            help="What tells that two windows show the same place: mutual information (nmi), the "
            "orientation of edges, their strength, all three together (fused), correlation of "
            "grey values (ncc), which is for images of the same kind only, or another measure on "
            "joint histograms: Shannon's (mi), Rényi's or Tsallis's information of order 2, "
            "cluster reward, correlation ratio.",
            choices=SIMILARITIES,
        ),
    ] = "fused",
    model: Annotated[
        str,
        Choice(
            label="Model",
            help="Which misregistration is taken out; auto takes the simplest model that the "
            "points justify.",
            choices=(AUTO, *KINDS),
        ),
    ] = AUTO,
    max_error: Annotated[
        float,
        Number(
            label="Largest error",
            help="The registration is refused if its root mean square error at check points, "
            "which take no part in the fit, is larger.",
            unit="px",
            minimum=0.1,
            maximum=100,
        ),
    ] = 3.0,
    tie_points: Annotated[
        Path | None,
        VectorOut(
            label="Tie points",
            help="Lines from where the input claims a point to be to where it is.",
            suffixes=(".gpkg", ".geojson", ".csv", ".points"),
        ),
    ] = None,
    transform: TransformOut = None,
    report: Annotated[
        Path | None,
        FileOut(
            label="Report",
            help="A page that shows the result and how far to trust it; its numbers are put "
            "beside it as JSON. It is written for a refused registration, too.",
            suffixes=(".html",),
        ),
    ] = None,
    search: Annotated[
        str,
        Choice(
            label="Rough search",
            help="What finds the rough position on a reduced image. By default all shifts are "
            "tried, and rotation-steps where a rotation or scale is searched for.",
            choices=(AUTO, *SEARCHES),
            advanced=True,
        ),
    ] = AUTO,
    search_rotation: Annotated[
        float,
        Number(
            label="Largest rotation",
            help="How far the input may be turned, either way, against where it claims to lie.",
            unit="°",
            minimum=0,
            maximum=180,
            advanced=True,
        ),
    ] = 0.0,
    search_scale: Annotated[
        float,
        Number(
            label="Largest scale",
            help="By which factor the input may be larger or smaller than it claims.",
            minimum=1,
            maximum=4,
            advanced=True,
        ),
    ] = 1.0,
    reference_band: ReferenceBand = None,
    input_band: InputBand = None,
    reference_mask: ReferenceMask = None,
    input_mask: InputMask = None,
    matching_pixel_size: MatchingPixelSize = None,
    mask: Annotated[
        str,
        Choice(
            label="Mask",
            help="What takes part, for scenes with high buildings, which lean over their "
            "surroundings: threshold leaves out what shines in the radar image.",
            choices=MASKS,
            advanced=True,
        ),
    ] = NONE,
    mask_image: Annotated[
        str,
        Choice(
            label="Image that is masked",
            help="By default the one with the more speckle: the radar's.",
            choices=MASK_IMAGES,
            advanced=True,
        ),
    ] = AUTO,
    mask_high_percent: HighPercent = 20.0,
    mask_low_percent: LowPercent = 0.0,
    mask_growth: MaskGrowth = 0.0,
    chip_size: Annotated[
        int | None,
        Number(
            label="Chip size",
            help="Side of the windows that are matched, in pixels of the matching grid; by "
            "default by the size of the overlap.",
            unit="px",
            integer=True,
            minimum=16,
            maximum=1024,
            advanced=True,
        ),
    ] = None,
    spacing: Annotated[
        float | None,
        Distance(
            label="Spacing of tie points",
            help="Distance between tie points; by default by the size of the overlap.",
            minimum=1e-6,
            advanced=True,
        ),
    ] = None,
    bins: Annotated[
        int | None,
        Number(
            label="Histogram bins",
            help="Number of grey levels for mutual information; by default 8 to 32, by the size "
            "of the window.",
            integer=True,
            minimum=2,
            maximum=254,
            advanced=True,
        ),
    ] = None,
    binning: Annotated[
        str,
        Choice(
            label="Binning",
            help="Whether grey levels hold equally many pixels or are equally wide.",
            choices=BINNINGS,
            advanced=True,
        ),
    ] = "equal-frequency",
    gpve_order: GpveOrder = 4,
    two_way_error: Annotated[
        float,
        Number(
            label="Largest two-way error",
            help="A tie point is rejected if the match back misses its start by more.",
            unit="px",
            minimum=0,
            maximum=100,
            advanced=True,
        ),
    ] = 2.0,
    output_grid: Annotated[
        str,
        Choice(
            label="Output grid",
            help="Grid of the registered image: the reference's pixels exactly, so that both "
            "stack; pixels like the input's own; or, for a pure shift, the input's untouched "
            "pixels with a corrected geotransform.",
            choices=OUTPUT_GRIDS,
            advanced=True,
        ),
    ] = "reference",
    resampling: Resampling = "cubic",
    workers: Workers = None,
    seed: Seed = 0,
    progress: Progress = SILENT,
    parameters: Mapping[str, Any] = MappingProxyType({}),
) -> RegistrationResult:
    """Co-register two images of the same place, above all a SAR and an optical one.

    A rough shift is searched for within the search radius, tie points are matched locally, and a
    robust model is fitted to them. Parts of the reference are held out of all of this; points in
    them decide whether the registration is accepted. A refused registration writes no image.

    The input's pixels are resampled once, by the whole transform. Images without georeferencing
    are matched in pixel coordinates; distances are then in pixels.
    """
    started = time.perf_counter()
    files = RegistrationFiles(tie_points, transform, report)
    kind = model_for_grid(model, output_grid)
    settings = SimilaritySettings(similarity, bins, binning, gpve_order)
    with ExitStack() as stack:
        stack.enter_context(bounded_cache())

        def opened(path: Path) -> RasterSource:
            return stack.enter_context(open_raster(path))

        def optional(path: Path | None) -> RasterSource | None:
            return None if path is None else opened(path)

        pair = make_pair(
            Image(opened(reference), reference_band, optional(reference_mask)),
            Image(opened(input), input_band, optional(input_mask)),
            matching_pixel_size,
            search_radius,
        )
        for note in pair.notes():
            progress.update(0.0, note)
        request = MaskRequest(mask, mask_image, mask_high_percent, mask_low_percent, mask_growth)
        pair, mask_used = request.apply(pair, search_radius, stack, progress.part(0.0, 0.1))
        spacing_px = None if spacing is None else spacing / pair.grid.pixel_size_m
        local = LocalSearch(
            pair, lay_out_chips(pair, chip_size, spacing_px), settings, two_way_px=two_way_error
        )
        rough = RoughSearch(
            default_radius_m(pair.grid) if search_radius is None else search_radius,
            search_rotation,
            (1 / search_scale, search_scale),
            _pose_search(search, search_rotation > 0 or search_scale > 1),
        )
        threads = worker_count(workers)
        with ThreadPoolExecutor(threads) as executor:
            result = register(
                pair,
                local,
                rough,
                kind,
                max_error,
                seed,
                executor,
                progress.part(0.1, 0.7),
            )
        page = Report(
            title=f"{Path(input).name} registered to {Path(reference).name}",
            verdict=result.verdict,
            pair=pair,
            mask=mask_used,
            points=result.points,
            transform=result.transform,
            surfaces=result.extreme_surfaces() if report is not None else (),
            parameters={k: v for k, v in parameters.items() if v is not None},
            seconds=time.perf_counter() - started,
        )
        with accepted_or_refused(result, page, files) as outputs:
            points, found = result.accepted()
            files.write_points(points, found, outputs)
            progress.update(0.7, "writing the registered image")
            RegisteredOutput(output, output_grid, resampling).write(
                pair, found, outputs, threads, progress.part(0.7, 1.0)
            )
    return RegistrationResult.of(result, page.summary(), {"output": output, **files.written()})


def _pose_search(name: str, beyond_shifts: bool) -> PoseSearch | None:
    """Return the search of a name; None: all shifts are tried."""
    if name == AUTO:
        return SEARCHES[DEFAULT_SEARCH] if beyond_shifts else None
    return SEARCHES[name]
