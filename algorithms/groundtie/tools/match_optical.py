"""Register optical images to one another by features (thesis P, chapters 4 and 5)."""

from __future__ import annotations

import time
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import replace
from types import MappingProxyType
from typing import Annotated, Any

from ..declaration import tool
from ..kinds import Choice, Number
from ..masks.choice import NONE
from ..matching.alignment import LINEAR_CANDIDATES
from ..matching.feature_tiles import FeatureMatcher
from ..matching.guided import GuidedSearch
from ..matching.hybrid import FeatureSearch
from ..matching.layout import lay_out_chips
from ..matching.local import AUTO, LocalSearch
from ..progress import SILENT, Progress
from ..rasters.pair import default_radius_m, make_pair
from ..rasters.reading import bounded_cache
from ..registration.classifying import Classifying
from ..registration.masking import MaskRequest
from ..registration.registered_output import RegisteredOutput, model_for_grid
from ..registration.registration import (
    RegistrationFiles,
    RegistrationResult,
    TiePointMatching,
    deliver,
    free_radius,
    open_image,
    refuse_what_roofs_may_be,
    register,
    rough_search,
    turn_within,
)
from ..similarity.surface import SimilaritySettings
from ..studies.optical_variants import DESCRIPTORS, DETECTORS, optical_descriptor, optical_detector
from .classifier_parameters import PlainInputClassifier, ReferenceClassifier
from .common import (
    Input,
    InputBand,
    InputMask,
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
from .registration_parameters import (
    OUTPUTS,
    MaxError,
    Model,
    OutputGrid,
    ReportOut,
    Search,
    TiePointsOut,
)

# Least contrast of SIFT's features, and least determinant of SURF's, on grey values from 0 to 1.
_THRESHOLD = {"sift": 0.03, "surf": 0.0004}

# Without georeferencing, the input may be larger or smaller by this.
_FREE_SCALE = 2.0


@tool(title="Match optical images", group="Registration", outputs=OUTPUTS)
def match_optical(
    reference: Reference,
    input: Input,
    output: Output,
    search_radius: FreeSearchRadius = None,
    input_classifier: PlainInputClassifier = None,
    model: Model = AUTO,
    max_error: MaxError = 3.0,
    tie_points: TiePointsOut = None,
    transform: TransformOut = None,
    report: ReportOut = None,
    detector: Annotated[
        str,
        Choice(
            label="Detector",
            help="Which features are found: SIFT's or SURF's. SURF's authors held patents, which "
            "may still run in some countries.",
            choices=DETECTORS,
            advanced=True,
        ),
    ] = "sift",
    descriptor: Annotated[
        str,
        Choice(
            label="Descriptor",
            help="What features are described by: histograms of oriented gradients in a patch of "
            "41 px, with nine directions (hog81) or seven (hog63), which do not mind inverted "
            "contrast; SIFT's descriptor; or SURF's 64 Haar wavelets.",
            choices=DESCRIPTORS,
            advanced=True,
        ),
    ] = "hog81",
    threshold: Annotated[
        float | None,
        Number(
            label="Least contrast",
            help="Weaker features are left out: a share of the range of grey values for sift, by "
            "default 0.03, as OpenCV counts it; the determinant of the Hessian for surf, by "
            "default 0.0004.",
            minimum=0.0,
            maximum=1.0,
            advanced=True,
        ),
    ] = None,
    reference_classifier: ReferenceClassifier = None,
    ratio: LargestRatio = 1.0,
    gate: Gate = 16.0,
    refinement: Refinement = "fused",
    similarity: CheckSimilarity = "fused",
    search: Search = AUTO,
    search_rotation: FreeSearchRotation = None,
    search_scale: Annotated[
        float | None,
        Number(
            label="Largest scale",
            help="By which factor the input may be larger or smaller than it claims. By default "
            "1; without georeferencing 2.",
            minimum=1,
            maximum=4,
            advanced=True,
        ),
    ] = None,
    reference_band: ReferenceBand = None,
    input_band: InputBand = None,
    reference_mask: ReferenceMask = None,
    input_mask: InputMask = None,
    matching_pixel_size: MatchingPixelSize = None,
    output_grid: OutputGrid = "reference",
    resampling: Resampling = "cubic",
    workers: Workers = None,
    seed: Seed = 0,
    progress: Progress = SILENT,
    parameters: Mapping[str, Any] = MappingProxyType({}),
) -> RegistrationResult:
    """Register optical images to one another: other bands, dates or sensors, day and night.

    A rough shift is searched for on reduced images; features are matched near where it puts them,
    and chips all over the images near where the model of the features does; the final model is
    fitted to the chips. Parts of the reference are held out of all of this; points in them decide
    whether the registration is accepted. A refused registration writes no image.

    Images without georeferencing are matched in pixel coordinates and may be turned by any angle
    and scaled by up to 2; distances are then in pixels.
    """
    started = time.perf_counter()
    files = RegistrationFiles(tie_points, transform, report)
    kind = model_for_grid(model, output_grid)
    with ExitStack() as stack:
        stack.enter_context(bounded_cache())
        there = open_image(stack, reference, reference_band, reference_mask)
        here = open_image(stack, input, input_band, input_mask)
        radius_m = free_radius(here) if search_radius is None else search_radius
        is_free = not here.source.grid.is_georeferenced
        turn = turn_within(
            180.0 * is_free if search_rotation is None else search_rotation,
            (_FREE_SCALE if is_free else 1.0) if search_scale is None else search_scale,
            search,
        )
        pair = make_pair(there, here, matching_pixel_size, radius_m, turn)
        for note in pair.notes():
            progress.update(0.0, note)
        classifying = Classifying(reference_classifier, input_classifier)
        shown = classifying.apply(pair, stack, progress.part(0.0, 0.1))
        local = LocalSearch(shown, lay_out_chips(pair), SimilaritySettings(similarity))
        features = FeatureSearch(
            FeatureMatcher(
                pair,
                optical_detector(
                    detector, _THRESHOLD[detector] if threshold is None else threshold
                ),
                optical_descriptor(descriptor),
                ratio,
                gate,
                local.held_out,
                None if shown is pair else shown,
            ),
            local,
        )
        matching: TiePointMatching = features
        settings = refinement_settings(refinement)
        if settings is not None:
            # Polynomials bend along what stands: "auto" chooses among what features choose from.
            chips = replace(local, settings=settings, candidates=LINEAR_CANDIDATES)
            matching = GuidedSearch(features, chips)
        rough = rough_search(
            default_radius_m(pair.grid) if radius_m is None else radius_m, turn, search
        )
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
                matching,
            )
        # One image may be a radar's all the same. Bright optical images are not in doubt.
        request = MaskRequest(NONE, AUTO, None, 0.0, 0.0)
        result = refuse_what_roofs_may_be(
            result,
            lambda: request.lacks_speckle(pair, NONE),
            lambda: request.sees_radar(pair) and request.may_hide_a_town(shown, NONE),
        )
        registered = RegisteredOutput(output, output_grid, resampling)
        return deliver(
            result, registered, files, parameters, started, threads, progress.part(0.7, 1.0)
        )
