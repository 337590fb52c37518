"""Co-register two images of the same place, above all a SAR and an optical one."""

from __future__ import annotations

import time
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from types import MappingProxyType
from typing import Annotated, Any

from ..declaration import tool
from ..kinds import Choice, Distance, Number
from ..masks.radar import are_both_radar
from ..masks.regions import WIDTH_M
from ..matching.layout import lay_out_chips
from ..matching.local import AUTO, LocalSearch
from ..progress import SILENT, Progress
from ..rasters.pair import default_radius_m, make_pair
from ..rasters.reading import bounded_cache
from ..registration.classifying import Classifying
from ..registration.layover import CHIPS_MEAN_OVER_SCATTER
from ..registration.masking import MaskRequest, by_what_is_left
from ..registration.registered_output import RegisteredOutput, model_for_grid
from ..registration.registration import (
    RegistrationFiles,
    RegistrationResult,
    deliver,
    open_image,
    refuse_what_leans,
    refuse_what_roofs_may_be,
    register,
    rough_search,
    turn_within,
)
from ..similarity.surface import SIMILARITIES, SimilaritySettings
from .classifier_parameters import InputClassifier, ReferenceClassifier
from .common import (
    ChipSize,
    HighPercent,
    Input,
    InputBand,
    InputMask,
    LowPercent,
    MaskGrowth,
    MaskWidth,
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
from .mask_parameters import Mask, MaskImage, MaskLayer
from .registration_parameters import (
    OUTPUTS,
    MaxError,
    Model,
    OutputGrid,
    ReportOut,
    Search,
    SearchScale,
    TiePointsOut,
)


@tool(
    title="Co-register images",
    group="Registration",
    outputs=OUTPUTS,
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
            "grey values (ncc), which is for images of the same kind only.",
            choices=SIMILARITIES,
        ),
    ] = "fused",
    model: Model = AUTO,
    max_error: MaxError = 3.0,
    tie_points: TiePointsOut = None,
    transform: TransformOut = None,
    report: ReportOut = None,
    search: Search = AUTO,
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
    search_scale: SearchScale = 1.0,
    reference_band: ReferenceBand = None,
    input_band: InputBand = None,
    reference_mask: ReferenceMask = None,
    input_mask: InputMask = None,
    matching_pixel_size: MatchingPixelSize = None,
    mask: Mask = AUTO,
    mask_image: MaskImage = AUTO,
    mask_layer: MaskLayer = None,
    mask_high_percent: HighPercent = None,
    mask_low_percent: LowPercent = 0.0,
    mask_growth: MaskGrowth = 0.0,
    mask_width: MaskWidth = WIDTH_M,
    reference_classifier: ReferenceClassifier = None,
    input_classifier: InputClassifier = None,
    chip_size: ChipSize = None,
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
    output_grid: OutputGrid = "reference",
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
    settings = SimilaritySettings(similarity, bins)
    with ExitStack() as stack:
        stack.enter_context(bounded_cache())
        turn = turn_within(search_rotation, search_scale, search)
        pair = make_pair(
            open_image(stack, reference, reference_band, reference_mask),
            open_image(stack, input, input_band, input_mask),
            matching_pixel_size,
            search_radius,
            turn,
        )
        for note in ("deciding what takes part", *pair.notes()):
            progress.update(0.0, note)
        classifying = Classifying(reference_classifier, input_classifier)
        clear = classifying.apply(pair, stack, progress.part(0.0, 0.02))
        request = MaskRequest(
            mask,
            mask_image,
            mask_high_percent,
            mask_low_percent,
            mask_growth,
            mask_width,
            mask_layer,
        )
        shown, mask_used = request.apply(clear, stack, progress.part(0.02, 0.05))
        ground = request.ground(clear, mask_used, stack, progress.part(0.05, 0.1))
        spacing_px = None if spacing is None else spacing / pair.grid.pixel_size_m
        layout = lay_out_chips(pair, chip_size, spacing_px)
        local = LocalSearch(shown, layout, settings, two_way_px=two_way_error)
        local = by_what_is_left(local, mask_used)
        judging = local if ground is None else local.of_ground(ground)
        radius_m = default_radius_m(pair.grid) if search_radius is None else search_radius
        rough = rough_search(radius_m, turn, search)
        threads = worker_count(workers)
        with ThreadPoolExecutor(threads) as executor:
            result = register(
                shown,
                local,
                rough,
                kind,
                max_error,
                seed,
                executor,
                progress.part(0.1, 0.7),
                judging=judging,
            )
        if are_both_radar(pair.reference, pair.input):
            result = refuse_what_leans(result, max_error, CHIPS_MEAN_OVER_SCATTER)
        result = refuse_what_roofs_may_be(
            result,
            lambda: request.lacks_speckle(pair, mask_used.kind),
            lambda: ground is None and request.may_hide_a_town(clear, mask_used.kind),
        )
        registered = RegisteredOutput(output, output_grid, resampling)
        return deliver(
            result,
            registered,
            files,
            parameters,
            started,
            threads,
            progress.part(0.7, 1.0),
            mask_used,
        )
