"""Rules for images of towns, on whether the ground or the roofs matched."""

from __future__ import annotations

import numpy as np

from ...masks.used import GROUND
from ...similarity.in_common import LEAST_AREA
from ..evidence import RegistrationEvidence
from ..surface_masks import CLEAR_CORRELATION, RENDERED_CORRELATION
from .rule import ON_GROUND, Rule

# Fewest agreeing sums of check chips: an oblique view displaces fit and check points alike. Errors
# by grey levels in the suite rpc_city: up to 6 px where four sums all agree, as in images of
# 700 px; below 1 px with five and more. Errors by colours: where three agree, up to 2.7 px there,
# and 3.8 px in smaller images (suite attacks); where four do, up to 2.4 px.
_FEWEST_GREY, _FEWEST_IN_COLOURS = 5, 4

# From this share of agreeing check points on, more agree than roofs alone do. Measured where a
# town was matched whole and a wrong registration accepted: 28 to 56 %; on other scenes with
# as many strong scatterers: from 72 % (suite city).
_CLEAR_SHARE = 2 / 3


def _few_on_ground(evidence: RegistrationEvidence) -> str | None:
    scene = evidence.scene
    if evidence.mask.kind != GROUND or not scene.input.is_in_sensor_geometry:
        return None
    agreeing, has_colours = evidence.held_out.agreeing, scene.other.has_colours
    if agreeing >= (_FEWEST_IN_COLOURS if has_colours else _FEWEST_GREY):
        return None
    how = "oblique" if has_colours else "oblique and without colours"
    return f"only {agreeing} check points on the ground agree, where the view is {how}"


def _surface_elsewhere(evidence: RegistrationEvidence) -> str | None:
    if not evidence.mask.is_reliable:
        return "the reference does not show the elevated objects of the surface model"
    fit = evidence.input_fit
    if fit is None:
        return None
    if not fit.is_clear:
        return "the registered input does not show the elevated objects of the surface model"
    off_px = float(np.hypot(*fit.offset_px))
    if off_px <= evidence.max_error_px:
        return None
    return (
        f"the registered input shows the elevated objects of the surface model {off_px:.1f} px off"
    )


def _town_matched_whole(evidence: RegistrationEvidence) -> str | None:
    points, rest = evidence.held_out, evidence.surveys.rest
    if evidence.mask.is_ground or not evidence.scene.may_be_town:
        return None
    if points.agreeing >= _CLEAR_SHARE * points.total:
        return None
    if rest is not None and rest.shared.is_of_cameras:
        return None
    return (
        f"only {points.agreeing} of {points.total} check points agree, as roofs may, and an image "
        "has as many strong scatterers as a radar's of a town"
    )


SCENE_RULES: tuple[Rule, ...] = (
    Rule(
        "few points on the ground",
        f"fewer than {_FEWEST_IN_COLOURS} check points agree, {_FEWEST_GREY} without colours, "
        "where an image with RPCs is matched on the ground alone that was found in a radar image",
        "suites rpc_city and attacks",
        ON_GROUND,
        _few_on_ground,
        is_final=True,
    ),
    Rule(
        "surface model elsewhere",
        "the reference or the registered input correlates by less than "
        f"{CLEAR_CORRELATION:g} ({RENDERED_CORRELATION:g} where the surface model is the "
        "reference) with the image expected from the surface model and the view, or the input "
        "correlates best at a place farther off than the largest error",
        "suite towns",
        "give the surface model of this place and the right views, or leave it out",
        _surface_elsewhere,
        is_final=True,
    ),
    Rule(
        "town matched whole",
        f"less than {_CLEAR_SHARE:.0%} of the check points agree, an image may be a radar image of "
        f"a town, less than {LEAST_AREA:.0%} of coarse pixels vary alike, and more than the ground "
        "was matched",
        "suite city",
        f"if it is a town, give the radar image unfiltered; {ON_GROUND}",
        _town_matched_whole,
    ),
)
