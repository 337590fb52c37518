"""Chips that are each matched by their own similarity surface, in both directions."""

from __future__ import annotations

import logging
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ..context import Context
from ..geometry.accuracy import NEIGHBOUR_SPACINGS
from ..geometry.models import Model
from ..geometry.robust import CONSENSUS_PX, find_consensus
from ..rasters.grid import FloatArray, Grid, PointFunction
from ..rasters.pair import ImagePair
from ..rasters.patch import Patch
from ..similarity.description import BORDER_PX, Description
from ..similarity.peak import peak_shifts
from ..similarity.surface import (
    SimilaritySettings,
    Surface,
    describe,
    normalise,
    similarity_surface,
)
from .belief_propagation import Surfaces, propagate
from .chip_windows import ChipWindows, Resampled
from .layout import ChipLayout
from .matcher import ChipSurfaces, MaskOf, Places

_log = logging.getLogger(__name__)

# Chips with a smaller valid share than this in either image are not matched. The second limit is
# for masked images: a mask leaves what was chosen for matching, so a little may be enough.
_LEAST_VALID, LEAST_VALID_MASKED = 0.4, 0.1

# A surface without a true peak reaches about this many robust standard deviations.
_LEAST_HEIGHT = 3.0

# If a tenth of the chips are expected to be shifted by more than this, all are matched again.
_FAR_PX = 2.5


@dataclass(frozen=True)
class ChipMatcher:
    """Matches chips of a pair, the input resampled by a model.

    Parameters
    ----------
    pair
        The images.
    settings
        The similarity measure.
    held_out
        Takes a piece of a grid and returns which pixels of the reference are hidden; None: none.
    least_valid
        Chips with a smaller valid share than this in either image are not matched; None: the
        default of images with or without a mask.
    """

    pair: ImagePair
    settings: SimilaritySettings
    held_out: MaskOf | None = None
    least_valid: float | None = None

    def seeing_all(self) -> ChipMatcher:
        """Return this matcher for check chips, which may see the blocks held out of the fit."""
        return replace(self, held_out=None)

    def match(self, model: Model, places: Places, radius_px: int, context: Context) -> ChipSurfaces:
        """Return the surfaces, in both directions, of all chips that have enough valid pixels.

        Parameters
        ----------
        model
            The misregistration on the map as known so far.
        places
            The chips.
        radius_px
            Largest shift of a chip from its position predicted by the model.
        context
            Threads and progress.
        """
        images = self.resampled(model, places.grid, radius_px, context)
        kept, found = self._run(images, places, radius_px, context, 2)
        forward, backward = found[:, 0], found[:, 1]
        weight = _equal_weight(normalise(forward + backward))
        return ChipSurfaces(kept, forward, backward, weight)

    def resampled(self, model: Model, grid: Grid, radius_px: int, context: Context) -> Resampled:
        """Return the pair, resampled by a model, for matching within a radius on a grid."""
        to_input = self.pair.transform(model)
        return Resampled.of(self.pair, to_input, grid, radius_px + BORDER_PX, context)

    def match_forward(
        self, images: Resampled, places: Places, radius_px: int, context: Context
    ) -> tuple[NDArray[np.int_], Surfaces]:
        """Return the centres that could be matched and their forward surfaces, at half the cost.

        Parameters as `match`; `images` are the pair's, resampled by the model.
        """
        kept, found = self._run(images, places, radius_px, context, 1)
        return kept, found[:, 0]

    def fit_places(self, layout: ChipLayout) -> Places:
        """Return the chips of the fit."""
        return Places(self.pair.grid, layout.fit_centres, layout.chip_px)

    def first_model(
        self, surfaces: ChipSurfaces, layout: ChipLayout, kind: str, seed: int
    ) -> PointFunction:
        """Return a first model of degree 1: the consensus of peaks after belief propagation."""
        px = surfaces.centres.astype(float)
        reach = NEIGHBOUR_SPACINGS * layout.spacing_px
        supported = propagate(surfaces.combined, surfaces.centres, reach)
        return find_consensus(px, px + peak_shifts(supported), CONSENSUS_PX, kind, seed)

    def kind_of(self, kind: str) -> str:
        """Return the kind of model to fit when `kind` is requested."""
        return kind

    def is_settled(self, expected_px: FloatArray) -> bool:
        """Whether expected shifts, shape (n, 2), are too small for matching again to help.

        Matches near the border of their search windows rest on too little of the surface.
        """
        return not np.quantile(np.hypot(*expected_px.T), 0.9) > _FAR_PX

    def for_points(self, surfaces: ChipSurfaces) -> ChipSurfaces:
        """Return the surfaces from which tie points of the fit are taken: each chip's own."""
        return surfaces

    def for_check(self, surfaces: ChipSurfaces, layout: ChipLayout) -> ChipSurfaces:
        """Return the surfaces from which check points are taken: each chip's own."""
        return surfaces

    def _run(
        self, images: Resampled, places: Places, radius_px: int, context: Context, ways: int
    ) -> tuple[NDArray[np.int_], Surfaces]:
        """Return the centres that could be matched and surfaces (n, ways, 2 r + 1, 2 r + 1).

        The first way matches chips of the reference in the input. The second matches chips of the
        input in the reference, rotated by 180° so that it peaks at the same place.
        """
        reach = radius_px + BORDER_PX
        windows = ChipWindows(images, places, reach, self.held_out)

        def of_chips(chips: Description, search: Description, is_masked: bool) -> Surface:
            valid = search.patch.valid
            share = valid.mean(axis=(-2, -1), keepdims=True) if is_masked else 1.0
            return similarity_surface(
                chips.inner(radius_px), search, radius_px, self.settings, searched_share=share
            )

        masked = [image.mask is not None for image in (self.pair.reference, self.pair.input)]

        def surfaces(reference: Patch, input: Patch) -> Surfaces:
            pixels = places.chip_px**2
            of_reference = describe(reference, pixels, self.settings, context.memo)
            of_input = describe(input, pixels, self.settings)
            made = [of_chips(of_reference, of_input, masked[1])]
            if ways == 2:
                made.append(of_chips(of_input, of_reference, masked[0])[..., ::-1, ::-1])
            return np.stack(made, axis=1)

        def can_be_matched(reference: Patch, input: Patch) -> bool:
            return self._can_be_matched(reference) and self._can_be_matched(input)

        kept, found = windows.map(surfaces, context, can_be_matched)
        left_out = np.delete(places.centres, kept, axis=0)
        _log.debug("chips that are not matched lie at %s", left_out.tolist())
        span = 2 * radius_px + 1
        none = np.zeros((0, ways, span, span), np.float32)
        return places.centres[kept], np.stack(found) if found else none

    def _can_be_matched(self, core: Patch) -> bool:
        least = self.least_valid
        if least is None:
            least = LEAST_VALID_MASKED if self.pair.is_masked else _LEAST_VALID
        if core.valid_share < least:
            _log.debug("a chip is not matched: %.0f %% of it are valid", 100 * core.valid_share)
            return False
        if core.is_flat:
            _log.debug("a chip is not matched: it is constant")
            return False
        return True


def _equal_weight(surfaces: Surfaces) -> FloatArray:
    """Return the weights by which every chip counts the same in a fit.

    Unweighted, buildings would dominate: they have the highest peaks, but are displaced by layover.
    """
    return 1 / np.maximum(surfaces.max(axis=(1, 2), initial=0.0), _LEAST_HEIGHT).astype(float)
