"""Down the image pyramid: from the rough shift to a model that tie points can start from."""

from __future__ import annotations

from concurrent.futures import Executor

import numpy as np

from ..geometry.models import Model
from ..progress import Progress
from ..rasters.grid import Grid
from ..rasters.pair import ImagePair
from ..similarity.correlation import MINIMUM_OVERLAP
from .coarse import CoarseModel, refine_on_level, shift_model
from .local import LocalSearch
from .rough import level_factor, rough_candidates

# A candidate that random matches would hardly ever support (log10) needs no rival.
_CERTAIN = -6.0

# Above so many expected false alarms (log10) nothing was found. Local matches may still tell
# more than large chips did, and the verdict judges what comes of them.
_HOPELESS = 0.0

# Each level is finer by this; the last before the tie points is not coarser than this either.
_STEP = 4.0


def find_coarse_model(
    pair: ImagePair, search: LocalSearch, radius_m: float, executor: Executor, progress: Progress
) -> Model | None:
    """Return a model of degree 1 on the map, or None if no candidate is better than chance.

    Parameters
    ----------
    pair
        The images.
    search
        Gives the similarity and what is held out.
    radius_m
        How far the input may lie from where it claims to be, in metres.
    executor
        Threads to work in.
    progress
        Is told of every step.
    """
    factor = level_factor(pair.grid)
    level = pair.grid if factor == 1 else pair.grid.scaled(factor)
    # The true place may lie a pixel of the level further than the whole pixels say.
    radius_px = int(np.ceil(radius_m / level.pixel_size_m)) + 1
    # Farther off too little of the images overlaps.
    radius_px = min(radius_px, int((1 - MINIMUM_OVERLAP) * max(level.width, level.height)))
    candidates = rough_candidates(
        pair, level, radius_px, search.settings, search.held_out, executor
    )
    progress.update(0.3)
    best: CoarseModel | None = None
    for candidate in candidates:
        found = _refine(pair, level, shift_model(candidate), search, executor, progress)
        if best is None or found.log10_false_alarms < best.log10_false_alarms:
            best = found
        if best.log10_false_alarms < _CERTAIN:
            break
    if best is None or best.log10_false_alarms > _HOPELESS:
        return None
    while factor > _STEP:
        factor /= _STEP
        finer = _refine(pair, pair.grid.scaled(factor), best.model, search, executor, progress)
        if finer.log10_false_alarms < 0:
            best = finer
    return best.model


def _refine(
    pair: ImagePair,
    level: Grid,
    model: Model,
    search: LocalSearch,
    executor: Executor,
    progress: Progress,
) -> CoarseModel:
    progress.check()
    return refine_on_level(pair, level, model, search.settings, search.held_out, executor)
