"""Chips all over a pair that confirm a pose, or show parts for which it does not hold.

A pose is a first estimate, accurate to a hundredth or two of the image. So its chips are larger
than those that survey a registration. The pose is first refined by the chips, and each chip is
compared with a pose refined without it. Parts that lie elsewhere are also sought with smaller
chips.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from affine import Affine
from numpy.typing import NDArray

from ..context import Context
from ..geometry.estimation import Fitted
from ..geometry.models import Model
from ..geometry.transform import Transform
from ..rasters.grid import FloatArray, Grid, finite
from ..rasters.pair import ImagePair
from ..similarity.peak import peak_shifts
from ..similarity.surface import SimilaritySettings
from .alignment import Prior, align
from .belief_propagation import Surfaces
from .chips import ChipMatcher
from .coarse_shift import level_factor
from .frames import compose
from .matcher import Places
from .shared_content import ImageKinds
from .survey import SURVEY_RADIUS_PX, survey_model, survey_places
from .surveys import Surveys, survey_all

# Chips along the shorter side. With the 29 shared rotated pairs at their poses, four chips are too
# few to show parts, and six are so small that radar images hardly match.
_ALONG = 5

# A chip agrees with a pose within this: 2 % of the smallest images that poses are asked for.
POSE_TOLERANCE_PX = 5.0

# Poses of content drawn into both arrays lie within this of whole pixels everywhere. Those of
# ground that was not cut along a pixel grid lie no nearer than 0.24 (suite attacks).
_EXACT_PX = 0.2

# Fewest chips of a similarity transform, whose four parameters need two.
_FEWEST = 4


@dataclass(frozen=True)
class PoseSurvey:
    """Survey of a pose by chips all over a pair.

    Parameters
    ----------
    grid
        The grid of the chips.
    px
        The chips' centres, in pixels of the grid, shape (n, 2).
    residuals_px
        Offset (x, y) of each chip's match from the prediction of a pose refined without the chip,
        shape (n, 2); infinite where too few chips are left.
    surveys
        Surveys of the pose that was refined by all chips.
    transform
        The pose that was refined by all chips.
    fold_models
        The pose refined without each block of chips in turn, between pixels of the grid; none where
        too few chips are left.
    """

    grid: Grid
    px: NDArray[np.int_]
    residuals_px: FloatArray
    surveys: Surveys
    transform: Transform
    fold_models: tuple[Model, ...] = ()

    @property
    def agrees(self) -> NDArray[np.bool_]:
        """Which chips agree with a pose that was refined without them, shape (n,)."""
        return np.asarray(np.hypot(*self.residuals_px.T) <= POSE_TOLERANCE_PX)


def survey_pose(
    pair: ImagePair,
    transform: Transform,
    accuracy_share: float,
    kinds: ImageKinds,
    context: Context,
) -> PoseSurvey:
    """Match chips all over a pair around a pose.

    Parameters
    ----------
    pair
        The images.
    transform
        The pose, as a transform between the images.
    accuracy_share
        Accuracy of the pose, as a share of the reference's longer side.
    kinds
        What the images are.
    context
        Threads and progress.
    """
    matcher = ChipMatcher(pair, SimilaritySettings())
    places = _places(_covered(pair.grid, transform))
    level = places.grid
    quiet = context.quiet()
    images = matcher.resampled(transform.model, level, SURVEY_RADIUS_PX, quiet)
    kept, surfaces = matcher.match_forward(images, places, SURVEY_RADIUS_PX, quiet)
    residuals = _cross_fitted_px(kept, surfaces, places)
    model = transform.model
    fold_models: tuple[Model, ...] = ()
    if len(kept) >= _FEWEST:
        aligned = _moved(kept, surfaces, level)
        model, fold_models = compose(model, aligned.model, level), aligned.fold_models
    elsewhere_px = max(accuracy_share * max(level.size), POSE_TOLERANCE_PX)
    moved = Transform(model, transform.crs, transform.input_grid)
    accuracy_px = elsewhere_px, _EXACT_PX
    surveys = survey_all(matcher, moved, places, accuracy_px, kinds, False, quiet)
    smaller = survey_places(level)
    if smaller.chip_px < places.chip_px:
        images = matcher.resampled(model, level, SURVEY_RADIUS_PX, quiet)
        fine = survey_model(matcher, images, smaller, elsewhere_px, quiet)
        surveys = replace(surveys, fine=fine)
    return PoseSurvey(level, kept, residuals, surveys, moved, fold_models)


def _covered(grid: Grid, transform: Transform) -> Grid:
    """Return the part of a grid that the input covers by a transform."""
    outline = transform.inverse(transform.input_grid.outline())
    px = finite(grid.map_to_pixel(outline))
    size = np.array(grid.size)
    if len(px) == 0:
        return grid
    low = np.clip(np.floor(px.min(axis=0)), 0, size - 1).astype(int)
    high = np.clip(np.ceil(px.max(axis=0)) + 1, low + 1, size).astype(int)
    return grid.window(int(low[0]), int(low[1]), *(int(side) for side in high - low))


def _places(grid: Grid) -> Places:
    """Return chips side by side on a grid, reduced if it is large."""
    factor = level_factor(grid)
    level = grid.scaled(factor)
    chip = max(min(level.size) // _ALONG, 1)
    return Places.spread(level, chip, lambda side: side // chip)


def _moved(px: NDArray[np.int_], surfaces: Surfaces, grid: Grid) -> Fitted:
    """Return the similarity transform on the ground on which the chips' surfaces agree.

    It is between pixels of the grid, which need not be square on the ground.
    """
    # Every chip counts the same; only chips without content are lower than 1.
    equal = surfaces / np.maximum(surfaces.max(axis=(1, 2), keepdims=True), 1)
    sides = np.divide(grid.pixel_sides_m, min(grid.pixel_sides_m))
    # Positions in the shorter side, and shifts of the surfaces in pixels.
    prior = Prior(np.copy, np.diag(sides))
    found = align(["similarity"], px * sides, equal, prior, np.copy)
    to_px = Affine.scale(*(1 / sides))
    return Fitted(found.model.on_map(to_px), tuple(one.on_map(to_px) for one in found.fold_models))


def _cross_fitted_px(px: NDArray[np.int_], surfaces: Surfaces, places: Places) -> FloatArray:
    """Return the residuals of chips from a model fitted to the chessboard's other colour."""
    is_black = (px // places.chip_px).sum(axis=1) % 2 == 0
    residuals = np.full((len(px), 2), np.inf)
    if min(is_black.sum(), (~is_black).sum()) < _FEWEST:
        return residuals
    found = px + peak_shifts(surfaces)
    for which in (is_black, ~is_black):
        model = _moved(px[~which], surfaces[~which], places.grid).model
        residuals[which] = found[which] - model(px[which].astype(float))
    return residuals
