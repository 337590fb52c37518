"""Masks of the ground that a radar image shows, in towns and in the country.

Like the user's masks, they become a raster that masks one image of the pair (see `user_masks`).
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import dataclass, replace

from ..context import Context
from ..masks.ground import find_ground
from ..masks.surface_model import SurfaceGround
from ..masks.used import GROUND, OPEN, REFERENCE, MaskUsed
from ..matching.shared_content import Sensors
from ..rasters.pair import ImagePair
from .scene import SceneInfo
from .user_masks import with_mask

# Displacement of all points alike by elevated objects: standard deviation along an axis.
# In a town, where only the ground that its radar image shows is matched: in matching pixels of
# whatever size (suites city, seeds 300 to 339, and towns, seeds 131 to 150: with 0.5 px CE90 holds
# 47 of 59 errors, with this 53), more where the camera looks obliquely (suite rpc_city, seeds 60 to
# 74). Where all of the town is matched: in metres (suite coarse_towns).
# Open ground still contains houses and rims of forests (suite calibration, SAR–SAR, rural, same
# orbit, seeds 480 to 599: without it CE90 holds 79 % of errors).
_ON_GROUND_PX, _OBLIQUE_PX, _WHOLE_M = 0.65, 0.9, 10.0
_OPEN_PX = 0.15

# With more than this share of open ground, the masked registration repeats the refused one and adds
# no evidence. Correct registrations by open ground had up to 90 %; one that was 12 px wrong, in a
# forest that the mask missed, had 99 % (suite attacks: overlay on aligned ground/JPEG blocks/
# simss-rural/match_sar_sar/34004).
_MOST_OPEN = 0.95


@dataclass(frozen=True)
class Masked:
    """A pair with all masks, as it is matched.

    Parameters
    ----------
    pair
        The images with all masks.
    scene
        Facts about the images.
    used
        Which mask of the ground was made.
    surface
        The ground by a surface model; None: there is no model.
    """

    pair: ImagePair
    scene: SceneInfo
    used: MaskUsed
    surface: SurfaceGround | None = None

    def on(self, pair: ImagePair) -> Masked:
        """Return the masks of the reference on another pair with the same reference."""
        return replace(self, pair=replace(pair, reference=self.pair.reference))

    def exchanged(self) -> Masked:
        """Return the same masks with the roles of both images exchanged.

        `scene` still names the images by their original roles.
        """
        return replace(self, pair=self.pair.exchanged())


def with_ground_mask(
    pair: ImagePair, scene: SceneInfo, stack: ExitStack, context: Context
) -> Masked:
    """Return a pair, masked to the ground if it is a radar image of a town and a camera image.

    Where buildings stand close, roofs and walls agree with each other even at check points, so only
    the ground takes part.

    Parameters
    ----------
    pair
        The images, with the masks that the user gave.
    scene
        Facts about the images.
    stack
        Keeps the mask's raster until it is closed.
    context
        Threads and progress.
    """
    if scene.apparent is not Sensors.DIFFERENT:
        return Masked(pair, scene, MaskUsed.none("there is no radar image beside a camera's"))
    if not scene.is_town:
        reason = f"{_shown(scene)}: too few for a town"
        return Masked(pair, scene, MaskUsed.none(reason))
    if scene.is_town_of_unknown_size:
        reason = f"{_shown(scene)}, as in a town, in pixels of unknown size"
        return Masked(pair, scene, MaskUsed.none(reason))
    if not scene.shows_ground:
        reason = f"{_shown(scene)}, as in a town, in pixels too large to resolve streets"
        elevated_px = _WHOLE_M / pair.grid.pixel_size_m
        return Masked(pair, scene, MaskUsed.none(reason, elevated_px))
    return _of_town(pair, scene, stack, context)


def ground_instead(
    pair: ImagePair, scene: SceneInfo, stack: ExitStack, context: Context
) -> Masked | None:
    """Return a pair masked to the ground that a radar image shows; None: no such mask applies.

    It applies to a possible town beside a camera image. It also applies to any two radar images if
    open ground covers most of the reference, but not all: a minority must not outvote the rest.
    """
    if scene.has_user_mask:
        return None
    if scene.sensors is Sensors.RADARS:
        select = scene.reference.open_ground.select
        image, share = with_mask(pair, REFERENCE, scene.reference.scene, select, stack, context)
        reason = "what has texture over a wide area is forest or settlement"
        used = MaskUsed(OPEN, REFERENCE, share, reason, elevated_px=_OPEN_PX)
        is_part = not used.leaves_little and share <= _MOST_OPEN
        return Masked(image, scene, used) if is_part else None
    if scene.apparent is Sensors.DIFFERENT and scene.may_be_town and scene.shows_ground:
        return _of_town(pair, scene, stack, context)
    return None


def _of_town(pair: ImagePair, scene: SceneInfo, stack: ExitStack, context: Context) -> Masked:
    """Return a pair whose radar image is masked to the ground of a town."""
    radar, name = scene.radar.scene, scene.radar_name
    ground = find_ground(radar, context.progress)
    masked, share = with_mask(pair, name, radar, ground.select, stack, context)
    reason = f"{_shown(scene)}, as in a town"
    elevated_px = _OBLIQUE_PX if scene.input.is_in_sensor_geometry else _ON_GROUND_PX
    return Masked(masked, scene, MaskUsed(GROUND, name, share, reason, elevated_px=elevated_px))


def _shown(scene: SceneInfo) -> str:
    return f"strong scatterers on {scene.radar.strong_share:.0%} of the image"
