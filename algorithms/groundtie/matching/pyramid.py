"""Down the image pyramid: from the rough shift to a model that tie points can start from."""

from __future__ import annotations

from concurrent.futures import Executor

import numpy as np

from ..errors import NothingFoundError
from ..geometry.models import Model
from ..progress import Progress
from ..rasters.grid import Grid
from ..rasters.pair import ImagePair
from .chips import MaskOf
from .coarse import CoarseModel, refine_on_level
from .local import LocalSearch
from .pooled import refine_on_ground
from .rough import Candidate, RoughSearch, level_factor, rough_candidates

# A candidate that random matches would hardly ever support (log10) needs no rival.
_CERTAIN = -6.0

# Repetitive places match more than once. A candidate nearly as high as the best is looked at, and
# is a rival if chips support it with at least half the evidence (log10).
_RIVAL_HEIGHT = 0.8
_RIVAL_EVIDENCE = 0.5
_SAME_PLACE_PX = 5.0

# Above so many expected false alarms (log10) nothing was found. Local matches may still tell
# more than large chips did, and the verdict judges what comes of them.
_HOPELESS = 0.0

# How far chips are searched around a candidate, in pixels of the level; around a finer level's
# model, as far as a level's model may be wrong, and the distortion that it does not know of.
_RADIUS_PX = 12
_LEVEL_ERROR_PX, _DISTORTION_PX = 2.0, 4

# Each level is finer than the one before by this at most; the last is the matching grid itself.
_STEP = 4.0

# Ground alone says too little of chips to look so far: levels are this much finer.
_GROUND_STEP = 2.0


def find_coarse_model(
    pair: ImagePair, search: LocalSearch, rough: RoughSearch, executor: Executor, progress: Progress
) -> Model:
    """Return a model of degree 1 on the map, from which tie points can be searched for.

    Parameters
    ----------
    pair
        The images.
    search
        Gives the similarity and what is held out.
    rough
        How far the input may lie from where it claims to be, and how it is searched for.
    executor
        Threads to work in.
    progress
        Is told of every step.

    Raises
    ------
    NothingFoundError
        No candidate is better than chance, or another place matches about as well.
    """
    factor = level_factor(pair.grid)
    level = pair.grid if factor == 1 else pair.grid.scaled(factor)
    candidates = rough_candidates(pair, level, rough, search.settings, search.held_out, executor)
    progress.update(0.3)
    if search.pooled:
        return _down_on_ground(pair, candidates, factor, search.held_out, executor)

    def refine(level: Grid, model: Model, radius_px: int) -> CoarseModel:
        progress.check()
        return refine_on_level(
            pair, level, model, radius_px, search.settings, search.held_out, executor
        )

    tried: list[CoarseModel] = []
    for candidate in candidates:
        certain = tried and min(_alarms(model) for model in tried) < _CERTAIN
        if certain and candidate.height < _RIVAL_HEIGHT * candidates[0].height:
            break
        tried.append(refine(level, candidate.model, _RADIUS_PX))
    if not tried or min(map(_alarms, tried)) > _HOPELESS:
        raise NothingFoundError("nothing in common was found")
    best = min(tried, key=_alarms)
    _require_no_rival(best, tried, level)
    while factor > 1:
        finer_factor = max(factor / _STEP, 1.0)
        finer_level = pair.grid if finer_factor == 1 else pair.grid.scaled(finer_factor)
        radius = int(np.ceil(_LEVEL_ERROR_PX * factor / finer_factor)) + _DISTORTION_PX
        finer = refine(finer_level, best.model, radius)
        if finer.log10_false_alarms < 0:
            best = finer
        factor = finer_factor
    return best.model


def _down_on_ground(
    pair: ImagePair,
    candidates: list[Candidate],
    factor: float,
    held_out: MaskOf,
    executor: Executor,
) -> Model:
    """Return the model that the ground as a whole agrees on, level by level."""
    if not candidates:
        raise NothingFoundError("nothing in common was found")
    best, *others = candidates
    if others and others[0].height > _RIVAL_HEIGHT * best.height:
        raise NothingFoundError("two places match about as well")
    model = best.model
    while factor > _GROUND_STEP:
        factor = factor / _GROUND_STEP
        radius = int(np.ceil(_LEVEL_ERROR_PX * _GROUND_STEP)) + _DISTORTION_PX
        level = pair.grid.scaled(factor)
        model = refine_on_ground(pair, level, model, radius, held_out, executor)
    return model


def _alarms(model: CoarseModel) -> float:
    return model.log10_false_alarms


def _require_no_rival(best: CoarseModel, tried: list[CoarseModel], level: Grid) -> None:
    centre = level.pixel_to_map([level.centre_px])
    for other in tried:
        apart = level.map_to_pixel(other.model(centre)) - level.map_to_pixel(best.model(centre))
        distance_px = float(np.hypot(*apart[0]))
        evident = _alarms(other) < min(_RIVAL_EVIDENCE * _alarms(best), _HOPELESS)
        if distance_px > _SAME_PLACE_PX and evident:
            distance = distance_px * level.pixel_size_m
            raise NothingFoundError(f"two places match about as well, {distance:.0f} m apart")
