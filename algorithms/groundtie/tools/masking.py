"""The mask of a registering tool: what of the radar image takes part, made before matching."""

from __future__ import annotations

import tempfile
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..masks.choice import INPUT, NONE, REFERENCE, MaskUsed
from ..masks.radar import is_more_speckled
from ..masks.scene import Scene, write_mask
from ..masks.threshold import Threshold
from ..progress import Progress
from ..rasters.pair import ImagePair, default_radius_m
from ..rasters.patch import Patch
from ..rasters.reading import Window, open_raster

AUTO = "auto"
MASK_IMAGES = (AUTO, REFERENCE, INPUT)


@dataclass(frozen=True)
class MaskRequest:
    """Which mask is asked for.

    Parameters
    ----------
    kind
        One of `MASKS`.
    image
        One of `MASK_IMAGES`.
    high_percent, low_percent, growth_m
        See `masks.threshold.Threshold`; the growth is in metres.
    """

    kind: str
    image: str
    high_percent: float
    low_percent: float
    growth_m: float

    def apply(
        self, pair: ImagePair, radius_m: float | None, stack: ExitStack, progress: Progress
    ) -> tuple[ImagePair, MaskUsed]:
        """Return the pair with the mask on one of its images, and what was done.

        Parameters
        ----------
        pair
            The images, with the masks that the user gave.
        radius_m
            Search radius; None: as `default_radius_m`.
        stack
            Keeps the mask's raster until it is closed.
        progress
            Is told of every tile.
        """
        if self.kind == NONE:
            return pair, MaskUsed(NONE, None, 1.0, "as asked for")
        name, reason = self._image(pair)
        radius_m = default_radius_m(pair.grid) if radius_m is None else radius_m
        scene = _scene(pair, name, radius_m)
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="groundtie-")))
        path = folder / "mask.tif"
        growth_px = round(self.growth_m / scene.grid.pixel_size_m)
        threshold = Threshold(self.high_percent, self.low_percent, growth_px)
        mask = threshold.on(scene, progress.part(0.0, 0.3))
        share = write_mask(scene, path, mask.select, progress.part(0.3, 1.0))
        masked = replace(getattr(pair, name), mask=stack.enter_context(open_raster(path)))
        return replace(pair, **{name: masked}), MaskUsed(self.kind, name, share, reason)

    def _image(self, pair: ImagePair) -> tuple[str, str]:
        if self.image != AUTO:
            return self.image, "as asked for"
        if is_more_speckled(pair.reference, pair.input):
            return REFERENCE, "it has the more speckle"
        return INPUT, "it has the more speckle"


def _scene(pair: ImagePair, name: str, radius_m: float) -> Scene:
    """Return one image of a pair on the matching lattice, as far as searches may reach."""
    reach = int(np.ceil(radius_m / pair.grid.pixel_size_m))
    grid = pair.grid.window(
        -reach, -reach, pair.grid.width + 2 * reach, pair.grid.height + 2 * reach
    )

    def read(window: Window) -> Patch:
        piece = grid.window(*window)
        if name == REFERENCE:
            return pair.reference_patch(piece)
        return pair.input_patch(piece, pair.claimed_px)

    source = pair.reference.source if name == REFERENCE else pair.input.source
    return Scene(grid, read, source)
