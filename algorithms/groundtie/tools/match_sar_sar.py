"""Register a SAR image to another one: mutual information and SIFT together (thesis S 6.9)."""

from __future__ import annotations

import time
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

from ..declaration import tool
from ..errors import ParameterError
from ..kinds import Choice, Number, RasterIn
from ..masks.choice import NONE
from ..masks.regions import WIDTH_M
from ..matching.feature_tiles import FeatureMatcher
from ..matching.hybrid import FeatureSearch
from ..matching.layout import lay_out_chips
from ..matching.local import AUTO, LocalSearch
from ..progress import SILENT, Progress
from ..rasters.pair import default_radius_m, make_pair
from ..rasters.reading import bounded_cache
from ..registration.classifying import Classifying
from ..registration.layover import FEATURES_MEAN_OVER_SCATTER
from ..registration.masking import MaskRequest
from ..registration.registered_output import RegisteredOutput, model_for_grid
from ..registration.registration import (
    RegistrationFiles,
    RegistrationResult,
    deliver,
    free_radius,
    open_image,
    refuse_what_leans,
    refuse_what_roofs_may_be,
    register,
    rough_search,
    turn_within,
)
from ..similarity.surface import SimilaritySettings
from ..studies.gradients import GRADIENTS
from ..studies.sift_variants import DETECTORS, SiftVariantDescriptor, sift_detector
from .classifier_parameters import InputClassifier, ReferenceClassifier
from .common import (
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
from .feature_parameters import (
    CheckSimilarity,
    FreeSearchRadius,
    FreeSearchRotation,
    Gate,
    LargestRatio,
    Refinement,
    refinement_settings,
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


@tool(title="Match SAR with SAR", group="Registration", outputs=OUTPUTS)
def match_sar_sar(
    reference: Reference,
    input: Input,
    output: Output,
    search_radius: FreeSearchRadius = None,
    ground_mask: Annotated[
        Path | None,
        RasterIn(
            label="Mask of level ground",
            help="Where this raster is 0 or has no data, features of the reference take no part "
            "in the model, and check points do not look: buildings and hills, which lean.",
        ),
    ] = None,
    model: Model = AUTO,
    max_error: MaxError = 3.0,
    tie_points: TiePointsOut = None,
    transform: TransformOut = None,
    report: ReportOut = None,
    detector: Annotated[
        str,
        Choice(
            label="Detector",
            help="Which features are found: those of SIFT; those without its first octave, which "
            "holds most of the speckle (sift-oct); the same after smoothing by an exponential "
            "filter (sift-isef-oct).",
            choices=DETECTORS,
            advanced=True,
        ),
    ] = "sift-oct",
    contrast: Annotated[
        float,
        Number(
            label="Least contrast",
            help="Weaker features are left out: a share of the range of grey values, as OpenCV "
            "counts it (three times Lowe's).",
            minimum=0.0,
            maximum=1.0,
            advanced=True,
        ),
    ] = 0.03,
    gradient: Annotated[
        str,
        Choice(
            label="Gradient",
            help="What features are described by: differences of neighbouring pixels or "
            "Deriche's recursive ones, of logarithms; ratios of exponentially weighted averages "
            "with their sign (roewa) or without it.",
            choices=GRADIENTS,
            advanced=True,
        ),
    ] = "differences",
    ratio: LargestRatio = 1.0,
    reference_classifier: ReferenceClassifier = None,
    input_classifier: InputClassifier = None,
    gate: Gate = 16.0,
    refinement: Refinement = "nmi",
    similarity: CheckSimilarity = "fused",
    search: Search = AUTO,
    search_rotation: FreeSearchRotation = None,
    search_scale: SearchScale = 1.0,
    reference_band: ReferenceBand = None,
    input_band: InputBand = None,
    reference_mask: ReferenceMask = None,
    input_mask: InputMask = None,
    matching_pixel_size: MatchingPixelSize = None,
    mask: Mask = NONE,
    mask_image: MaskImage = AUTO,
    mask_layer: MaskLayer = None,
    mask_high_percent: HighPercent = None,
    mask_low_percent: LowPercent = 0.0,
    mask_growth: MaskGrowth = 0.0,
    mask_width: MaskWidth = WIDTH_M,
    output_grid: OutputGrid = "reference",
    resampling: Resampling = "cubic",
    workers: Workers = None,
    seed: Seed = 0,
    progress: Progress = SILENT,
    parameters: Mapping[str, Any] = MappingProxyType({}),
) -> RegistrationResult:
    """Register a SAR image to another one: other sensor, incidence angle, orbit or date.

    A rough shift is searched for on reduced images; SIFT features are matched near where it puts
    them, and refined by mutual information in chips around them; a robust model is fitted. Parts
    of the reference are held out of all of this; points in them decide whether the registration
    is accepted. A refused registration writes no image.

    Images without georeferencing are matched in pixel coordinates and may be turned by any angle;
    distances are then in pixels.
    """
    started = time.perf_counter()
    if ground_mask is not None and reference_mask is not None:
        raise ParameterError("give ground_mask or reference_mask, not both")
    if ground_mask is not None and (mask != NONE or mask_layer is not None):
        raise ParameterError("give ground_mask or another mask, not both")
    files = RegistrationFiles(tie_points, transform, report)
    kind = model_for_grid(model, output_grid)
    with ExitStack() as stack:
        stack.enter_context(bounded_cache())
        there = open_image(stack, reference, reference_band, reference_mask)
        here = open_image(stack, input, input_band, input_mask)
        radius_m = free_radius(here) if search_radius is None else search_radius
        turned = 0.0 if here.source.grid.is_georeferenced else 180.0
        turn = turn_within(
            turned if search_rotation is None else search_rotation, search_scale, search
        )
        pair = make_pair(there, here, matching_pixel_size, radius_m, turn)
        for note in pair.notes():
            progress.update(0.0, note)
        request = MaskRequest(
            mask,
            mask_image,
            mask_high_percent,
            mask_low_percent,
            mask_growth,
            mask_width,
            mask_layer,
        )
        ground, mask_used = request.apply(pair, stack, progress.part(0.0, 0.1))
        if ground_mask is not None:
            shown = open_image(stack, reference, reference_band, ground_mask)
            ground = replace(pair, reference=shown)
        classifying = Classifying(reference_classifier, input_classifier)
        ground = classifying.apply(ground, stack, progress.part(0.1, 0.15))
        local = LocalSearch(ground, lay_out_chips(pair), SimilaritySettings(similarity))
        features = FeatureSearch(
            FeatureMatcher(
                pair,
                sift_detector(detector, contrast),
                SiftVariantDescriptor(gradient),
                ratio,
                gate,
                local.held_out,
                None if ground is pair else ground,
            ),
            local,
            refinement_settings(refinement),
        )
        rough = rough_search(
            default_radius_m(pair.grid) if radius_m is None else radius_m, turn, search
        )
        threads = worker_count(workers)
        with ThreadPoolExecutor(threads) as executor:
            result = register(
                ground,
                local,
                rough,
                kind,
                max_error,
                seed,
                executor,
                progress.part(0.15, 0.7),
                features,
            )
        result = refuse_what_leans(result, max_error, FEATURES_MEAN_OVER_SCATTER)
        if ground_mask is None:
            # One image may be a camera's all the same.
            result = refuse_what_roofs_may_be(
                result,
                lambda: request.lacks_speckle(pair, mask_used.kind),
                lambda: request.may_hide_a_town(pair, mask_used.kind),
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
            None if ground_mask is not None else mask_used,
        )
