"""Keypoints matched all over a pair, tile by tile, near positions predicted by a coarse model."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from ..context import Context
from ..features.detectors import seen_whole
from ..features.keypoints import Keypoints
from ..features.matching import match_near
from ..features.tiles import MARGIN_PX, TILE_PX, Describing, Detecting, inside
from ..geometry.models import Model
from ..rasters.grid import FloatArray, Grid
from ..rasters.pair import ImagePair
from ..rasters.patch import Patch
from ..rasters.reading import Mask, Window
from ..rasters.tiling import tiles
from .matcher import Correspondences, MaskOf

# A keypoint lies in a part of an image if the part covers everything within this many of the
# keypoint's scales.
_INSIDE_SCALES = 1.5

# More keypoints per tile make matching slower, not better.
_MOST_PER_TILE = 6000

# Largest score: the ratio of the descriptor distances of the next candidate in the gate and of the
# partner. It is also the score if there is no other candidate.
_LARGEST_SCORE = 10.0


@dataclass(frozen=True)
class KeypointMatcher:
    """Matches keypoints on a pair's matching grid, near positions predicted by a coarse model.

    Parameters
    ----------
    pair
        The images.
    detector, descriptor
        The keypoint detector and descriptor.
    held_out
        Takes a piece of the grid and returns which pixels of the reference are hidden; None: none.
    shown
        The images with masks of the parts that may be matched, such as level ground. Keypoints
        outside the masks are left out; descriptors of the others still use all of the images.
        None: all may be matched.
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
            Largest distance of a partner from its position predicted by the model.
        context
            Threads and progress.
        """
        match_tile = partial(self._match_tile, coarse=model, gate=radius_px)
        parts = context.map(match_tile, list(tiles(self.pair.grid, TILE_PX)))
        px, partner_px, ratio = map(np.concatenate, zip(*parts, strict=True))
        # The farther the next descriptor in the gate, the better the match.
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
            # Masked in both images, so that descriptors lack the same part in each.
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
        """Return the strongest keypoints in a window of a patch that lie in a part of it."""
        found = self.detector.detect(patch)
        found = found.take(inside(found.position_px, window))
        return (found if part is None else lying_in(found, part)).strongest(_MOST_PER_TILE)


def lying_in(found: Keypoints, part: Mask) -> Keypoints:
    """Return the keypoints that lie in a part of an image, shape (h, w)."""
    return found.take(seen_whole(found, part, _INSIDE_SCALES))


def seen_around(tile: Window, grid: Grid, gate: int) -> Window:
    """Return the window to read for a tile: possible partners and the margin of their descriptors.

    It reaches beyond the grid by no more than the gate: farther out, hardly any pixel is valid.
    """
    whole = Window(0, 0, *grid.size)
    return tile.widened(gate + MARGIN_PX).common(whole.widened(gate))
