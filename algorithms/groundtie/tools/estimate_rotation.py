"""Rotation, scale and shift between two rasters, from no more than coarse limits."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from ..context import threads
from ..declaration import Output, file_lines, given_files, tool
from ..errors import NotRegisteredError, ParameterError
from ..geometry.transform import Transform
from ..kinds import AUTO, Choice, Distance, Number
from ..pose.pose import Pose
from ..pose.rotation_windows import read_windows
from ..progress import SILENT, Progress
from ..rasters.atomic import Outputs, write_json
from ..rasters.pair import Image
from ..rasters.reading import open_raster
from ..registration.pose_verdict import PoseEvidence, confirm_pose
from ..registration.verdict import Verdict, decide
from ..report.correction import turn_in_words
from ..report.rotation_picture import draw_rotation
from ..similarity.surface import SimilaritySettings
from ..studies.pose_searches import DEFAULT_SEARCH, HISTOGRAM_SEARCHES, SEARCHES
from ..wording import signed
from .parameters import general


@dataclass(frozen=True)
class RotationResult:
    """What `estimate_rotation` found.

    Parameters
    ----------
    verdict
        Whether it can be trusted.
    evidence
        What an exhaustive search found beside it.
    pose
        Rotation and scale; the shift is in pixels of the windows.
    right, down
        How far the input's content lies off, in metres (in input pixels without
        georeferencing).
    unit
        "m" or "px".
    transform
        Reference map position ↔ input pixel position.
    search
        How it was found.
    files
        What was written, by name.
    """

    verdict: Verdict
    evidence: PoseEvidence
    pose: Pose
    right: float
    down: float
    unit: str
    transform: Transform
    search: str
    files: dict[str, str]

    def summary(self) -> dict[str, Any]:
        """Return the result as values that JSON can carry."""
        return {
            "rotation_deg": self.pose.rotation_deg,
            "scale": self.pose.scale,
            "shift": {"right": self.right, "down": self.down, "unit": self.unit},
            "verdict": self.verdict.summary() | self.evidence.summary(),
            "search": self.search,
            "transform": self.transform.to_json(),
            "files": self.files,
        }

    def lines(self) -> list[str]:
        """Return the result as lines of text."""
        return [
            f"rotation: {turn_in_words(self.pose.rotation_deg) or 'none'}",
            f"scale: {self.pose.scale:.4f}",
            f"shift: {signed(self.right)} {self.unit} right, {signed(self.down)} {self.unit} down",
            f"accepted: {self.verdict.reason}; height {self.evidence.height:.1f}, "
            f"{self.evidence.rival_ratio:.2f} times that of the best elsewhere",
            self.verdict.accuracy_line(),
            *file_lines(self.files),
        ]


@tool(
    title="Estimate rotation and scale",
    group="Registration",
    outputs=(
        Output("ROTATION", "Rotation (°)", "rotation_deg"),
        Output("SCALE", "Scale", "scale"),
        Output("RIGHT", "Shift to the right", "shift.right"),
        Output("DOWN", "Shift downwards", "shift.down"),
        Output("HEIGHT", "Height over chance", "verdict.height"),
        Output("RIVAL_RATIO", "Height over that of the best elsewhere", "verdict.rival_ratio"),
        Output("CE90_PX", "CE90 of the pose (px)", "verdict.ce90_px"),
    ),
)
def estimate_rotation(
    reference: general.Reference,
    input: general.Input,
    search: Annotated[
        str,
        Choice(
            help="How the pose is searched for: rotation-steps, which all registrations use, tries "
            "everything and is the only one that is meant for SAR with optical images. The others "
            "are there to compare: fourier-mellin finds any rotation and scale, radon rotations, "
            "phase-correlation shifts alone; the rest climb mutual information from the nominal "
            "position.",
            choices=tuple(SEARCHES),
        ),
    ] = DEFAULT_SEARCH,
    largest_rotation: Annotated[
        float,
        Number(
            help="Largest rotation either way; 180 allows any.",
            unit="°",
            minimum=0,
            maximum=180,
        ),
    ] = 180.0,
    smallest_scale: Annotated[
        float,
        Number(
            help="Least length of a reference's pixel in pixels of the input; of georeferenced "
            "images, against the nominal one.",
            minimum=0.25,
            maximum=4,
        ),
    ] = 0.5,
    largest_scale: Annotated[
        float,
        Number(
            help="See the smallest scale.",
            minimum=0.25,
            maximum=4,
        ),
    ] = 2.0,
    search_radius: Annotated[
        float | None,
        Distance(
            help="How far the input may lie from its nominal position, along rows and columns; "
            "without georeferencing, how far the images' centres are apart, in input pixels. By "
            "default a quarter of the input's longer side.",
        ),
    ] = None,
    transform: general.TransformOut = None,
    picture: Annotated[
        Path | None,
        general.picture(
            "How well all poses match, and the images on one another; it is drawn for a "
            "refused pose, too.",
        ),
    ] = None,
    similarity: Annotated[
        str,
        Choice(
            help="What is compared; auto takes what fits the search: mutual information where "
            "it climbs, else the orientation of edges. The search rotation-steps always takes "
            "the latter; ncc compares grey values.",
            choices=(AUTO, "orientation", "ncc", "nmi"),
            advanced=True,
        ),
    ] = AUTO,
    reference_band: general.ReferenceBand = None,
    input_band: general.InputBand = None,
    workers: general.Workers = None,
    progress: Progress = SILENT,
) -> RotationResult:
    """Estimate rotation, scale and shift between two rasters of the same place.

    Images with georeferencing are compared at their nominal positions: what is found is by how
    much the input is rotated, scaled and shifted against that. Images without it are compared
    pixel by pixel, from centre to centre. Large images are reduced to some 500 pixels, so that
    what is found is a start for a registration, not its end.

    Whatever the search, its pose is accepted only if an exhaustive search over all rotations
    finds it, too, and nothing nearly as good elsewhere, and if pieces all over the images match
    there, each by itself.
    """
    if smallest_scale > largest_scale:
        raise ParameterError("the smallest scale is larger than the largest")
    settings = SimilaritySettings(_similarity(search, similarity))
    scales = smallest_scale, largest_scale
    with (
        threads(workers, progress) as context,
        Outputs() as outputs,
        ExitStack() as opened,
    ):
        context.update(0.0, "reading")
        rasters = (reference, reference_band), (input, input_band)
        own, other = (
            Image(opened.enter_context(open_raster(path)), band) for path, band in rasters
        )
        windows = read_windows(own, other, scales, search_radius)
        pair, limits = (windows.reference, windows.input), windows.limits(largest_rotation, scales)
        context.update(0.1, "searching")
        found = SEARCHES[search](*pair, limits, settings, context.quiet())
        context.update(0.5, "checking")
        exhaustive = search == DEFAULT_SEARCH
        evidence = PoseEvidence.of(pair, limits, found, exhaustive, context.quiet())
        verdict = decide(evidence)
        pose = found[0].pose if found else None
        if verdict.accepted and pose is not None:
            verdict, pose = confirm_pose((own, other), windows, pose, context.quiet())
        context.update(0.8, "writing")
        if picture is not None:
            title = f"{verdict.word}: {verdict.reason}"
            draw_rotation(outputs.stage(picture), *pair, limits, pose, title, context.quiet())
        if verdict.accepted and pose is not None:
            found_transform = windows.transform(pose)
            if transform is not None:
                write_json(outputs.stage(transform), found_transform.to_json())
            right, down = (float(shift) * windows.pixel_m for shift in pose.shift_px)
            unit = "m" if windows.is_georeferenced else "px"
            files = given_files({"transform": transform, "picture": picture})
            return RotationResult(
                verdict, evidence, pose, right, down, unit, found_transform, search, files
            )
    raise NotRegisteredError(
        f"no rotation of {input} against {reference} was found: {verdict.sentence()}", verdict
    )


def _similarity(search: str, wanted: str) -> str:
    if wanted == AUTO:
        return "nmi" if search in HISTOGRAM_SEARCHES else "orientation"
    if search in HISTOGRAM_SEARCHES and wanted != "nmi":
        raise ParameterError(f"the search {search} needs the similarity nmi")
    return wanted
