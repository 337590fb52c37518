"""From a rough shift to a model of degree 1, level by level of the image pyramid."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..geometry.chance import agreement_probability, log10_false_alarms
from ..geometry.fitting import fit_model
from ..geometry.models import Model
from ..geometry.robust import distances, find_consensus
from ..progress import SILENT, Progress
from ..rasters.grid import Grid
from ..rasters.pair import ImagePair
from ..similarity.peak import find_peak
from ..similarity.surface import SimilaritySettings
from .belief_propagation import support
from .chips import ChipMatcher, MaskOf

FloatArray = NDArray[np.float64]

# Chips and agreement at every level of the pyramid, in pixels of the level.
_TOLERANCE_PX = 2.0
_CHIPS_PER_SIDE = 7
_CHIP_RANGE_PX = (48, 80)

# Simple models are preferred unless the data speak for others: each has its number of
# hypotheses counted against it.
_SAMPLE_OF = {"translation": 1, "similarity": 2, "affine": 3}


@dataclass(frozen=True)
class CoarseModel:
    """A model of the misregistration on the map, and how likely it is to be none at all.

    `log10_false_alarms` is log10 of the expected number of models that random matches would
    agree with as well.
    """

    model: Model
    log10_false_alarms: float


def refine_on_level(
    pair: ImagePair,
    level: Grid,
    model: Model,
    radius_px: int,
    settings: SimilaritySettings,
    held_out: MaskOf,
    executor: Executor,
    progress: Progress = SILENT,
) -> CoarseModel:
    """Match large chips on a level around a model, and fit a model of degree 1 to them.

    Parameters
    ----------
    pair
        The images.
    level
        The matching grid at reduced resolution.
    model
        The misregistration on the map as known so far.
    radius_px
        How far it may be wrong, in pixels of the level.
    settings
        How similarity is measured.
    held_out
        Returns for a piece of the grid which pixels of the reference must not be seen.
    executor
        Threads to work in.
    progress
        Is told of every chip.
    """
    chip = int(np.clip(min(level.width, level.height) / 5, *_CHIP_RANGE_PX))
    matcher = ChipMatcher(pair, level, lambda xy: pair.claimed_px(model(xy)), settings, held_out)
    centres = _regular_centres(level, chip)
    centres, surfaces = matcher.match_forward(centres, chip, radius_px, executor, progress)
    if len(centres) < 4:
        return CoarseModel(model, np.inf)
    step = (np.array([level.width, level.height]) - chip) / (_CHIPS_PER_SIDE - 1)
    supported = support(surfaces, centres, 1.5 * float(step.max()))
    own = _peaks(surfaces)
    px = centres.astype(float)
    best = CoarseModel(model, np.inf)
    probability = agreement_probability(_TOLERANCE_PX, radius_px)
    found = px + _peaks(supported)
    for kind, sample in _SAMPLE_OF.items():
        fitted = find_consensus(px, found, _TOLERANCE_PX, kind)
        # Supported peaks are not independent; only those that stand alone are counted.
        agreeing = int((distances(fitted, px, px + own) < _TOLERANCE_PX).sum())
        alarms = log10_false_alarms(agreeing, len(px), probability, sample)
        if alarms < best.log10_false_alarms:
            best = CoarseModel(behind(model, fitted, level), alarms)
    return best


def behind(model: Model, correction: Model, level: Grid) -> Model:
    """Return the model of degree 1 that first corrects on the level, then applies `model`."""
    centres = level.centre_transform
    on_map = correction.on_map(centres)
    corners = level.pixel_to_map(
        [[0, 0], [level.width, 0], [0, level.height], [level.width, level.height]]
    )
    return fit_model("affine", corners, model(on_map(corners)))


def _regular_centres(level: Grid, chip: int) -> NDArray[np.int_]:
    sides = []
    for size in (level.width, level.height):
        count = int(np.clip((size - chip) / (chip / 2) + 1, 2, _CHIPS_PER_SIDE))
        sides.append(np.linspace(chip / 2, size - chip / 2, count))
    cols, rows = np.meshgrid(*sides)
    return np.round(np.column_stack([cols.ravel(), rows.ravel()])).astype(int)


def _peaks(surfaces: NDArray[np.float32]) -> FloatArray:
    return np.array([find_peak(surface).shift_px for surface in surfaces]).reshape(-1, 2)
