"""What takes part in a registration: masks of a radar image, and of a dense town's ground.

Whatever a mask comes from, the user or the radar image, it becomes the same thing: a raster that
masks one image of the pair (see `user_masks`).
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, replace
from functools import cached_property

from ..context import Context
from ..errors import ParameterError
from ..masks.cast_shadow import shadow_azimuth_deg
from ..masks.choice import AUTO, NONE, REGIONS, MaskUsed, choose, is_reliable
from ..masks.regions import GroundRegions, find_ground
from ..masks.scene import Scene, Select
from ..masks.surface_model import SurfaceGround
from ..masks.threshold import ThresholdMask
from ..rasters.pair import ImagePair
from ..rasters.patch import middle_window
from .scene import SceneInfo
from .user_masks import with_mask


@dataclass(frozen=True)
class Masked:
    """A pair of which a part takes part.

    Parameters
    ----------
    pair
        The images with all masks: what is matched.
    used
        Which mask was made.
    ground
        The images with a mask of the ground alone, on which check points are matched where `pair`
        shows more of a dense town; None: no dense town, or nothing but ground takes part.
    surface
        What a surface model lets expect; None: there is none.
    """

    pair: ImagePair
    used: MaskUsed
    ground: ImagePair | None = None
    surface: SurfaceGround | None = None

    def on(self, pair: ImagePair) -> Masked:
        """Return the masks of the reference on another pair with the same reference."""
        ground = self.ground
        return Masked(
            replace(pair, reference=self.pair.reference),
            self.used,
            None if ground is None else replace(pair, reference=ground.reference),
            self.surface,
        )

    def exchanged(self) -> Masked:
        """Return the same with the roles of both images exchanged."""
        ground = None if self.ground is None else self.ground.exchanged()
        return replace(self, pair=self.pair.exchanged(), ground=ground)


def with_ground_mask(
    pair: ImagePair, kind: str, scene: SceneInfo, stack: ExitStack, context: Context
) -> Masked:
    """Return a pair with the mask of a kind on its radar image.

    Where buildings stand close, roofs and walls agree with each other at check points, too: the
    ground must confirm whatever else took part in the fit.

    Parameters
    ----------
    pair
        The images, with the masks that the user gave.
    kind
        One of `masks.choice.MASKS`.
    scene
        What the images are.
    stack
        Keeps the masks' rasters until it is closed.
    context
        Threads and progress.
    """
    if kind == AUTO and not scene.is_radar_and_camera:
        return Masked(pair, MaskUsed(NONE, None, 1.0, "there is no radar image beside a camera's"))
    town = _Town(pair, scene, stack, context)
    reason = "as asked for"
    if kind == AUTO:
        kind, reason = choose(scene.radar.strong_share, lambda: is_reliable(town.regions))
    if kind == REGIONS:
        masked, share = town.masked(town.regions.select)
        used = MaskUsed(REGIONS, scene.radar_name, share, reason, is_reliable(town.regions))
        return Masked(masked, used)
    ground = town.masked(town.regions.select)[0] if scene.is_dense_town else None
    if kind == NONE:
        return Masked(pair, MaskUsed(NONE, None, 1.0, reason), ground)
    by_level = ThresholdMask.of(town.scene, progress=context.progress)
    masked, share = town.masked(by_level.select)
    return Masked(masked, MaskUsed(kind, scene.radar_name, share, reason), ground)


@dataclass(frozen=True)
class _Town:
    """The radar image of a pair, and its ground, which is found once."""

    pair: ImagePair
    info: SceneInfo
    stack: ExitStack
    context: Context

    @property
    def scene(self) -> Scene:
        return self.info.radar.scene

    @cached_property
    def regions(self) -> GroundRegions:
        progress = self.context.progress
        if self.info.is_dense_town:
            return find_ground(self.scene, progress=progress, is_town=True)
        other = self.info.other.scene
        middle = other.read(middle_window(other.grid))
        shadow = shadow_azimuth_deg(middle) if middle.valid.any() else None
        return find_ground(self.scene, progress=progress, shadow_azimuth_deg=shadow)

    def masked(self, select: Select) -> tuple[ImagePair, float]:
        """Return the pair with a mask on the radar image, and the share that takes part."""
        name = self.info.radar_name
        return with_mask(self.pair, name, self.scene, select, self.stack, self.context)


def require_one_mask(kind: str, used: MaskUsed | None) -> None:
    """Raise `ParameterError` if a mask is asked for and a vector layer is given as one, too."""
    if used is not None and kind not in (NONE, AUTO):
        raise ParameterError(f"give either mask={kind} or a vector layer as mask")
