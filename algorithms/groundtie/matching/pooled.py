"""Chips of ground: what a mask leaves of them is matched by one joint histogram of all."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np
from affine import Affine
from numpy.typing import NDArray

from ..errors import TooFewPointsError
from ..geometry.models import PARAMETERS, Model
from ..progress import SILENT, Progress
from ..rasters.grid import Grid
from ..rasters.pair import ImagePair
from ..rasters.patch import Patch
from ..rasters.reading import FloatImage
from ..similarity.pooled import PooledHistogram, smooth
from ..similarity.surface import Surface
from .alignment import align
from .belief_propagation import normalise_each
from .chips import ChipSurfaces, MaskOf, ToPixel
from .coarse import behind

# Chips with less ground than this say nothing; fewer pixels in all make no joint histogram, and
# more are not needed for one.
_LEAST_VALID = 0.02
_LEAST_PIXELS, _MOST_PIXELS = 5_000, 4_000_000

# Side of the chips on a level of the pyramid, in pixels of the level.
_LEVEL_CHIP_PX = 64


@dataclass(frozen=True)
class GroundChips:
    """Chips of a masked pair, the input resampled by what is known already.

    The masked image's chips are the templates: the other image has no mask of its own, and what
    it shows beside the ground must not take part.

    Parameters
    ----------
    pair
        The images; one of them has a mask.
    grid
        Grid on which chips are matched: the matching grid or a coarser level of it.
    to_input_px
        From map positions to input pixels, as known so far.
    held_out
        Returns for a piece of the grid which pixels of the reference must not be seen; None: all
        may be.
    """

    pair: ImagePair
    grid: Grid
    to_input_px: ToPixel
    held_out: MaskOf | None = None

    def levels(
        self, centres: NDArray[np.int_], chip_px: int, executor: Executor, progress: Progress
    ) -> PooledHistogram:
        """Return what pairs of grey levels say by chips as they lie on each other now.

        Raises
        ------
        TooFewPointsError
            The mask leaves too few pixels.
        """
        every = max(len(centres) * chip_px**2 // _MOST_PIXELS, 1)

        def pixels(centre: NDArray[np.int_]) -> FloatImage:
            progress.check()
            template, shown = self._windows(centre, chip_px, 0)
            both = template.valid & shown.valid
            return np.stack([smooth(template).values[both], shown.values[both]])[:, ::every]

        sample = np.concatenate(list(executor.map(pixels, centres)), axis=1)
        count = sample.shape[1] * every
        if count < _LEAST_PIXELS:
            raise TooFewPointsError(f"the mask leaves only about {count} pixels to match")
        return PooledHistogram.of(sample[0], sample[1])

    def match(
        self,
        levels: PooledHistogram,
        centres: NDArray[np.int_],
        chip_px: int,
        radius_px: int,
        executor: Executor,
        progress: Progress = SILENT,
    ) -> ChipSurfaces:
        """Return the surfaces of all chips that have enough ground.

        They are matched one way alone, so both ways are the same.

        Parameters
        ----------
        levels
            What pairs of grey levels say.
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
        turn = 1 if self._forward else -1

        def one(centre: NDArray[np.int_]) -> Surface | None:
            progress.check()
            template, search = self._windows(centre, chip_px, radius_px)
            chip = template.inner(radius_px)
            if chip.valid_share < _LEAST_VALID:
                return None
            return levels.surface(chip, search)[::turn, ::turn]

        kept, found = [], []
        for i, surface in enumerate(executor.map(one, centres)):
            progress.update((i + 1) / len(centres))
            if surface is not None:
                kept.append(centres[i])
                found.append(surface)
        span = 2 * radius_px + 1
        nats = np.stack(found) if found else np.zeros((0, span, span), np.float32)
        shown = normalise_each(nats)
        # Chips count by what they say, in nats; on average as much as those of other similarities.
        spread = np.ptp(nats, axis=(1, 2)) / np.maximum(np.ptp(shown, axis=(1, 2)), 1e-9)
        heights = shown.max(axis=(1, 2), initial=0.0) * spread
        say = spread / max(float(heights.mean()), 1e-9) if found else spread
        return ChipSurfaces(np.array(kept, int).reshape(-1, 2), shown, shown, say)

    @property
    def _forward(self) -> bool:
        return self.pair.reference.mask is not None

    def _windows(
        self, centre: NDArray[np.int_], chip_px: int, radius_px: int
    ) -> tuple[Patch, Patch]:
        """Return the masked image's and the other's window around a chip, as wide as searched."""
        side = chip_px + 2 * radius_px
        corner = centre - chip_px // 2 - radius_px
        piece = self.grid.window(int(corner[0]), int(corner[1]), side, side)
        hidden = None if self.held_out is None else self.held_out(piece)
        reference = self.pair.reference_patch(piece, hidden)
        input = self.pair.input_patch(piece, self.to_input_px)
        return (reference, input) if self._forward else (input, reference)


def refine_on_ground(
    pair: ImagePair,
    level: Grid,
    model: Model,
    radius_px: int,
    held_out: MaskOf,
    executor: Executor,
) -> Model:
    """Return a better affine model by all the ground that a level of the pyramid shows.

    Parameters
    ----------
    pair
        The images; one of them has a mask.
    level
        The matching grid at reduced resolution.
    model
        The misregistration on the map as known so far, of degree 1.
    radius_px
        How far it may be wrong, in pixels of the level.
    held_out
        Returns for a piece of the grid which pixels of the reference must not be seen.
    executor
        Threads to work in.

    Raises
    ------
    TooFewPointsError
        The mask leaves too few pixels.
    """
    chips = GroundChips(pair, level, lambda xy: pair.claimed_px(model(xy)), held_out)
    centres = tile_centres((level.width, level.height), _LEVEL_CHIP_PX)
    levels = chips.levels(centres, _LEVEL_CHIP_PX, executor, SILENT)
    found = chips.match(levels, centres, _LEVEL_CHIP_PX, radius_px, executor)
    if len(found.centres) < PARAMETERS["affine"]:
        raise TooFewPointsError(f"only {len(found.centres)} chips show any ground")
    identity = Affine.identity()
    aligned = align("affine", found.centres, found.weighed, identity, found.common_shift)
    return behind(model, aligned.model, level)


def tile_centres(size: tuple[int, int], chip_px: int) -> NDArray[np.int_]:
    """Return the centres (col, row) of chips that cover a grid side by side, shape (n, 2)."""
    sides = [np.arange(length // chip_px) * chip_px + chip_px // 2 for length in size]
    cols, rows = np.meshgrid(*sides)
    return np.column_stack([cols.ravel(), rows.ravel()])
