"""The mask of a registering tool: what of the radar image takes part, made before matching."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

from ..errors import ParameterError
from ..masks import regions, threshold
from ..masks.cast_shadow import shadow_azimuth_deg
from ..masks.choice import (
    AUTO,
    INPUT,
    LAYER,
    NONE,
    REFERENCE,
    REGIONS,
    MaskUsed,
    bright_share,
    choose,
    is_dense,
    is_perhaps_dense,
)
from ..masks.layer import read_layer
from ..masks.radar import are_both_radar, has_speckle, is_radar_and_camera, is_rather_radar
from ..masks.regions import GroundRegions, find_ground
from ..masks.scene import Scene, Selection, write_mask
from ..masks.threshold import Threshold
from ..matching.local import LocalSearch
from ..progress import Progress
from ..rasters.grid import Grid
from ..rasters.pair import Image, ImagePair
from ..rasters.patch import Patch
from ..rasters.radar_tags import is_known_radar
from ..rasters.reading import Window, open_raster

MASK_IMAGES = (AUTO, REFERENCE, INPUT)

_MIDDLE_PX = 2048


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
        See `masks.threshold.Threshold`; the growth is in metres. None: what is usual.
    width_m
        See `masks.regions.find_ground`; of the layer's lines, too.
    layer
        A vector layer that is the mask instead; None: none.
    """

    kind: str
    image: str
    high_percent: float | None
    low_percent: float
    growth_m: float
    width_m: float = regions.WIDTH_M
    layer: Path | None = None

    def apply(
        self, pair: ImagePair, stack: ExitStack, progress: Progress
    ) -> tuple[ImagePair, MaskUsed]:
        """Return the pair with the mask on one of its images, and what was done.

        Parameters
        ----------
        pair
            The images, with the masks that the user gave.
        stack
            Keeps the mask's raster until it is closed.
        progress
            Is told of every tile.
        """
        if self.layer is not None:
            return self._by_layer(pair, stack, progress)
        if self.kind == NONE:
            return pair, MaskUsed(NONE, None, 1.0, "as asked for")
        name, reason = self._image(pair)
        if self.kind == AUTO and not self._is_radar_beside_camera(pair, name):
            return pair, MaskUsed(NONE, None, 1.0, "there is no radar image beside a camera's")
        scene = scene_of(pair, name)
        other = scene_of(pair, INPUT if name == REFERENCE else REFERENCE)
        kind = self.kind
        find = cache(lambda: self._ground(scene, other, progress.part(0.1, 0.7)))
        if kind == AUTO:
            kind, reason = choose(scene, lambda _: find(), progress.part(0.0, 0.5))
        if kind == NONE:
            return pair, MaskUsed(NONE, None, 1.0, reason)
        select = self._selection(kind, scene, find, progress.part(0.7, 0.8))
        pair, share = masked(pair, name, scene, select, stack, progress.part(0.8, 1.0))
        return pair, MaskUsed(kind, name, share, reason)

    def ground(
        self,
        pair: ImagePair,
        used: MaskUsed,
        stack: ExitStack,
        progress: Progress,
    ) -> ImagePair | None:
        """Return a pair with a mask of its ground, if it shows a dense town and has another.

        Where buildings stand close, roofs and walls agree with each other at check points, too:
        what is on the ground must judge, whatever else took part in the fit.

        Parameters
        ----------
        pair
            The images, with the masks that the user gave.
        used
            The mask that was used.
        stack, progress
            See `apply`.

        Returns
        -------
        ImagePair
            None: no dense town, or nothing but ground takes part already.
        """
        # Where auto masks nothing, it has looked, and seen no dense town.
        if used.kind in (REGIONS, LAYER) or (self.kind, used.kind) == (AUTO, NONE):
            return None
        name, _ = self._image(pair)
        if not self._is_radar_beside_camera(pair, name):
            return None
        if not is_dense(bright_share(scene_of(pair, name), progress.part(0.0, 0.2))):
            return None
        regions_of = replace(self, kind=REGIONS, high_percent=None)
        return regions_of.apply(pair, stack, progress.part(0.2, 1.0))[0]

    def may_hide_a_town(self, pair: ImagePair, used: str) -> bool:
        """Tell whether a dense town may have been matched whole, if its ground does not judge.

        Without its speckle a radar image is not told from a camera's, and shines less. But it
        still shines.

        Parameters
        ----------
        pair
            The images, with the masks that the user gave.
        used
            The kind of mask that was used.
        """
        if used in (REGIONS, LAYER) or are_both_radar(pair.reference, pair.input):
            return False
        name, _ = self._image(pair)
        names = (name,) if self._is_radar_beside_camera(pair, name) else (REFERENCE, INPUT)
        return any(is_perhaps_dense(bright_share(scene_of(pair, one))) for one in names)

    def lacks_speckle(self, pair: ImagePair, used: str) -> bool:
        """Tell whether a radar image of a dense town lacks what its ground is found by.

        Filters leave no number of looks that tells calm places, and make roofs homogeneous.

        Parameters
        ----------
        pair, used
            See `may_hide_a_town`.
        """
        if used == LAYER or pair.is_masked:
            return False
        # Else a radar image is told by the very speckle, and need not be read for it.
        images = pair.reference, pair.input
        told = self.image != AUTO or any(is_known_radar(image.source) for image in images)
        if used != REGIONS and not told:
            return False
        name, _ = self._image(pair)
        if used != REGIONS and not self._is_radar_beside_camera(pair, name):
            return False
        if has_speckle(_ordered(pair, name)[0]):
            return False
        return is_perhaps_dense(bright_share(scene_of(pair, name)))

    def sees_radar(self, pair: ImagePair) -> bool:
        """Tell whether one of the images is a radar's for certain, and the other is not."""
        return self._is_radar_beside_camera(pair, self._image(pair)[0])

    def _is_radar_beside_camera(self, pair: ImagePair, name: str) -> bool:
        # Whoever names the image knows.
        return self.image != AUTO or is_radar_and_camera(*_ordered(pair, name))

    def _selection(
        self,
        kind: str,
        scene: Scene,
        find: Callable[[], GroundRegions],
        progress: Progress,
    ) -> Callable[[Window], Selection]:
        if kind == REGIONS:
            return find().select
        growth_px = round(self.growth_m / scene.grid.pixel_size_m)
        by_level = Threshold(self._high(threshold.HIGH_PERCENT), self.low_percent, growth_px)
        return by_level.on(scene, progress).select

    def _ground(self, scene: Scene, other: Scene, progress: Progress) -> GroundRegions:
        shown = other.read(_middle(other.grid))
        shade = shadow_azimuth_deg(shown) if shown.valid.any() else None
        high = self._high(regions.HIGH_PERCENT)
        return find_ground(scene, self.width_m, high, progress, shade)

    def _by_layer(
        self, pair: ImagePair, stack: ExitStack, progress: Progress
    ) -> tuple[ImagePair, MaskUsed]:
        """Return the pair with the vector layer's mask on the reference, which is in its place."""
        if self.kind not in (NONE, AUTO):
            raise ParameterError(f"give either mask={self.kind} or a mask layer")
        assert self.layer is not None
        scene = scene_of(pair, REFERENCE)
        select = read_layer(self.layer, scene, self.width_m).select
        pair, share = masked(pair, REFERENCE, scene, select, stack, progress)
        return pair, MaskUsed(LAYER, REFERENCE, share, f"what {Path(self.layer).name} covers")

    def _high(self, usual: float) -> float:
        return usual if self.high_percent is None else self.high_percent

    def _image(self, pair: ImagePair) -> tuple[str, str]:
        if self.image != AUTO:
            return self.image, "as asked for"
        name = REFERENCE if is_rather_radar(pair.reference, pair.input) else INPUT
        return name, "its metadata or its speckle tell that it is the radar's"


def by_what_is_left(search: LocalSearch, used: MaskUsed) -> LocalSearch:
    """Return a search whose chips share a joint histogram, if a mask leaves them too little."""
    if used.leaves_little and "nmi" in search.settings.measures:
        return search.of_ground(search.pair)
    return search


def _ordered(pair: ImagePair, name: str) -> tuple[Image, Image]:
    """Return the image of a name, and the other."""
    both = pair.reference, pair.input
    return both if name == REFERENCE else both[::-1]


def _middle(grid: Grid) -> Window:
    """Return the middle of a grid, of which a direction is told."""
    width, height = min(grid.width, _MIDDLE_PX), min(grid.height, _MIDDLE_PX)
    return Window((grid.width - width) // 2, (grid.height - height) // 2, width, height)


def masked(
    pair: ImagePair,
    name: str,
    scene: Scene,
    select: Callable[[Window], Selection],
    stack: ExitStack,
    progress: Progress,
) -> tuple[ImagePair, float]:
    """Return a pair with a mask on one image, and the share of it that takes part.

    The mask is a file until the stack is closed.
    """
    folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="groundtie-")))
    share = write_mask(scene, folder / "mask.tif", select, progress)
    mask = stack.enter_context(open_raster(folder / "mask.tif"))
    return replace(pair, **{name: replace(getattr(pair, name), mask=mask)}), share


def scene_of(pair: ImagePair, name: str) -> Scene:
    """Return one image of a pair on the matching lattice, as far as searches may reach."""
    grid = pair.surroundings

    def read(window: Window) -> Patch:
        piece = grid.window(*window)
        if name == REFERENCE:
            return pair.reference_patch(piece)
        return pair.input_patch(piece, pair.claimed_px)

    source = pair.reference.source if name == REFERENCE else pair.input.source
    return Scene(grid, read, source)
