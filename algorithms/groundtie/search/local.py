"""Tie points on the chips of a layout."""

from __future__ import annotations

from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..geometry.models import Model
from ..geometry.tie_points import USED, TiePoints
from ..progress import SILENT, Progress
from ..rasters.grid import Grid
from ..rasters.pair import ImagePair
from ..similarity.evidence import find_peak
from ..similarity.surface import SimilaritySettings
from .layout import ChipLayout
from .matching import ChipMatcher, ChipSurfaces, Surfaces, support

FloatArray = NDArray[np.float64]

# Neighbours within this many spacings support each other.
_SUPPORT_SPACINGS = 1.5


@dataclass(frozen=True)
class LocalSearch:
    """Finds tie points of a pair near where a model predicts them.

    Parameters
    ----------
    pair
        The images.
    layout
        Where chips lie in the matching grid.
    settings
        How similarity is measured.
    fit_radius_px, check_radius_px
        Largest shift from the prediction for points of the fit and for check points.
    two_way_px
        Largest distance between a match and its match back for points of the fit.
    """

    pair: ImagePair
    layout: ChipLayout
    settings: SimilaritySettings
    fit_radius_px: int = 8
    check_radius_px: int = 16
    two_way_px: float = 2.0

    def fit_points(
        self, model: Model, executor: Executor, progress: Progress = SILENT
    ) -> TiePoints:
        """Match the chips of the fit; they see nothing of the reference's held-out blocks."""
        surfaces = self._match(
            self.layout.fit_centres, self.fit_radius_px, model, True, executor, progress
        )
        reach = _SUPPORT_SPACINGS * self.layout.spacing_px
        supported = ChipSurfaces(
            surfaces.centres,
            support(surfaces.forward, surfaces.centres, reach),
            support(surfaces.backward, surfaces.centres, reach),
        )
        points = self._points(supported, model, is_check=False)
        two_way = f"two-way error above {self.two_way_px:g} px"
        return points.reject(points.two_way_error_px > self.two_way_px, two_way)

    def check_points(
        self, model: Model, executor: Executor, progress: Progress = SILENT
    ) -> TiePoints:
        """Match the check chips around what a model predicts, each by its own evidence alone."""
        surfaces = self._match(
            self.layout.check_centres, self.check_radius_px, model, False, executor, progress
        )
        return self._points(surfaces, model, is_check=True)

    def check_surfaces(self, model: Model, centres: NDArray[np.int_]) -> Surfaces:
        """Return the surfaces of check chips, shape (n, 2 r + 1, 2 r + 1), to look at."""
        with ThreadPoolExecutor(1) as executor:
            return self._match(centres, self.check_radius_px, model, False, executor, SILENT).both

    def held_out(self, piece: Grid) -> NDArray[np.bool_]:
        """Return which pixels of a grid, of any pixel size, lie in held-out blocks."""
        cols = np.arange(piece.width, dtype=float)
        rows = np.arange(piece.height, dtype=float)
        along_cols = piece.pixel_to_map(np.column_stack([cols, np.zeros_like(cols)]))
        along_rows = piece.pixel_to_map(np.column_stack([np.zeros_like(rows), rows]))
        # Pieces are parts of the matching grid's own lattice or of a coarser one along its axes.
        return self.layout.held_out_mask(
            self.pair.grid.map_to_pixel(along_cols)[:, 0],
            self.pair.grid.map_to_pixel(along_rows)[:, 1],
        )

    def _match(
        self,
        centres: NDArray[np.int_],
        radius_px: int,
        model: Model,
        blind: bool,
        executor: Executor,
        progress: Progress,
    ) -> ChipSurfaces:
        matcher = ChipMatcher(
            self.pair,
            self.pair.grid,
            lambda xy: self.pair.claimed_px(model(xy)),
            self.settings,
            self.held_out if blind else None,
        )
        return matcher.match(centres, self.layout.chip_px, radius_px, executor, progress)

    def _points(self, surfaces: ChipSurfaces, model: Model, *, is_check: bool) -> TiePoints:
        grid = self.pair.grid
        count = len(surfaces.centres)
        peaks = [find_peak(surface) for surface in surfaces.both]
        centres = surfaces.centres.astype(float)
        shifts = np.array([peak.shift_px for peak in peaks]).reshape(-1, 2)
        there = np.array([find_peak(s).shift_px for s in surfaces.forward]).reshape(-1, 2)
        back = np.array([find_peak(s).shift_px for s in surfaces.backward]).reshape(-1, 2)
        points = TiePoints(
            reference_xy=grid.pixel_to_map(centres),
            input_px=self.pair.claimed_px(model(grid.pixel_to_map(centres + shifts))),
            score=np.array([peak.height for peak in peaks]),
            covariance_px2=np.array([p.covariance_px2 for p in peaks]).reshape(-1, 2, 2),
            two_way_error_px=np.hypot(*(there - back).T),
            is_check=np.full(count, is_check),
            state=np.full(count, USED),
        )
        return points.reject(np.array([peak.at_border for peak in peaks], bool), "no peak inside")
