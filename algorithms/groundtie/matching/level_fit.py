"""Refinement of a model of degree 1 by the chips of one level of the image pyramid."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..context import Context
from ..errors import TooFewPointsError
from ..geometry.accuracy import NEIGHBOUR_SPACINGS
from ..geometry.chance import agreement_probability, log10_false_alarms
from ..geometry.judging import TOLERANCE_PX
from ..geometry.models import PARAMETERS, Model, fewest_points
from ..geometry.robust import distances, find_consensus
from ..rasters.grid import Grid
from ..similarity.peak import peak_shifts
from .alignment import IDENTITY, LINEAR_CANDIDATES, align
from .belief_propagation import propagate
from .chips import ChipMatcher
from .frames import compose
from .matcher import Places
from .pooled import PooledHistogramMatcher

# Most chips along a side at every level of the pyramid, and their side in pixels of the level.
_CHIPS_PER_SIDE = 7
_CHIP_RANGE_PX = (48, 80)

# Side of the chips that share a joint histogram.
_POOLED_CHIP_PX = 64


@dataclass(frozen=True)
class CoarseModel:
    """A model of the misregistration on the map, and its expected number of false alarms.

    `log10_false_alarms` is log10 of the expected number of models with which random matches would
    agree as well.
    """

    model: Model
    log10_false_alarms: float


def fit_level(
    matcher: ChipMatcher, level: Grid, model: Model, radius_px: int, context: Context
) -> CoarseModel:
    """Match large chips on a level around a model, and fit a model of degree 1 to them.

    Parameters
    ----------
    matcher
        Matches the chips.
    level
        The matching grid at reduced resolution.
    model
        The misregistration on the map as known so far.
    radius_px
        Largest error of the model, in pixels of the level.
    context
        Threads and progress.
    """
    chip = min(int(np.clip(min(level.size) / 5, *_CHIP_RANGE_PX)), *level.size)
    # Chips that overlap by more than half would count the same evidence twice.
    places = Places.spread(
        level, chip, lambda side: min((side - chip) / (chip / 2) + 1, _CHIPS_PER_SIDE)
    )
    images = matcher.resampled(model, level, radius_px, context)
    centres, surfaces = matcher.match_forward(images, places, radius_px, context)
    if len(centres) < 4:
        return CoarseModel(model, np.inf)
    supported = propagate(surfaces, centres, NEIGHBOUR_SPACINGS * places.spacing_px)
    own = peak_shifts(surfaces)
    px = centres.astype(float)
    best = CoarseModel(model, np.inf)
    probability = agreement_probability(TOLERANCE_PX, radius_px)
    found = px + peak_shifts(supported)
    # Simple models are preferred unless the data favour others, as the number of hypotheses counts
    # against each.
    for kind in LINEAR_CANDIDATES:
        fitted = find_consensus(px, found, TOLERANCE_PX, kind)
        # Peaks after belief propagation are not independent; only the chips' own are counted.
        agreeing = int((distances(fitted, px, px + own) < TOLERANCE_PX).sum())
        alarms = log10_false_alarms(agreeing, len(px), probability, fewest_points(kind))
        if alarms < best.log10_false_alarms:
            best = CoarseModel(compose(model, fitted, level), alarms)
    return best


def fit_level_pooled(
    matcher: PooledHistogramMatcher, level: Grid, model: Model, radius_px: int, context: Context
) -> Model:
    """Return an affine model refined by all unmasked content of a level of the pyramid.

    Parameters as `fit_level`.

    Raises
    ------
    TooFewPointsError
        The mask leaves too few pixels.
    """
    coarser = replace(matcher, pooled_chip_px=_POOLED_CHIP_PX)
    places = Places.tiles(level, _POOLED_CHIP_PX)
    found = coarser.match(model, places, radius_px, context)
    if len(found.centres) < PARAMETERS["affine"]:
        raise TooFewPointsError(f"only {len(found.centres)} chips show any ground")
    shift = found.common_shift_px
    aligned = align(["affine"], found.centres, found.weighted, IDENTITY, lambda px: px + shift)
    return compose(model, aligned.model, level)
