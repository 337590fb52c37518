"""Keypoints matched all over a pair, tile by tile, near where a coarse model puts them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from ..context import Context
from ..features.detectors import seen_whole
from ..features.keypoints import Keypoints
from ..features.matching import match_near
from ..features.tiles import MARGIN_PX, Describing, Detecting, inside, tiles
from ..geometry.models import Model
from ..rasters.grid import FloatArray, Grid
from ..rasters.pair import ImagePair
from ..rasters.patch import Patch
from ..rasters.reading import Mask, Window
from .matcher import Correspondences, MaskOf

# A keypoint lies in a part of an image if all within so many of its scales belongs to it.
_INSIDE_SCALES = 1.5

# More keypoints than this in a tile make matching longer, not better.
_MOST_PER_TILE = 6000

# A partner without a rival in its gate is as much nearer than the next as this, at most.
_LARGEST_SCORE = 10.0


@dataclass(frozen=True)
class KeypointMatcher:
    """Matches keypoints of a pair on its matching grid, near where a coarse model puts them.

    Parameters
    ----------
    pair
        The images.
    detector, descriptor
        How keypoints are found and described.
    held_out
        Returns for a piece of the grid which pixels of the reference must not be seen; None: all
        may be.
    shown
        The images with masks of what may be matched, as level ground; keypoints elsewhere are left
        out, but those beside see all of the images. None: all may be.
    """

    pair: ImagePair
    detector: Detecting
    descriptor: Describing
    held_out: MaskOf | None = None
    shown: ImagePair | None = None

    def match(self, model: Model, radius_px: int, context: Context) -> Correspondences:
        """Return the matches all over the matching grid.

        Parameters
        ----------
        model
            The misregistration on the map as known so far.
        radius_px
            How far a partner may lie from where the model predicts it.
        context
            Threads and progress.
        """
        match_tile = partial(self._match_tile, coarse=model, gate=radius_px)
        parts = context.map(match_tile, list(tiles(self.pair.grid)))
        px, partner_px, ratio = map(np.concatenate, zip(*parts, strict=True))
        # The better, the farther the next one in the gate is.
        score = 1 / np.maximum(ratio, 1 / _LARGEST_SCORE)
        return Correspondences(px, partner_px, score, float(np.pi * radius_px**2))

    def _match_tile(
        self, tile: Window, coarse: Model, gate: int
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the positions, (n, 2), of partners in both images, and their ratios, (n,)."""
        area = seen_around(tile, self.pair.grid, gate)
        piece = self.pair.grid.window(*area)
        masked = None if self.held_out is None else self.held_out(piece)
        reference = self.pair.reference_patch(piece, masked)
        to_input_px = self.pair.transform(coarse)
        input = self.pair.input_patch(piece, to_input_px)
        if masked is not None:
            # Where a descriptor sees less of the one image, it sees as little of the other.
            input = Patch(input.values, input.valid & ~masked)
        core = Window(tile.col - area.col, tile.row - area.row, tile.width, tile.height)
        parts: tuple[Mask | None, Mask | None] = None, None
        if self.shown is not None:
            parts = (
                self.shown.reference_patch(piece).valid,
                self.shown.input_patch(piece, to_input_px).valid,
            )
        own = self._features(reference, core, parts[0])
        others = self._features(input, core.widened(gate), parts[1])
        points, descriptors = self.descriptor.describe(reference, own)
        partners, partner_descriptors = self.descriptor.describe(input, others)
        matches = match_near(
            descriptors,
            partner_descriptors,
            points.position_px,
            partners.position_px,
            gate,
        )
        corner = np.array([area.col, area.row], float)
        return (
            points.position_px[matches.first] + corner,
            partners.position_px[matches.second] + corner,
            matches.ratio,
        )

    def _features(self, patch: Patch, window: Window, part: Mask | None) -> Keypoints:
        """Return the strongest keypoints in a window of a patch, of those in a part of it."""
        found = self.detector.detect(patch)
        found = found.take(inside(found.position_px, window))
        return (found if part is None else lying_in(found, part)).strongest(_MOST_PER_TILE)


def lying_in(found: Keypoints, part: Mask) -> Keypoints:
    """Return the keypoints that lie in a part of an image, shape (h, w)."""
    return found.take(seen_whole(found, part, _INSIDE_SCALES))


def seen_around(tile: Window, grid: Grid, gate: int) -> Window:
    """Return what is read for a tile: where partners may lie, and what these see within the grid.

    Further beyond the grid mostly nothing is valid, and all that is done there is done in vain.
    """
    whole = Window(0, 0, *grid.size)
    return tile.widened(gate + MARGIN_PX).common(whole.widened(gate))
