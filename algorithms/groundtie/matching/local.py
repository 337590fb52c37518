"""Tie points on the chips of a layout, and the model that their surfaces agree on."""

from __future__ import annotations

from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass, replace

import numpy as np
from affine import Affine
from numpy.typing import NDArray

from ..errors import TooFewPointsError
from ..geometry.estimation import SIGMA_RANGE_PX, Estimate, fit_thin_plate
from ..geometry.models import DEGREE, PARAMETERS, Model
from ..geometry.robust import find_consensus, fit_mixture
from ..geometry.tie_points import USED, TiePoints
from ..geometry.transform import Transform
from ..progress import SILENT, Progress
from ..rasters.grid import Grid, apply_affine
from ..rasters.kernels import REACH
from ..rasters.pair import ImagePair
from ..similarity.peak import Evidence, find_peak, find_peak_near
from ..similarity.surface import SimilaritySettings
from .alignment import CANDIDATES, Alignment, Positions, align, choose_alignment
from .belief_propagation import Surfaces, support
from .chips import ChipMatcher, ChipSurfaces
from .layout import ChipLayout
from .pooled import GroundChips, tile_centres

FloatArray = NDArray[np.float64]
AUTO = "auto"

# Neighbours within this many spacings support each other.
_SUPPORT_SPACINGS = 1.5

# Chips agree with a first model of degree 1 within this, in pixels; local distortion beyond it is
# left to the alignment.
_CONSENSUS_PX = 3.0

# If a tenth of the chips is expected to be shifted by more than this, they are matched again.
_FAR_PX = 2.5

# What they say tells one model from another badly, and linear distortion is common.
_POOLED_KIND = "affine"

# How often chips with a joint histogram in common are matched again.
_POOLED_ROUNDS = 2

# A tie point of the fit is the peak within this distance from the aligned model.
_NEAR_PX = 3


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
    pooled
        Whether chips share one joint histogram, as those that a mask leaves little of must.
    candidates
        What "auto" chooses from, from simple to flexible.
    """

    pair: ImagePair
    layout: ChipLayout
    settings: SimilaritySettings
    fit_radius_px: int = 8
    check_radius_px: int = 12
    two_way_px: float = 2.0
    pooled: bool = False
    candidates: tuple[str, ...] = CANDIDATES

    def estimate(
        self, coarse: Model, kind: str, seed: int, executor: Executor, progress: Progress = SILENT
    ) -> Estimate:
        """Match the chips of the fit, which see nothing of held-out blocks, and fit a model.

        Parameters
        ----------
        coarse
            The misregistration on the map, a model of degree 1; it may be wrong by
            `fit_radius_px`.
        kind
            One of `models.KINDS`, or "auto" for the simplest polynomial that the chips justify.
        seed
            Of random samples.
        executor
            Threads to work in.
        progress
            Is told of every chip.

        Raises
        ------
        TooFewPointsError
            Too few chips could be matched for the model.
        """
        surfaces, aligned, expected = self._align(coarse, kind, seed, executor, progress)
        for _ in range(_POOLED_ROUNDS if self.pooled else 1):
            if DEGREE[aligned.model.kind] > 1 or not (self.pooled or _lies_far(expected)):
                break
            # Chips near the border of their search windows saw too little, and what goes with
            # what is told the better the nearer they lie: look again, from here.
            coarse = self.on_map(aligned.model)
            surfaces, aligned, expected = self._align(coarse, kind, seed, executor, progress)
        points = self._points(surfaces, coarse, expected)
        model, fold_models = aligned.model, aligned.fold_models
        as_claimed = Transform.as_claimed(self.pair.grid.crs, self.pair.input.source.grid)
        if kind == "tps":
            model, fold_models = fit_thin_plate(points, as_claimed, self.pair.grid, model, _NEAR_PX)
        transform = Transform(self.on_map(model), as_claimed.crs, as_claimed.input_grid)
        agreeing = self._agreeing(points, transform)
        if 2 * agreeing.used.sum() < PARAMETERS[transform.model.kind]:
            raise TooFewPointsError(
                f"only {agreeing.used.sum()} of {len(points)} points agree with a model"
            )
        return Estimate(transform, agreeing, fold_models)

    def _align(
        self, coarse: Model, kind: str, seed: int, executor: Executor, progress: Progress
    ) -> tuple[ChipSurfaces, Alignment, FloatArray]:
        """Match the chips of the fit around a model, and align a better one with their surfaces.

        Returns the surfaces, the alignment and the shifts that it expects of the chips, (n, 2).
        """
        surfaces = self._match(
            self._fit_centres, self.fit_radius_px, coarse, True, executor, progress
        )
        centres, weighed = surfaces.centres, surfaces.weighed
        if len(centres) < 4:
            raise TooFewPointsError(f"only {len(centres)} chips could be matched")
        prior = self.prior(coarse)
        residual = self._first_model(surfaces, kind, seed)

        def start(at: FloatArray) -> FloatArray:
            return apply_affine(prior, residual(at))

        if self.pooled and kind == AUTO:
            kind = _POOLED_KIND
        if kind in (AUTO, "tps"):
            aligned = choose_alignment(centres, weighed, prior, start, self.candidates)
        else:
            aligned = align(kind, centres, weighed, prior, start)
        px = centres.astype(float)
        return surfaces, aligned, apply_affine(~prior, aligned.model(px)) - px

    def _first_model(self, surfaces: ChipSurfaces, kind: str, seed: int) -> Positions:
        """Return where a first model of degree 1 has grid pixels on the resampled input."""
        px = surfaces.centres.astype(float)
        if self.pooled:
            return surfaces.common_shift
        reach = _SUPPORT_SPACINGS * self.layout.spacing_px
        supported = support(surfaces.both, surfaces.centres, reach)
        shifts = np.array([find_peak(surface).shift_px for surface in supported])
        first_kind = kind if DEGREE.get(kind, 2) <= 1 else "affine"
        return find_consensus(px, px + shifts, _CONSENSUS_PX, first_kind, seed)

    def of_ground(self, pair: ImagePair) -> LocalSearch:
        """Return this search on what a mask of the pair leaves, with one joint histogram."""
        nmi = replace(self.settings, similarity="nmi")
        return replace(self, pair=pair, settings=nmi, pooled=True)

    @property
    def _fit_centres(self) -> NDArray[np.int_]:
        # All that is not held out counts where there is little of it.
        if not self.pooled:
            return self.layout.fit_centres
        return tile_centres((self.pair.grid.width, self.pair.grid.height), self.layout.chip_px)

    def on_map(self, model: Model) -> Model:
        """Return a model of the matching grid's pixels as one on the map."""
        return model.on_map(self.pair.grid.centre_transform)

    def check_points(
        self, model: Model, executor: Executor, progress: Progress = SILENT
    ) -> TiePoints:
        """Match the check chips around what a model predicts, each by its own evidence alone."""
        return self._points(self._match_check(model, executor, progress), model, None)

    def common_shift_px(self, model: Model, executor: Executor) -> float:
        """Return how far from a model's place all check chips together match best."""
        surfaces = self._match_check(model, executor, SILENT)
        return float(np.hypot(*surfaces.common_shift(np.zeros(2))))

    def check_surfaces(self, model: Model, centres: NDArray[np.int_]) -> Surfaces:
        """Return the surfaces of check points, shape (n, 2 r + 1, 2 r + 1), to look at."""
        with ThreadPoolExecutor(1) as executor:
            found = self._match_check(model, executor, SILENT)
        place = {tuple(centre): i for i, centre in enumerate(found.centres)}
        return found.both[[place[tuple(centre)] for centre in centres]]

    def _match_check(self, model: Model, executor: Executor, progress: Progress) -> ChipSurfaces:
        surfaces = self._match(
            self.layout.check_centres, self.check_radius_px, model, False, executor, progress
        )
        if self.pooled:
            # A held-out block's ground tells little by itself.
            return surfaces.together(self.layout.neighbourhoods(surfaces.centres))
        return surfaces

    def held_out(self, piece: Grid) -> NDArray[np.bool_]:
        """Return which pixels of a grid, of any pixel size, see something of held-out blocks."""
        cols = np.arange(piece.width, dtype=float)
        rows = np.arange(piece.height, dtype=float)
        along_cols = piece.pixel_to_map(np.column_stack([cols, np.zeros_like(cols)]))
        along_rows = piece.pixel_to_map(np.column_stack([np.zeros_like(rows), rows]))
        # Pieces are parts of the matching grid's own lattice or of a coarser one along its axes.
        return self.layout.held_out_mask(
            self.pair.grid.map_to_pixel(along_cols)[:, 0],
            self.pair.grid.map_to_pixel(along_rows)[:, 1],
            self._reach_px(piece),
        )

    def _reach_px(self, piece: Grid) -> float:
        """Return how far off a piece's pixel sees of the reference, in matching pixels."""
        own = self.pair.reference.source.grid
        size, matching, piece_size = (g.pixel_size[0] for g in (own, self.pair.grid, piece))
        if np.allclose([matching / size, piece_size / size], 1.0):
            return 0.0  # the reference's own pixels
        # Larger pixels are interpolated between means of the reference's: see `warping.sample`.
        averaged = max(round(piece_size / size), 1)
        return (REACH["cubic"] + 0.5) * averaged * size / matching

    def _match(
        self,
        centres: NDArray[np.int_],
        radius_px: int,
        model: Model,
        blind: bool,
        executor: Executor,
        progress: Progress,
    ) -> ChipSurfaces:
        def to_input_px(xy: FloatArray) -> FloatArray:
            return self.pair.claimed_px(model(xy))

        grid, held_out = self.pair.grid, self.held_out if blind else None
        chip_px = self.layout.chip_px if blind else self.layout.check_chip_px
        if not self.pooled:
            matcher = ChipMatcher(self.pair, grid, to_input_px, self.settings, held_out)
            return matcher.match(centres, chip_px, radius_px, executor, progress)
        # What goes with what is told by the chips of the fit alone.
        fit = GroundChips(self.pair, grid, to_input_px, self.held_out)
        levels = fit.levels(self._fit_centres, self.layout.chip_px, executor, progress)
        chips = replace(fit, held_out=held_out)
        return chips.match(levels, centres, chip_px, radius_px, executor, progress)

    def prior(self, coarse: Model) -> Affine:
        """Return a model of degree 1 on the map as an affine transform of the grid's pixels."""
        grid = self.pair.grid
        origin, right, down = grid.map_to_pixel(coarse(grid.pixel_to_map([[0, 0], [1, 0], [0, 1]])))
        along, across = right - origin, down - origin
        return Affine(along[0], across[0], origin[0], along[1], across[1], origin[1])

    def _points(
        self, surfaces: ChipSurfaces, model: Model, expected_px: FloatArray | None
    ) -> TiePoints:
        """Return the surfaces' peaks: near the expected shifts, or anywhere for check points."""

        def peaks(of: Surfaces) -> list[Evidence]:
            if expected_px is None:
                return [find_peak(surface) for surface in of]
            pairs = zip(of, expected_px, strict=True)
            return [find_peak_near(surface, shift, _NEAR_PX) for surface, shift in pairs]

        def shifts(of: Surfaces) -> FloatArray:
            return np.array([peak.shift_px for peak in peaks(of)]).reshape(-1, 2)

        grid = self.pair.grid
        found = peaks(surfaces.both)
        centres = surfaces.centres.astype(float)
        there = centres + np.array([peak.shift_px for peak in found]).reshape(-1, 2)
        two_way = np.hypot(*(shifts(surfaces.forward) - shifts(surfaces.backward)).T)
        points = TiePoints(
            reference_xy=grid.pixel_to_map(centres),
            input_px=self.pair.claimed_px(model(grid.pixel_to_map(there))),
            score=np.array([peak.height for peak in found]),
            covariance_px2=np.array([p.covariance_px2 for p in found]).reshape(-1, 2, 2),
            two_way_error_px=two_way,
            is_check=np.full(len(found), expected_px is None),
            state=np.full(len(found), USED),
        )
        points = points.reject(np.array([peak.at_border for peak in found], bool), "no peak")
        if expected_px is None:
            return points
        limit = f"two-way error above {self.two_way_px:g} px"
        return points.reject(points.two_way_error_px > self.two_way_px, limit)

    def _agreeing(self, points: TiePoints, transform: Transform) -> TiePoints:
        """Reject the points of the fit that more likely fell by chance than near the model."""
        used = points.used
        residuals = points.take(used).residual_on(self.pair.grid, transform)
        mixture = fit_mixture(residuals, (2 * _NEAR_PX + 1) ** 2, SIGMA_RANGE_PX)
        wrong = np.zeros(len(points), bool)
        wrong[used] = ~mixture.right
        return points.reject(wrong, "disagrees with the model")


def _lies_far(shifts_px: FloatArray) -> bool:
    return bool(np.quantile(np.hypot(*shifts_px.T), 0.9) > _FAR_PX)
