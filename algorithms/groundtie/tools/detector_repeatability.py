"""How well feature detectors and descriptors do on a registered pair."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from ..context import threads
from ..declaration import file_lines, given_files, tool
from ..errors import NoOverlapError, ParameterError
from ..geometry.transform import Transform, load_transform
from ..kinds import Choice, FileIn, FileOut, Number, Text
from ..progress import SILENT, Progress
from ..rasters.atomic import Outputs, write_csv, write_json
from ..rasters.grid import require_both_or_none
from ..rasters.pair import ImagePair
from ..rasters.patch import Patch, middle_window
from ..registration.opening import open_pair
from ..registration.specification import Specification
from ..registration.stored_transform import transform_of
from ..studies.evaluation import Evaluation, Variant, evaluate
from ..studies.matching import METHODS
from ..studies.repeatability import CLASS_NAMES
from ..studies.repeatability_picture import draw_evaluations
from .parameters import general, registration


@dataclass(frozen=True)
class RepeatabilityResult:
    """What `detector_repeatability` measured.

    Parameters
    ----------
    evaluations
        One for each variant.
    files
        What was written, by name.
    """

    evaluations: tuple[Evaluation, ...]
    files: dict[str, str]

    def summary(self) -> dict[str, Any]:
        """Return the result as values that JSON can carry."""
        return {
            "variants": [one.summary() for one in self.evaluations],
            "files": self.files,
        }

    def lines(self) -> list[str]:
        """Return the result as lines of text."""
        return [
            *(
                f"{one.variant}: {one.detections[0]} and {one.detections[1]} features, "
                f"{one.repeated[0]:.0%} repeat within {CLASS_NAMES[0]} overlap error; "
                f"{one.matched.matches} matches, {one.filtered.matches} after filtering; "
                f"{one.detecting_s + one.matching_s:.2f} s"
                for one in self.evaluations
            ),
            *file_lines(self.files),
        ]


@tool(title="Repeatability of detectors", group="Quality")
def detector_repeatability(
    reference: general.Reference,
    input: general.Input,
    output: Annotated[
        Path,
        FileOut(
            label="Table",
            help="What was measured, a row for each variant.",
            suffixes=(".csv",),
        ),
    ],
    variants: Annotated[
        str,
        Text(
            help="What is compared, separated by commas: each a detector (sift, sift-oct, "
            "sift-isef-oct), and if need be a gradient (differences, recursive, roewa, "
            "roewa-unsigned) and oriented for descriptors that turn with the image, joined by +.",
        ),
    ] = "sift,sift-oct,sift-isef-oct",
    transform: Annotated[
        Path | None,
        FileIn(
            help="The registration, from reference to input. Without it the input's own "
            "georeferencing is believed.",
            suffixes=(".json",),
        ),
    ] = None,
    ratio: Annotated[
        float,
        Number(
            label="Largest ratio",
            help="Largest ratio of the distances to the nearest and to the next best feature.",
            minimum=0.1,
            maximum=1.0,
        ),
    ] = 0.8,
    picture: Annotated[
        Path | None,
        general.picture("Repeatability and matches by class of overlap error, to look at."),
    ] = None,
    numbers: Annotated[
        Path | None,
        FileOut(help="The same as the table, as JSON.", suffixes=(".json",)),
    ] = None,
    size: Annotated[
        int,
        Number(
            help="Largest side of the piece in the middle of the overlap that is looked at.",
            unit="px",
            integer=True,
            minimum=64,
            maximum=4096,
        ),
    ] = 2000,
    contrast: Annotated[
        float | None,
        Number(
            label="Least contrast",
            help="Weaker features are left out: a share of the range of grey values, as OpenCV "
            "counts it; by default as fits each detector.",
            minimum=0.0,
            maximum=1.0,
            advanced=True,
        ),
    ] = None,
    method: Annotated[
        str,
        Choice(
            label="Matching",
            help="Whether nearest features are found approximately by k-d trees, or exactly.",
            choices=METHODS,
            advanced=True,
        ),
    ] = METHODS[-1],
    reference_band: general.ReferenceBand = None,
    input_band: general.InputBand = None,
    reference_mask: registration.ReferenceMask = None,
    input_mask: registration.InputMask = None,
    matching_pixel_size: general.MatchingPixelSize = None,
    progress: Progress = SILENT,
) -> RepeatabilityResult:
    """Measure how well feature detectors and descriptors do on a registered pair.

    Features are circles as large as their scale. Those of both images correspond if their circles
    overlap; the smaller the error of the overlap, the better they repeat. Features are then matched
    by their descriptors alone, and the worst matches dropped until the rest agree on an affine
    model.
    """
    chosen = [Variant.parse(name.strip(), contrast) for name in variants.split(",")]
    if len({variant.name for variant in chosen}) < len(chosen):
        raise ParameterError(f"a variant is named twice: {variants}")
    spec = Specification(search_radius_m=0.0, matching_pixel_size_m=matching_pixel_size)
    bands, masks = (reference_band, input_band), (reference_mask, input_mask)
    with (
        threads(progress=progress) as context,
        open_pair(reference, input, spec, context.part(0.0, 0.1), bands, masks) as opened,
    ):
        pair = opened.images
        known = None
        if transform is not None:
            known = transform_of(load_transform(transform), pair.input.source, transform)
            names = f"{pair.reference.source.path} and {transform}"
            require_both_or_none(pair.grid.crs, known.crs, names)
        parts = None
        if opened.pair.is_masked:
            reference_part, input_part = _read(opened.pair, known, size)
            parts = reference_part.valid, input_part.valid
        patches = _both_valid(*_read(pair, known, size))
    evaluations = []
    for i, variant in enumerate(chosen):
        progress.update(0.1 + 0.8 * i / len(chosen), f"trying {variant.name}")
        evaluations.append(evaluate(variant, *patches, ratio, method, parts))
    files = {"output": output, "picture": picture, "numbers": numbers}
    result = RepeatabilityResult(tuple(evaluations), given_files(files))
    progress.update(0.9, "writing")
    rows = [_row(one) for one in evaluations]
    with Outputs() as outputs:
        write_csv(outputs.stage(output), rows[0], rows)
        if picture is not None:
            draw_evaluations(outputs.stage(picture), evaluations)
        if numbers is not None:
            write_json(outputs.stage(numbers), result.summary())
    return result


def _read(pair: ImagePair, transform: Transform | None, largest: int) -> tuple[Patch, Patch]:
    """Return the middle of the overlap in both images, the input resampled onto the reference."""
    grid = pair.grid
    piece = grid.window(*middle_window(grid, largest))
    reference = pair.reference_patch(piece)
    to_px = pair.nominal_px if transform is None else transform.of_map(grid.crs)
    return reference, pair.input_patch(piece, to_px)


def _both_valid(reference: Patch, input: Patch) -> tuple[Patch, Patch]:
    """Return two patches without what one shows alone: features there cannot repeat.

    Raises
    ------
    NoOverlapError
        They show nothing together.
    """
    both = reference.valid & input.valid
    if not both.any():
        raise NoOverlapError("where the images overlap nominally, they show nothing together")
    return Patch(reference.values, both), Patch(input.values, both)


def _row(one: Evaluation) -> dict[str, Any]:
    row: dict[str, Any] = {
        "variant": one.variant,
        "reference_features": one.detections[0],
        "input_features": one.detections[1],
    }
    row |= _by_class("repeatability", [f"{score:.4f}" for score in one.repeated])
    for name, part in (("matches", one.matched), ("filtered", one.filtered)):
        row[name] = part.matches
        row[f"{name}_std_x_px"], row[f"{name}_std_y_px"] = (f"{std:.3f}" for std in part.std_px)
        row |= _by_class(name, part.by_class.tolist())
    row["detecting_s"], row["matching_s"] = f"{one.detecting_s:.4f}", f"{one.matching_s:.4f}"
    return row


def _by_class(name: str, values: Sequence[Any]) -> dict[str, Any]:
    columns = (
        cls.replace(" %", "").replace("–", "_").replace("> ", "over_") for cls in CLASS_NAMES
    )
    return {f"{name}_{column}": value for column, value in zip(columns, values, strict=True)}
