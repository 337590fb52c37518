"""Refine the RPCs of an image by ground control, given or matched in a reference image."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from ..declaration import Output as ResultOutput
from ..declaration import tool
from ..errors import NotRegisteredError, ParameterError, TooFewPointsError
from ..kinds import Choice, FileIn, FileOut, Number, RasterIn, VectorOut
from ..masks.choice import NONE, REFERENCE
from ..progress import SILENT, Progress
from ..quality.refinement import RefinementVerdict, judge_refinement
from ..quality.verdict import refuse
from ..rasters.atomic import Outputs
from ..rasters.delivery import write_with_geotransform
from ..rasters.reading import RasterSource, bounded_cache
from ..sensor.adjustment import AUTO, METHODS, ROBUST, Adjustment, Control, adjust
from ..sensor.bias import KINDS, fold
from ..sensor.control_points import SUFFIXES, ControlPoints, read_control_points
from ..sensor.height_check import HeightCheck, check_heights
from ..sensor.orientation import Orientation, sensor_grid
from ..sensor.rpc_files import write_rpc
from ..sensor.rpc_fit import RPCFit
from ..sensor.rpc_tags import rpc_to_tags
from ..similarity.surface import SimilaritySettings
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
from .extract_gcps import accepted_points
from .ground_control import Matching, match_ground_control, open_reference
from .masking import MaskRequest
from .registration_parameters import MaxError
from .sensor_input import (
    Dem,
    DemDatum,
    Geoid,
    Ground,
    Height,
    RpcFile,
    SensorImage,
    open_sensor_image,
    utm_of,
)
from .sensor_matching import (
    ImageBand,
    MaskKind,
    SearchRadius,
    Similarity,
    TwoWayError,
)

_IMAGES = (".tif", ".tiff")

# A bias that is folded in by a new fit may be missed by so much, in pixels.
_LARGEST_FOLDING_PX = 0.01


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
    files
        What was written, by name.
    """

    fit: RPCFit
    adjustment: Adjustment
    judged: RefinementVerdict
    heights: HeightCheck
    ground: str
    files: dict[str, str]

    def summary(self) -> dict[str, Any]:
        """Return the result as values that JSON can carry."""
        return {
            "verdict": self.judged.summary(),
            "bias": self.adjustment.bias.to_json(),
            "left_out_rmse_px": self.adjustment.left_out_rmse_px,
            "folding_residual_px": self.fit.largest_residual_px,
            "heights": {"used": self.ground, **self.heights.summary()},
            "files": self.files,
        }

    def lines(self) -> list[str]:
        """Return the result as lines of text."""
        verdict, bias = self.judged.verdict, self.adjustment.bias
        shift, sigma = bias.coefficients[0], np.sqrt(np.diag(bias.covariance))[:2]
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
            suffixes=(".txt", ".rpb", *_IMAGES),
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
    reference_band: ReferenceBand = None,
    reference_mask: ReferenceMask = None,
    mask: MaskKind = NONE,
    mask_high_percent: HighPercent = 20.0,
    mask_low_percent: LowPercent = 10.0,
    matching_pixel_size: MatchingPixelSize = None,
    chip_size: ChipSize = None,
    two_way_error: TwoWayError = 2.0,
    workers: Workers = None,
    seed: Seed = 0,
    progress: Progress = SILENT,
) -> RefinedRpc:
    """Refine the RPCs of an image by ground control, given or matched in a reference image.

    The bias of the RPCs is estimated in the image, by least squares weighted with the points'
    covariances, without the blunders among them, and folded into new RPCs. They are refused, and
    nothing is written, if points that took no part are not nearer than before, if these do not
    agree, or if the points do not hold the model all over the image.
    """
    if (reference is None) == (gcps is None):
        raise ParameterError("give either a reference or ground control points (gcps)")
    ground = Ground(dem, dem_datum, geoid, height)
    matching = Matching(
        search_radius,
        SimilaritySettings(similarity),
        MaskRequest(mask, REFERENCE, mask_high_percent, mask_low_percent, 0.0),
        matching_pixel_size,
        chip_size,
        two_way_error,
        max_error,
        seed,
        image_band,
    )
    with ExitStack() as stack:
        stack.enter_context(bounded_cache())
        source, delivered = open_sensor_image(image, rpc, stack)
        progress.update(0.0, ground.note(delivered))
        if reference is not None:
            located = open_reference(reference, reference_band, reference_mask, stack)
            orientation = ground.orientation(source, delivered, located.source.grid.crs, stack)
            with ThreadPoolExecutor(worker_count(workers)) as executor:
                found = match_ground_control(
                    source, orientation, located, matching, executor, stack,
                    progress.part(0.0, 0.9),
                )  # fmt: skip
            points = accepted_points(found, image, reference)
            own_heights = None
        else:
            assert gcps is not None
            orientation = ground.orientation(source, delivered, utm_of(source, delivered), stack)
            points = read_control_points(gcps, orientation, source.grid)
            own_heights = None if dem is None else _median_above(points, orientation)
        progress.update(0.9, "estimating the bias")
        adjusted = _Adjusted.of(
            points, source, orientation, model, blunders, largest_residual, seed
        )
        pixel_m = sensor_grid(source, orientation).pixel_size_m
        judged = judge_refinement(
            adjusted.control, adjusted.adjustment, adjusted.check, pixel_m, max_error
        )
        if not judged.verdict.accepted:
            raise NotRegisteredError(
                f"the RPCs of {image} were not refined: {judged.verdict.reason}", judged.verdict
            )
        size = source.grid.width, source.grid.height
        heights = check_heights(
            orientation, size, adjusted.control, adjusted.adjustment, own_heights
        )
        for warning in heights.warnings():
            progress.update(0.9, warning)
        fit = fold(delivered, adjusted.adjustment.bias)
        if fit.largest_residual_px > _LARGEST_FOLDING_PX:
            raise NotRegisteredError(
                f"the RPCs of {image} cannot take up the bias: they miss it by "
                f"{fit.largest_residual_px:.3f} px",
                judged.verdict,
            )
        files = {"output": output} | ({} if residuals is None else {"residuals": residuals})
        with Outputs() as outputs:
            _write(source, fit, outputs.stage(output), progress.part(0.9, 1.0))
            if residuals is not None:
                adjusted.points.write(
                    outputs.stage(residuals), orientation.with_rpc(fit.rpc), source.grid
                )
    return RefinedRpc(
        fit,
        adjusted.adjustment,
        judged,
        heights,
        ground.note(delivered),
        {name: str(path) for name, path in files.items()},
    )


@dataclass(frozen=True)
class _Adjusted:
    """Points, those of the fit and those to check with as the RPCs see them, and the bias."""

    points: ControlPoints
    control: Control
    check: Control | None
    adjustment: Adjustment

    @classmethod
    def of(
        cls,
        points: ControlPoints,
        source: RasterSource,
        orientation: Orientation,
        model: str,
        method: str,
        largest_residual_px: float,
        seed: int,
    ) -> _Adjusted:
        """Estimate the bias by the points of the fit that are used."""
        size = source.grid.width, source.grid.height
        table = points.points
        seen = points.seen_by(orientation.rpc, size)
        fitted = table.used & ~table.is_check
        checked = table.used & table.is_check
        control = seen.take(fitted)
        try:
            adjustment = adjust(control, model, method, largest_residual_px, seed)
        except TooFewPointsError as error:
            raise NotRegisteredError(
                f"the RPCs of {source.path} were not refined: {error}", refuse(str(error))
            ) from error
        blunders = np.zeros(len(table), bool)
        blunders[np.flatnonzero(fitted)[~adjustment.used]] = True
        points = points.with_points(table.reject(blunders, "blunder"))
        return cls(points, control, seen.take(checked) if checked.any() else None, adjustment)


def _median_above(points: ControlPoints, orientation: Orientation) -> float | None:
    """Return how far points that have heights of their own lie above the ground."""
    above = points.height_m - orientation.heights.at(points.lon_lat)
    above = above[np.isfinite(above) & points.points.used]
    return float(np.median(above)) if len(above) else None


def _write(source: RasterSource, fit: RPCFit, path: Path, progress: Progress) -> None:
    if path.suffix.lower() in _IMAGES:
        tags = rpc_to_tags(fit.rpc)
        write_with_geotransform(source, source.grid, path, rpc_tags=tags, progress=progress)
        return
    write_rpc(path, fit.rpc)
