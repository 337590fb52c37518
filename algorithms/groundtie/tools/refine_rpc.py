"""Refine the RPCs of an image by ground control, given or matched in a reference image."""

from __future__ import annotations

import time
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

from ..declaration import Output as ResultOutput
from ..declaration import tool
from ..errors import ParameterError
from ..kinds import Choice, FileIn, FileOut, Number, RasterIn, VectorOut
from ..masks.choice import NONE, REFERENCE, MaskUsed
from ..progress import SILENT, Progress
from ..rasters.reading import bounded_cache
from ..registration.classifying import Classifying
from ..registration.ground_control import Matching, match_ground_control, open_reference
from ..registration.masking import MaskRequest
from ..registration.refinement import Fitting, Refinement
from ..registration.refinement_output import IMAGES, Call, RefinementFiles
from ..registration.refinement_verdict import RefinementVerdict
from ..registration.sensor_input import Ground, open_oriented_image
from ..sensor.adjustment import AUTO, METHODS, ROBUST, Adjustment
from ..sensor.bias import KINDS
from ..sensor.control_points import SUFFIXES, read_control_points
from ..sensor.height_check import HeightCheck
from ..sensor.rpc_fit import RPCFit
from ..similarity.surface import SimilaritySettings
from .classifier_parameters import InputClassifier
from .common import (
    ChipSize,
    HighPercent,
    LowPercent,
    MatchingPixelSize,
    ReferenceBand,
    ReferenceMask,
    Seed,
    Workers,
    worker_count,
)
from .registration_parameters import MaxError
from .sensor_matching import (
    ForwardBackwardError,
    ImageBand,
    MaskKind,
    SearchRadius,
    Similarity,
)
from .sensor_parameters import Dem, DemDatum, Geoid, Height, RpcFile, SensorImage


@dataclass(frozen=True)
class RefinedRpc:
    """Refined RPCs, and how far to trust them.

    Parameters
    ----------
    fit
        The RPCs, with the bias folded in, and how far they miss it.
    adjustment
        The bias.
    judged
        The verdict, and the errors before and after.
    heights
        What speaks against the heights.
    ground
        Which heights were used, in words.
    mask
        Which mask points were matched with; None: they were given.
    files
        What was written, by name.
    """

    fit: RPCFit
    adjustment: Adjustment
    judged: RefinementVerdict
    heights: HeightCheck
    ground: str
    mask: MaskUsed | None
    files: dict[str, str]

    def summary(self) -> dict[str, Any]:
        """Return the result as values that JSON can carry."""
        return {
            "verdict": self.judged.summary(),
            "bias": self.adjustment.bias.to_json(),
            "left_out_rmse_px": self.adjustment.left_out_rmse_px,
            "folding_residual_px": self.fit.largest_residual_px,
            "heights": {"used": self.ground, **self.heights.summary()},
            "mask": None if self.mask is None else self.mask.summary(),
            "files": self.files,
        }

    def lines(self) -> list[str]:
        """Return the result as lines of text."""
        verdict, bias = self.judged.verdict, self.adjustment.bias
        shift, sigma = bias.shift_px()
        return [
            f"accepted: {verdict.reason}",
            f"model: {bias.kind}, {verdict.fit_points_used} of {verdict.fit_points} points",
            f"shift in the middle of the image: {shift[0]:+.2f} ± {sigma[0]:.2f}, "
            f"{shift[1]:+.2f} ± {sigma[1]:.2f} px (column, row)",
            f"error at {self.judged.held_out}: {self.judged.before.rmse:.2f} px before, "
            f"{self.judged.after.rmse:.2f} px after; CE90 {verdict.check_ce90_px:.2f} px "
            f"({verdict.check_ce90_m:.2f} m)",
            f"{verdict.check_points_agreeing} of {verdict.check_points} agree",
            self.ground,
            *(() if self.mask is None else (self.mask.line(),)),
            *(f"warning: {line}" for line in self.heights.warnings()),
            *(f"{name}: {path}" for name, path in self.files.items()),
        ]


@tool(
    title="Refine RPCs",
    group="Sensor models",
    outputs=(
        ResultOutput("CHECK_RMSE_PX", "Error at held-out points (px)", "verdict.check_rmse_px"),
        ResultOutput("BEFORE_RMSE_PX", "Error before (px)", "verdict.before.rmse_px"),
        ResultOutput("MODEL", "Model of the bias", "bias.model", text=True),
        ResultOutput("REASON", "Reason of the verdict", "verdict.reason", text=True),
    ),
)
def refine_rpc(
    image: SensorImage,
    output: Annotated[
        Path,
        FileOut(
            label="Refined RPCs",
            help="The RPCs alone, as _RPC.TXT or .RPB, or a copy of the image (.tif) with them.",
            suffixes=(".txt", ".rpb", *IMAGES),
        ),
    ],
    reference: Annotated[
        Path | None,
        RasterIn(
            label="Reference image",
            help="The image, above all a SAR one, whose georeferencing is right: ground control "
            "is matched in it.",
        ),
    ] = None,
    gcps: Annotated[
        Path | None,
        FileIn(
            label="Ground control points",
            help="Points of extract_gcps or of a person, in place of a reference.",
            suffixes=SUFFIXES[:-1],
        ),
    ] = None,
    dem: Dem = None,
    dem_datum: DemDatum = None,
    model: Annotated[
        str,
        Choice(
            label="Model of the bias",
            help="What is taken out in the image: a shift, a shift that drifts along the rows, or "
            "an affine change; auto takes the simplest that the points justify and carry.",
            choices=(AUTO, *KINDS),
        ),
    ] = AUTO,
    search_radius: SearchRadius = None,
    max_error: MaxError = 3.0,
    residuals: Annotated[
        Path | None,
        VectorOut(
            label="Residuals",
            help="The points with lines from where the refined RPCs see them on the map to where "
            "they are.",
            suffixes=SUFFIXES[:3],
        ),
    ] = None,
    report: Annotated[
        Path | None,
        FileOut(
            label="Report",
            help="A page that shows errors before and after and how far to trust them; its numbers "
            "are put beside it as JSON. It is written for refused RPCs, too.",
            suffixes=(".html",),
            advanced=True,
        ),
    ] = None,
    similarity: Similarity = "fused",
    blunders: Annotated[
        str,
        Choice(
            label="Blunders",
            help="How wrong points are found: all at once by what is probable (robust), or one "
            "after the other, the one with the largest residual first (worst-first; thesis S).",
            choices=METHODS,
            advanced=True,
        ),
    ] = ROBUST,
    largest_residual: Annotated[
        float,
        Number(
            label="Largest residual",
            help="With worst-first: points with larger residuals are blunders.",
            unit="px",
            minimum=0.1,
            maximum=100,
            advanced=True,
        ),
    ] = 2.0,
    height: Height = None,
    geoid: Geoid = None,
    rpc: RpcFile = None,
    image_band: ImageBand = None,
    image_classifier: InputClassifier = None,
    reference_band: ReferenceBand = None,
    reference_mask: ReferenceMask = None,
    mask: MaskKind = NONE,
    mask_high_percent: HighPercent = None,
    mask_low_percent: LowPercent = 10.0,
    matching_pixel_size: MatchingPixelSize = None,
    chip_size: ChipSize = None,
    forward_backward_error: ForwardBackwardError = 2.0,
    workers: Workers = None,
    seed: Seed = 0,
    progress: Progress = SILENT,
    parameters: Mapping[str, Any] = MappingProxyType({}),
) -> RefinedRpc:
    """Refine the RPCs of an image by ground control, given or matched in a reference image.

    The bias of the RPCs is estimated in the image, by least squares weighted with the points'
    covariances, without the blunders among them, and folded into new RPCs. They are refused, and
    nothing is written, if points that took no part are not nearer than before, if these do not
    agree, or if the points do not hold the model all over the image.
    """
    if (reference is None) == (gcps is None):
        raise ParameterError("give either a reference or ground control points (gcps)")
    started = time.perf_counter()
    ground = Ground(dem, dem_datum, geoid, height)
    matching = Matching(
        search_radius,
        SimilaritySettings(similarity),
        MaskRequest(mask, REFERENCE, mask_high_percent, mask_low_percent, 0.0),
        matching_pixel_size,
        chip_size,
        forward_backward_error,
        max_error,
        seed,
        Classifying(None, image_classifier),
        image_band,
    )
    fitting = Fitting(model, blunders, largest_residual, max_error, seed)
    files = RefinementFiles(output, residuals, report)
    with ExitStack() as stack:
        stack.enter_context(bounded_cache())
        located = None
        if reference is not None:
            located = open_reference(reference, reference_band, reference_mask, stack)
        crs = None if located is None else located.source.grid.crs
        sensor = open_oriented_image(image, rpc, ground, crs, stack, progress)
        call, found = Call(parameters, started), None
        if located is not None:
            with ThreadPoolExecutor(worker_count(workers)) as executor:
                part = progress.part(0.0, 0.9)
                found = match_ground_control(sensor, located, matching, executor, stack, part)
            points = files.points_or_report(found, call)
        else:
            assert gcps is not None
            points = read_control_points(gcps, sensor.orientation, sensor.source.grid)
        progress.update(0.9, "estimating the bias")
        refinement = Refinement.of(points, sensor, fitting)
        heights = refinement.heights(own_heights=gcps is not None and dem is not None)
        for warning in heights.warnings():
            progress.update(0.9, warning)
        fit = files.write(refinement, heights, found, call, progress.part(0.9, 1.0))
    return RefinedRpc(
        fit,
        refinement.adjustment,
        refinement.judged,
        heights,
        sensor.heights,
        None if found is None else found.mask,
        files.written(),
    )
