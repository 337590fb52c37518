"""Places far from a model: where a pair matches as a whole, or what hardly matches by the model."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..context import Context
from ..errors import RasterContentError
from ..geometry.models import Model
from ..pose.rotation_windows import DEFAULT_RADIUS_SHARE
from ..rasters.grid import Grid
from ..rasters.held_images import held_on_level
from ..rasters.pair import ImagePair
from ..similarity.surface import SimilaritySettings
from .coarse_shift import SAME_PLACE_PX, LevelSearch, level_factor
from .matcher import MaskOf
from .parts import CANOPIES_PX, CANOPIES_SHARE, FarPlace, Part, largest_group
from .survey import SURVEY_RADIUS_PX, Survey

# What a scene that repeats has in common with itself, whatever grows there: borders and roads.
_EDGES = SimilaritySettings("orientation")

# All that a part and its place elsewhere may have in common.
_ALL = SimilaritySettings()


@dataclass(frozen=True)
class FarSearch:
    """A pair on a reduced grid, to be compared at shifts of up to a quarter of its longer side.

    Parameters
    ----------
    pair
        The images, held in memory.
    grid, level
        The grid, and the same reduced.
    model
        The misregistration on the map.
    context
        Threads.
    """

    pair: ImagePair
    grid: Grid
    level: Grid
    model: Model
    context: Context

    @classmethod
    def of(cls, pair: ImagePair, grid: Grid, model: Model, context: Context) -> FarSearch:
        """Read a pair on a reduced grid; parameters as the class."""
        level = grid.scaled(level_factor(grid))
        return cls(held_on_level(pair, level, context), grid, level, model, context)

    def whole(self) -> FarPlace:
        """Return where the pair matches best beyond a survey's radius, by orientation of edges."""
        return self._best(_EDGES, SURVEY_RADIUS_PX)

    def with_far(self, survey: Survey, chip_px: int, open_ground: MaskOf | None) -> Survey:
        """Return a survey with the place far off where its unsupporting chips match best.

        Parameters
        ----------
        survey, chip_px
            The survey, and the side of its chips.
        open_ground
            Returns which pixels of a radar image are not open ground; such chips are left out, as
            canopies and roofs may be displaced as far. None: there is no radar image.
        """
        unsupporting = survey.is_unsupporting_chip
        fewest = max(CANOPIES_SHARE * len(unsupporting), 1)
        if open_ground is not None and unsupporting.sum() >= fewest:
            unsupporting = unsupporting & self._is_open(survey, unsupporting, chip_px, open_ground)
        if unsupporting.sum() < fewest:
            return survey
        try:
            place = self._best(_ALL, CANOPIES_PX, _near(survey, unsupporting))
        except RasterContentError:
            return survey  # water or the like: what shows nothing matches nowhere
        members = largest_group(survey.centres, unsupporting)
        excess = place.height - place.own_height
        part = Part.of(survey.grid, survey.centres, members, place.shift_px, excess)
        return replace(survey, far=part)

    def _is_open(
        self, survey: Survey, asked: NDArray[np.bool_], chip_px: int, open_ground: MaskOf
    ) -> NDArray[np.bool_]:
        """Return which of the chips that are asked for are open ground by more than half, (n,)."""

        def of(number: int) -> bool:
            col, row = (int(at) - chip_px // 2 for at in survey.centres[number])
            return bool(open_ground(survey.grid.window(col, row, chip_px, chip_px)).mean() < 0.5)

        numbers = np.flatnonzero(asked)
        found = np.zeros(len(asked), bool)
        found[numbers] = list(self.context.map(of, [int(one) for one in numbers]))
        return found

    def _best(
        self, settings: SimilaritySettings, beyond_px: float, hidden: MaskOf | None = None
    ) -> FarPlace:
        """Return the best match farther off than some pixels of the grid, without hidden pixels."""
        factor = self.level.pixel_size[0] / self.grid.pixel_size[0]
        radius_px = int(DEFAULT_RADIUS_SHARE * max(self.level.size))
        # What is hidden depends on the survey, so that descriptions cannot be reused.
        context = self.context if hidden is None else replace(self.context, memo=None)
        search = LevelSearch(self.pair, self.level, settings, hidden, context)
        surface, overlap = search.surface(self.model, radius_px)
        if hidden is not None:
            # A part may lie at the border. The fewer pixels overlap, the higher chance reaches.
            surface = surface * np.sqrt(np.maximum(overlap(), 0))
        beyond_px = max(beyond_px / factor, 2 * SAME_PLACE_PX)
        return FarPlace.of(surface, SAME_PLACE_PX, beyond_px).scaled(factor)


def _near(survey: Survey, which: NDArray[np.bool_]) -> MaskOf:
    """Return a mask of the pixels that are not nearest to some of a survey's chips, shape (n,)."""
    (cols, col), (rows, row) = (np.unique(along, return_inverse=True) for along in survey.centres.T)
    is_hidden = np.ones((len(rows), len(cols)), bool)
    is_hidden[row.reshape(-1), col.reshape(-1)] = ~which

    def mask(piece: Grid) -> NDArray[np.bool_]:
        # Pieces are parts of a coarser level, along the same axes.
        first, last = survey.grid.map_to_pixel(
            piece.pixel_to_map([[0, 0], [piece.width - 1, piece.height - 1]])
        )
        of_col, of_row = (
            np.searchsorted((along[1:] + along[:-1]) / 2, np.linspace(low, high, count))
            for along, low, high, count in zip((cols, rows), first, last, piece.size, strict=True)
        )
        return np.asarray(is_hidden[np.ix_(of_row, of_col)])

    return mask
