"""Extract ground control for an image with RPCs from a reference image and a terrain model."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from ..declaration import Output as ResultOutput
from ..declaration import tool
from ..kinds import VectorOut
from ..masks.choice import NONE, REFERENCE, MaskUsed
from ..progress import SILENT, Progress
from ..rasters.atomic import Outputs
from ..rasters.reading import bounded_cache
from ..registration.classifying import Classifying
from ..registration.ground_control import Matching, match_ground_control, open_reference
from ..registration.masking import MaskRequest
from ..registration.sensor_input import Ground, open_oriented_image
from ..registration.verdict import Verdict
from ..sensor.control_points import SUFFIXES, ControlPoints
from ..similarity.surface import SimilaritySettings
from .classifier_parameters import InputClassifier
from .common import (
    ChipSize,
    HighPercent,
    LowPercent,
    MatchingPixelSize,
    Reference,
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
class GcpResult:
    """What `extract_gcps` found.

    Parameters
    ----------
    points
        The points, check points included.
    verdict
        Whether they can be trusted, by the check points.
    mask
        The mask that was used.
    output
        The file.
    heights
        Which heights were used, in words.
    """

    points: ControlPoints
    verdict: Verdict
    mask: MaskUsed
    output: Path
    heights: str

    def summary(self) -> dict[str, Any]:
        """Return the result as values that JSON can carry."""
        return {
            "output": str(self.output),
            "points": len(self.points),
            "points_used": int(self.points.points.used.sum()),
            "heights": self.heights,
            "mask": self.mask.summary(),
            "verdict": self.verdict.summary(),
        }

    def lines(self) -> list[str]:
        """Return the result as lines of text."""
        table, verdict = self.points.points, self.verdict
        return [
            f"accepted: {verdict.reason}",
            f"{int((table.used & ~table.is_check).sum())} of {int((~table.is_check).sum())} "
            f"points, and {int((table.used & table.is_check).sum())} check points",
            f"error at check points: RMSE {verdict.check_rmse_px:.2f} px "
            f"({verdict.check_rmse_m:.2f} m)",
            self.heights,
            self.mask.line(),
            f"wrote {self.output}",
        ]


@tool(
    title="Extract ground control",
    group="Sensor models",
    outputs=(
        ResultOutput("POINTS", "Number of points that are used", "points_used"),
        ResultOutput("CHECK_RMSE_PX", "Error at check points (px)", "verdict.check_rmse_px"),
    ),
)
def extract_gcps(
    image: SensorImage,
    reference: Reference,
    output: Annotated[
        Path,
        VectorOut(
            label="Ground control points",
            help="Points with position in the image and on the map, height, covariance and scores; "
            ".txt holds options of gdal_translate.",
            suffixes=SUFFIXES,
        ),
    ],
    dem: Dem = None,
    dem_datum: DemDatum = None,
    search_radius: SearchRadius = None,
    max_error: MaxError = 3.0,
    similarity: Similarity = "fused",
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
) -> GcpResult:
    """Extract ground control for an image with RPCs from a reference image and a terrain model.

    The image is projected onto the reference's map by its RPCs and matched there as coregister
    does; what is found is carried back into the image. A rough error of the RPCs within the search
    radius is found first. Held-out points decide whether the points can be trusted; if not,
    nothing is written.
    """
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
    with ExitStack() as stack:
        stack.enter_context(bounded_cache())
        located = open_reference(reference, reference_band, reference_mask, stack)
        crs = located.source.grid.crs
        sensor = open_oriented_image(image, rpc, ground, crs, stack, progress)
        with ThreadPoolExecutor(worker_count(workers)) as executor:
            found = match_ground_control(sensor, located, matching, executor, stack, progress)
        points = found.accepted()
        with Outputs() as outputs:
            points.write(outputs.stage(output), sensor.orientation, sensor.source.grid)
    return GcpResult(points, found.registration.verdict, found.mask, output, sensor.heights)
