"""Similarity surfaces of many chips, both ways."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..progress import SILENT, Progress
from ..rasters.grid import Grid
from ..rasters.pair import ImagePair
from ..rasters.patch import Patch
from ..similarity.description import BORDER_PX
from ..similarity.peak import find_peak
from ..similarity.surface import (
    SimilaritySettings,
    describe,
    normalise,
    similarity_surface,
)
from .belief_propagation import Surfaces, normalise_each

FloatArray = NDArray[np.float64]
ToPixel = Callable[[FloatArray], FloatArray]
MaskOf = Callable[[Grid], NDArray[np.bool_]]

# Chips with less valid area than this in either image are not matched. What a mask leaves was
# chosen for what it tells: a little of it may be enough.
_LEAST_VALID, _LEAST_VALID_MASKED = 0.4, 0.1

# The background alone reaches about this many robust standard deviations.
_LEAST_HEIGHT = 3.0


@dataclass(frozen=True)
class ChipSurfaces:
    """Similarity surfaces of chips on a grid.

    Parameters
    ----------
    centres
        Pixel positions (col, row) of the chips in the grid, shape (n, 2).
    forward
        Surfaces of reference chips in the input, shape (n, 2 r + 1, 2 r + 1).
    backward
        Surfaces of input chips in the reference, turned so that they should peak at the same
        place, same shape.
    say
        By how much each chip's surface counts in a fit, shape (n,).
    """

    centres: NDArray[np.int_]
    forward: Surfaces
    backward: Surfaces
    say: FloatArray

    @cached_property
    def both(self) -> Surfaces:
        """The evidence of both directions together, in robust standard deviations."""
        return normalise_each(self.forward + self.backward)

    @property
    def weighed(self) -> Surfaces:
        """The evidence of both directions, by how much it counts in a fit."""
        return np.asarray(self.both * self.say[:, None, None], np.float32)

    def common_shift(self, px: FloatArray) -> FloatArray:
        """Return positions moved by the shift that all chips together agree on best."""
        return px + find_peak(normalise(self.weighed.sum(axis=0))).shift_px

    def together(self, groups: NDArray[np.int_]) -> ChipSurfaces:
        """Return what groups of chips say together, at their middles.

        Parameters
        ----------
        groups
            The number of each chip's group, shape (n,).
        """
        members = [groups == group for group in np.unique(groups)]
        say = self.say[:, None, None]

        def total(surfaces: Surfaces) -> Surfaces:
            added = [(surfaces[of] * say[of]).sum(axis=0) for of in members]
            return normalise_each(np.array(added, np.float32).reshape(-1, *surfaces.shape[1:]))

        middles = [np.rint(self.centres[of].mean(axis=0)) for of in members]
        return ChipSurfaces(
            np.array(middles, int).reshape(-1, 2),
            total(self.forward),
            total(self.backward),
            np.array([self.say[of].sum() for of in members]),
        )

    @property
    def radius(self) -> int:
        """Largest shift."""
        return self.forward.shape[1] // 2


@dataclass(frozen=True)
class ChipMatcher:
    """Matches chips of a pair on a grid, the input resampled by what is known already.

    Parameters
    ----------
    pair
        The images.
    grid
        Grid on which chips are matched: the matching grid or a coarser level of it.
    to_input_px
        From map positions to input pixels, as known so far.
    settings
        How similarity is measured.
    held_out
        Returns for a piece of the grid which pixels of the reference must not be seen; None: all
        may be.
    """

    pair: ImagePair
    grid: Grid
    to_input_px: ToPixel
    settings: SimilaritySettings
    held_out: MaskOf | None = None

    def match(
        self,
        centres: NDArray[np.int_],
        chip_px: int,
        radius_px: int,
        executor: Executor,
        progress: Progress = SILENT,
    ) -> ChipSurfaces:
        """Return the surfaces, both ways, of all chips that have enough valid pixels.

        Parameters
        ----------
        centres
            Pixel positions (col, row) of the chips' centres in the grid, shape (n, 2).
        chip_px
            Side of the chips.
        radius_px
            Largest shift.
        executor
            Threads to work in.
        progress
            Is told of every chip.
        """
        kept, found = self._run(centres, chip_px, radius_px, executor, progress, both_ways=True)
        forward, backward = found[:, 0], found[:, 1]
        return ChipSurfaces(kept, forward, backward, _same_say(normalise_each(forward + backward)))

    def match_forward(
        self,
        centres: NDArray[np.int_],
        chip_px: int,
        radius_px: int,
        executor: Executor,
        progress: Progress = SILENT,
    ) -> tuple[NDArray[np.int_], Surfaces]:
        """Return the centres that could be matched and their surfaces, one way, at half the cost.

        Parameters as `match`.
        """
        kept, found = self._run(centres, chip_px, radius_px, executor, progress, both_ways=False)
        return kept, found[:, 0]

    def _run(
        self,
        centres: NDArray[np.int_],
        chip_px: int,
        radius_px: int,
        executor: Executor,
        progress: Progress,
        *,
        both_ways: bool,
    ) -> tuple[NDArray[np.int_], Surfaces]:
        """Return the centres that could be matched and surfaces (n, ways, 2 r + 1, 2 r + 1)."""
        kept: list[NDArray[np.int_]] = []
        found: list[Surfaces] = []

        def one(centre: NDArray[np.int_]) -> Surfaces | None:
            progress.check()
            return self._surfaces(centre, chip_px, radius_px, both_ways)

        for i, surfaces in enumerate(executor.map(one, centres)):
            progress.update((i + 1) / len(centres))
            if surfaces is not None:
                kept.append(centres[i])
                found.append(surfaces)
        span = 2 * radius_px + 1
        none = np.zeros((0, 1 + both_ways, span, span), np.float32)
        return np.array(kept, int).reshape(-1, 2), np.stack(found) if found else none

    def _surfaces(
        self, centre: NDArray[np.int_], chip_px: int, radius_px: int, both_ways: bool
    ) -> Surfaces | None:
        reach = radius_px + BORDER_PX
        side = chip_px + 2 * reach
        corner = centre - chip_px // 2 - reach
        piece = self.grid.window(int(corner[0]), int(corner[1]), side, side)
        hidden = None if self.held_out is None else self.held_out(piece)
        reference = self.pair.reference_patch(piece, hidden)
        if not self._can_be_matched(reference.inner(radius_px)):
            return None
        input = self.pair.input_patch(piece, self.to_input_px)
        if not self._can_be_matched(input.inner(radius_px)):
            return None
        there = describe(reference, chip_px**2, self.settings)
        here = describe(input, chip_px**2, self.settings)
        forward = similarity_surface(there.inner(radius_px), here, radius_px, self.settings)
        if not both_ways:
            return forward[None]
        backward = similarity_surface(here.inner(radius_px), there, radius_px, self.settings)
        return np.stack([forward, backward[::-1, ::-1]])

    def _can_be_matched(self, chip: Patch) -> bool:
        core = chip.inner(BORDER_PX)
        least = _LEAST_VALID_MASKED if self.pair.is_masked else _LEAST_VALID
        return core.valid_share >= least and not core.is_flat


def _same_say(surfaces: Surfaces) -> FloatArray:
    """Return by what surfaces are multiplied so that every chip counts the same in a fit.

    The highest peaks are those of buildings, which lay over and lean.
    """
    return 1 / np.maximum(surfaces.max(axis=(1, 2), initial=0.0), _LEAST_HEIGHT).astype(float)
