"""The pipeline: inspect → mask → coarse → match → fit → check → rules → result.

`run` takes images that `opening.open_pair` opened to a judged `Registration`. Every tool that
registers is a preset of it, so what one refuses, all refuse.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..context import Context
from ..errors import NoOverlapError, NothingFoundError, TooFewPointsError
from ..masks.used import NONE, MaskUsed
from ..matching.surveys import Surveys
from ..rasters.reading import bounded_cache
from .evidence import Exchanged, ImagesEvidence, RegistrationEvidence
from .masks import Masked, ground_instead, with_ground_mask
from .opening import OpenPair
from .registration import Registration
from .scene import SceneInfo
from .specification import Specification
from .stages import Stages
from .surface_masks import with_surface_mask
from .verdict import NOT_JUDGED, decide, judge, judge_search


def run(
    opened: OpenPair, spec: Specification, context: Context, scene: SceneInfo | None = None
) -> Registration:
    """Register the input of an open pair to its reference, and judge the result.

    Parameters
    ----------
    opened
        The images.
    spec
        How.
    context
        Threads, progress and seed.
    scene
        What the images are, if that was found before.
    """
    with bounded_cache():
        scene = scene or SceneInfo.of(opened.pair, spec.radar)
        context.update(0.02, "inspecting the images")
        masked = mask_pair(opened, spec, scene, context.part(0.02, 0.12))
        return register(opened, masked, scene, spec, context.part(0.12, 1.0))


def mask_pair(opened: OpenPair, spec: Specification, scene: SceneInfo, context: Context) -> Masked:
    """Return the pair with all masks: the user's, and that of the radar image if one is needed."""
    if spec.surface is not None:
        return with_surface_mask(opened.pair, spec.surface, opened.stack, context)
    if opened.user_mask is not None:
        return Masked(opened.pair, opened.user_mask)
    if spec.surface_view is not None:
        reason = "the surface model is rendered with the layover of the radar image"
        return Masked(opened.pair, MaskUsed(NONE, None, 1.0, reason))
    return with_ground_mask(opened.pair, scene, opened.stack, context)


def begin(opened: OpenPair, masked: Masked, scene: SceneInfo, spec: Specification) -> Registration:
    """Return a registration of which only the images are judged: refused by them, or by no rule."""
    verdict = decide(ImagesEvidence(scene, masked.used), "")
    if verdict.accepted:
        verdict = NOT_JUDGED
    return Registration(masked.pair, spec, scene, masked.used, verdict, started=opened.started)


def register(
    opened: OpenPair, masked: Masked, scene: SceneInfo, spec: Specification, context: Context
) -> Registration:
    """Register a pair whose masks and facts are found; parameters as `run` and its stages.

    What is refused as a whole, as elevated objects may cause, is tried again by the ground of a
    radar image.
    """
    found = _register_once(opened, masked, scene, spec, context)
    is_whole = masked.used.kind == NONE and not spec.is_rendered
    if found.verdict.is_final or not is_whole:
        return found
    ground = ground_instead(opened.pair, scene, opened.stack, context)
    if ground is None:
        return found
    spec = replace(spec, tries=spec.tries + 1)
    again = _register_once(opened, ground, scene, spec, context.quiet())
    return again if again.verdict.accepted else replace(found, spec=spec)


def _register_once(
    opened: OpenPair, masked: Masked, scene: SceneInfo, spec: Specification, context: Context
) -> Registration:
    result = begin(opened, masked, scene, spec)
    if result.verdict.rule:
        return result
    stages = Stages.of(opened.images, masked, spec)
    try:
        estimate, check = stages.checked(context.part(0.0, 0.9))
        surveys = stages.survey(estimate, scene, context.part(0.9, 1.0))
    except (NothingFoundError, TooFewPointsError) as error:
        return replace(result, verdict=judge_search(error))
    evidence = stages.evidence(estimate, check, surveys, scene)
    verdict = judge(evidence)
    if verdict.accepted and _asks_for_exchange(evidence, scene, spec):
        exchanged = _exchanged(opened, masked, scene, spec, evidence, context.quiet())
        evidence = replace(evidence, exchanged=exchanged)
        verdict = judge(evidence)
    return replace(result, verdict=verdict, check=check, evidence=evidence)


def _asks_for_exchange(
    evidence: RegistrationEvidence, scene: SceneInfo, spec: Specification
) -> bool:
    """Whether so few check points confirm a transform that the exchanged pair must, too.

    What is rendered, or located by a sensor model, is no reference for another image.
    """
    if not evidence.needs_second_confirmation or evidence.mask.is_ground:
        return False
    is_plain = spec.surface is None and spec.dem is None and not spec.is_rendered
    return is_plain and not scene.input.is_in_sensor_geometry


def _exchanged(
    opened: OpenPair,
    masked: Masked,
    scene: SceneInfo,
    spec: Specification,
    evidence: RegistrationEvidence,
    context: Context,
) -> Exchanged:
    """Return what the pair with exchanged roles shows of a transform."""
    try:
        stages = Stages.of(opened.images.exchanged(), masked.exchanged(), spec)
        estimate, check = stages.checked(context)
    except (NothingFoundError, TooFewPointsError, NoOverlapError):
        return Exchanged()
    points = stages.evidence(estimate, check, Surveys(), scene).held_out
    px, input = evidence.grid.lattice(), evidence.estimate.transform.input_grid
    there = input.pixel_to_map(evidence.estimate.transform(evidence.grid.pixel_to_map(px)))
    reference = estimate.transform.input_grid
    back = evidence.grid.map_to_pixel(reference.pixel_to_map(estimate.transform(there)))
    apart_px = float(np.sqrt(np.mean(np.sum((back - px) ** 2, axis=1))))
    return Exchanged(points.agreeing, points.total, points.log10_chance, apart_px)
