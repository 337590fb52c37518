"""The pipeline: inspect → mask → coarse → match → fit → check → rules → result.

`run` turns images that `opening.open_pair` opened into a judged `Registration`. Every tool that
registers is a preset of it, so all tools refuse by the same rules.
"""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace

import numpy as np

from ..context import Context
from ..errors import NoOverlapError, NothingFoundError, TooFewPointsError
from ..geometry.estimation import Estimate
from ..geometry.tie_points import TiePoints
from ..geometry.transform import Transform
from ..masks.used import NONE, MaskUsed
from ..matching.check import Check
from ..matching.surface_fit import FIT_RADIUS_PX
from .evidence import Agreement, ImagesEvidence, RegistrationEvidence
from .masks import Masked, ground_instead, with_ground_mask
from .opening import OpenPair
from .registration import Registration
from .scene import SceneInfo
from .specification import Specification
from .stages import Stages
from .surface_masks import with_surface_mask
from .verdict import NOT_JUDGED, Verdict, decide, judge, judge_search


def run(
    opened: OpenPair, spec: Specification, context: Context, scene: SceneInfo | None = None
) -> Registration:
    """Register the input of an open pair to its reference, and judge the result.

    Parameters
    ----------
    opened
        The images.
    spec
        How they are registered.
    context
        Threads, progress and seed.
    scene
        Facts about the images, if they were found before.
    """
    context.update(0.02, "inspecting the images")
    masked = mask_pair(opened, spec, context.part(0.02, 0.12), scene)
    return register(opened, masked, spec, context.part(0.12, 1.0))


def mask_pair(
    opened: OpenPair, spec: Specification, context: Context, scene: SceneInfo | None = None
) -> Masked:
    """Return the pair with all masks: the user's, and that of the radar image if one is needed.

    Parameters as `run`.
    """
    scene = scene or SceneInfo.of(opened.pair, spec.radar)
    scene.prepare(context.quiet())
    if spec.surface is not None:
        return with_surface_mask(opened.pair, scene, spec.surface, opened.stack, context)
    if opened.user_mask is not None:
        return Masked(opened.pair, scene, opened.user_mask)
    if spec.surface_view is not None:
        reason = "the surface model is rendered with the layover of the radar image"
        return Masked(opened.pair, scene, MaskUsed.none(reason))
    return with_ground_mask(opened.pair, scene, opened.stack, context)


def begin(opened: OpenPair, masked: Masked, spec: Specification) -> Registration:
    """Return a registration judged by its images alone: refused, or not judged yet."""
    scene, used = masked.scene, masked.used
    verdict = decide(ImagesEvidence(scene, used, spec.largest_error_px))
    if verdict.accepted:
        verdict = NOT_JUDGED
    return Registration(masked.pair, spec, scene, used, verdict, started=opened.started)


def register(
    opened: OpenPair, masked: Masked, spec: Specification, context: Context
) -> Registration:
    """Register a pair whose masks and facts are found; parameters as `run` and its stages.

    If the whole pair is refused, as elevated objects may cause, the ground alone that a radar image
    shows is tried.
    """
    found = _register_once(opened, masked, spec, context)
    is_whole = masked.used.kind == NONE and not spec.is_rendered
    if found.verdict.is_final or not is_whole:
        return found
    ground = ground_instead(opened.pair, masked.scene, opened.stack, context)
    if ground is None:
        return found
    spec = replace(spec, tries=spec.tries + 1)
    again = _register_once(opened, ground, spec, context.quiet())
    return again if again.verdict.accepted else replace(found, spec=spec)


def _register_once(
    opened: OpenPair, masked: Masked, spec: Specification, context: Context
) -> Registration:
    result = begin(opened, masked, spec)
    if result.verdict.rule:
        return result
    stages = Stages.of(opened.images, masked, spec)
    try:
        estimate, check = stages.checked(context.part(0.0, 0.9))
        evidence, verdict = judge_estimate(stages, estimate, check, context.part(0.9, 1.0))
    except (NothingFoundError, TooFewPointsError) as error:
        return replace(result, verdict=judge_search(error))
    return replace(result, verdict=verdict, check=check, evidence=evidence)


def judge_estimate(
    stages: Stages, estimate: Estimate, check: Check, context: Context
) -> tuple[RegistrationEvidence, Verdict]:
    """Return the evidence and the verdict on an estimate, wherever it comes from.

    Parameters
    ----------
    stages
        The stages of the pair.
    estimate, check
        The model, and the check points around it.
    context
        Threads and progress.

    Raises
    ------
    TooFewPointsError
        A mask leaves too few pixels to match.
    """
    evidence = stages.evidence(estimate, check, stages.survey(estimate, context))
    verdict = judge(evidence)
    if verdict.accepted and _asks_for_exchange(evidence, stages.spec):
        evidence = replace(evidence, exchanged=_exchanged(stages, evidence, context.quiet()))
        verdict = judge(evidence)
    return evidence, verdict


def _asks_for_exchange(evidence: RegistrationEvidence, spec: Specification) -> bool:
    """Whether so few check points confirm a transform that those of the exchanged pair must, too.

    An image that is rendered or located by a sensor model cannot be a reference for another one.
    """
    if not evidence.needs_second_confirmation or evidence.mask.leaves_little:
        return False
    is_plain = spec.surface is None and spec.dem is None and not spec.is_rendered
    return is_plain and not evidence.scene.input.is_in_sensor_geometry


def _exchanged(stages: Stages, evidence: RegistrationEvidence, context: Context) -> Agreement:
    """Return how check points of the pair with exchanged roles agree with a transform.

    The check points lie in the other image, around the result of a coarse search of their own.
    There are none if the two results are farther apart than tie points are searched for.
    """
    pair = stages.masked.pair
    reference, input = pair.reference.source.grid, pair.input.source.grid
    points = TiePoints.none()
    with suppress(NothingFoundError, TooFewPointsError, NoOverlapError):
        exchanged = stages.exchanged()
        coarse = Transform(exchanged.coarse(context), input.crs, reference)
        if _apart_px(evidence, coarse) <= FIT_RADIUS_PX:
            points = exchanged.check(coarse.model, context).points
    return replace(evidence, check=points.exchanged(reference, input)).held_out


def _apart_px(evidence: RegistrationEvidence, way_back: Transform) -> float:
    """Return the largest distance from the start after a transform and another one back."""
    grid, transform = evidence.grid, evidence.estimate.transform
    px = grid.places()
    there = transform.input_grid.pixel_to_map(transform(grid.pixel_to_map(px)))
    back = grid.map_to_pixel(way_back.input_grid.pixel_to_map(way_back(there)))
    return float(np.hypot(*(back - px).T).max())
