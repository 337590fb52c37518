"""Descent of the image pyramid: from the coarse shift to a model from which tie points start."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..context import Context
from ..errors import AmbiguousPlaceError, NothingFoundError
from ..geometry.judging import RIVAL_HEIGHT
from ..geometry.models import Model
from ..rasters.grid import Grid
from ..rasters.held_images import held_on_level
from .chips import ChipMatcher
from .coarse_shift import SAME_PLACE_PX, Candidate, LevelSearch, level_factor
from .level_fit import CoarseModel, fit_level, fit_level_pooled
from .pooled import PooledHistogramMatcher
from .surface_fit import FIT_RADIUS_PX, SurfaceMatcher

# With expected false alarms (log10) below this, a candidate is certain: others that are too low to
# be rivals are not tried.
_CERTAIN = -6.0

# Repetitive scenes match at several places. A candidate nearly as high as the best is tried, and
# is a rival if chips support it with at least half the evidence (log10).
_RIVAL_EVIDENCE = 0.5

# Above this number of expected false alarms (log10), nothing was found. Local matches may still
# succeed where large chips failed, and the verdict checks their result.
_HOPELESS = 0.0

# Search radius of chips around a candidate, in pixels of the level.
_RADIUS_PX = 12

# Largest error of a level's model, in pixels of that level, and the distortion that it leaves
# unmodelled, in pixels of the level that is searched.
_LEVEL_ERROR_PX, _DISTORTION_PX = 2.0, 4

# Largest ratio of pixel sizes between successive levels.
_STEP = 4.0

# The ratio for masked chips, which have too little evidence for the larger search radius.
_POOLED_STEP = 2.0


def find_coarse_model(matcher: SurfaceMatcher, context: Context) -> Model:
    """Return a model of degree 1 on the map, from which tie points can be searched for.

    Parameters
    ----------
    matcher
        Matches tie points, without the held-out blocks. Its pair holds the limits on how far the
        input may lie from its nominal place.
    context
        Threads and progress.

    Raises
    ------
    NothingFoundError
        No candidate is better than chance.
    AmbiguousPlaceError
        Another place matches about as well.
    """
    pair = matcher.pair
    factor = level_factor(pair.grid)
    level = pair.grid.scaled(factor)
    if pair.limits.is_shift:  # others look at larger and smaller pixels, too
        pair = held_on_level(pair, level, context.quiet())
    search = LevelSearch(pair, level, matcher.settings, matcher.held_out, context)
    candidates = search.candidates()
    context.update(0.3)
    if isinstance(matcher, PooledHistogramMatcher):
        return _descend_pooled(matcher, candidates, factor, context)
    return _descend(matcher, replace(matcher, pair=pair), candidates, factor, context)


def _descend(
    matcher: ChipMatcher,
    coarsest: ChipMatcher,
    candidates: list[Candidate],
    factor: float,
    context: Context,
) -> Model:
    """Refine the model that chips agree on, level by level; the coarsest has its own matcher."""
    grid, quiet = matcher.pair.grid, context.quiet()
    level = grid.scaled(factor)
    tried: list[CoarseModel] = []
    for candidate in candidates:
        is_certain = any(one.log10_false_alarms < _CERTAIN for one in tried)
        if is_certain and candidate.height < RIVAL_HEIGHT * candidates[0].height:
            break
        tried.append(fit_level(coarsest, level, candidate.model, _RADIUS_PX, quiet))
    best = min(tried, key=lambda one: one.log10_false_alarms, default=None)
    if best is None or best.log10_false_alarms > _HOPELESS:
        raise NothingFoundError("nothing in common was found")
    _require_no_rival(best, tried, level)
    while not _reaches_tie_points(factor):
        finer_factor = max(factor / _STEP, 1.0)
        finer_level = grid.scaled(finer_factor)
        finer = fit_level(matcher, finer_level, best.model, _reach_px(factor / finer_factor), quiet)
        if finer.log10_false_alarms < _HOPELESS:
            best = finer
        factor = finer_factor
    return best.model


def _descend_pooled(
    matcher: PooledHistogramMatcher, candidates: list[Candidate], factor: float, context: Context
) -> Model:
    """Refine the model that the ground as a whole agrees on, level by level."""
    if not candidates:
        raise NothingFoundError("nothing in common was found")
    best, *others = candidates
    if others and others[0].height > RIVAL_HEIGHT * best.height:
        raise AmbiguousPlaceError("two places match about as well")
    model = best.model
    while not _reaches_tie_points(factor):
        factor = factor / _POOLED_STEP
        level = matcher.pair.grid.scaled(factor)
        model = fit_level_pooled(matcher, level, model, _reach_px(_POOLED_STEP), context.quiet())
    return model


def _reach_px(factor: float) -> int:
    """Return the search radius, in pixels, around the model of a level `factor` times coarser."""
    return int(np.ceil(_LEVEL_ERROR_PX * factor)) + _DISTORTION_PX


def _reaches_tie_points(factor: float) -> bool:
    """Whether the search for tie points covers the error of a level's model."""
    return _reach_px(factor) <= FIT_RADIUS_PX


def _require_no_rival(best: CoarseModel, tried: list[CoarseModel], level: Grid) -> None:
    centre = level.pixel_to_map([level.centre_px])
    for other in tried:
        apart = level.map_to_pixel(other.model(centre)) - level.map_to_pixel(best.model(centre))
        distance_px = float(np.hypot(*apart[0]))
        evident = other.log10_false_alarms < _RIVAL_EVIDENCE * best.log10_false_alarms
        if distance_px > SAME_PLACE_PX and evident:
            distance = distance_px * level.pixel_size_m
            raise AmbiguousPlaceError(f"two places match about as well, {distance:.0f} m apart")
