"""Facts about the images of a pair, each found once, when a step first needs it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import Any

import numpy as np

from ..context import Context
from ..geometry.models import Model
from ..kinds import AUTO
from ..masks.ground import shows_ground
from ..masks.open_ground import OpenGround
from ..masks.radar import (
    LEAST_VARIATION2,
    LEAST_VARIATION2_RATIO,
    is_in_decibels,
    to_amplitude,
    variation2_of,
)
from ..masks.scene import Scene
from ..masks.town import PERHAPS_TOWN_SHARE, TOWN_SHARE, share_of_strong_scatterers
from ..masks.used import INPUT, REFERENCE
from ..matching.band_shifts import BandShift, band_shifts
from ..matching.matcher import MaskOf
from ..matching.shared_content import ImageKinds, Sensors
from ..rasters.grid import Grid, PointFunction
from ..rasters.pair import Image, ImagePair, part_below, window_below
from ..rasters.patch import Patch
from ..rasters.radar_tags import is_known_radar
from ..rasters.reading import Mask, Window
from ..sensor.orientation import SensorGrid
from .specification import BOTH, NEITHER

# A layer of half opacity over a radar image halves the coefficient of variation of its speckle.
_LEAST_BENEATH_LAYER = 1 / 4


@dataclass(frozen=True)
class ImageFacts:
    """Facts about one image of a pair.

    Parameters
    ----------
    image
        The image.
    scene
        The image on the matching grid, extended as far as searches reach, with the user's masks.
    """

    image: Image
    scene: Scene

    @cached_property
    def is_known_radar(self) -> bool:
        """Whether its metadata name a radar."""
        return is_known_radar(self.image.source)

    @cached_property
    def variation2(self) -> float:
        """Squared coefficient of variation of the power in its most homogeneous windows."""
        return variation2_of(self.image, window_below(self.image.source.grid, self.scene.grid))

    @cached_property
    def strong_share(self) -> float:
        """Share of strong scatterers, 0 to 1: brighter than usual by 6 dB or more."""
        return share_of_strong_scatterers(self.scene)

    @cached_property
    def open_ground(self) -> OpenGround:
        """The part that is neither forest nor settlement, as far as a radar image shows it."""
        return OpenGround.of(self.scene)

    @cached_property
    def is_in_sensor_geometry(self) -> bool:
        """Whether it is located by a sensor model, so that relief displaces elevated objects."""
        return isinstance(self.image.source.grid, SensorGrid)

    @cached_property
    def has_pixel_size(self) -> bool:
        """Whether the size of its pixels on the ground is known.

        Without a CRS, units of the map are metres by convention only.
        """
        return self.scene.grid.crs is not None

    @cached_property
    def has_colours(self) -> bool:
        """Whether its bands make classes of colour, by which a town's ground is matched."""
        return self.image.has_colours

    @cached_property
    def has_chosen_band(self) -> bool:
        """Whether the user chose the band that is matched."""
        return self.image.band is not None

    @cached_property
    def band_shifts(self) -> Sequence[BandShift]:
        """Shifts of bands against the first band that shows the ground, in matching pixels."""
        grid = self.scene.grid
        scale = part_below(self.image.source.grid, grid).pixel_size_m / grid.pixel_size_m
        found = band_shifts(self.image.source)
        return [replace(one, apart_px=one.apart_px * scale) for one in found]

    @property
    def has_speckle(self) -> bool:
        """Whether it varies in its most homogeneous windows as a radar image does."""
        return self.variation2 >= LEAST_VARIATION2


@dataclass(frozen=True)
class SceneInfo:
    """Facts about a pair of images: radar or camera, speckled, built-up.

    Facts are found when they are first asked for, and never again.

    Parameters
    ----------
    reference, input
        Facts about the two images.
    declared
        Which image is declared to be a radar's: see `Specification.radar`.
    has_user_mask
        Whether the user gave a mask for one of the images, not only of clouds.
    """

    reference: ImageFacts
    input: ImageFacts
    declared: str = AUTO
    has_user_mask: bool = False

    @classmethod
    def of(cls, pair: ImagePair, declared: str = AUTO) -> SceneInfo:
        """Return the facts of a pair, with the masks that the user gave."""
        reference, input = (_facts_of(pair, name) for name in (REFERENCE, INPUT))
        return cls(reference, input, declared, pair.is_ground_masked)

    def prepare(self, context: Context) -> None:
        """Find what every registration asks for, in both images side by side."""
        # Python before 3.12 does not find one fact of two images at once, so facts take turns.
        asked = (
            (self.reference, "variation2"),
            (self.input, "band_shifts"),
            (self.input, "variation2"),
            (self.reference, "band_shifts"),
        )
        for _ in context.map(lambda one: getattr(*one), asked):
            pass

    @cached_property
    def radar_name(self) -> str:
        """The likelier radar image, "reference" or "input".

        It is found by declaration, else by metadata, else by speckle.
        """
        if self.declared in (REFERENCE, INPUT):
            return self.declared
        if self.reference.is_known_radar != self.input.is_known_radar:
            return REFERENCE if self.reference.is_known_radar else INPUT
        return REFERENCE if self.reference.variation2 >= self.input.variation2 else INPUT

    @property
    def radar(self) -> ImageFacts:
        """The likelier radar image."""
        return self.reference if self.radar_name == REFERENCE else self.input

    @property
    def other(self) -> ImageFacts:
        """The other image."""
        return self.input if self.radar_name == REFERENCE else self.reference

    @property
    def sensors(self) -> Sensors:
        """The sensors: those that a tool is for; else two radars if both images are rough.

        One image may be much rougher, as power is than amplitudes: layover is tested for all the
        same.
        """
        shown = Sensors.RADARS if self.are_both_rough else self.apparent
        return {BOTH: Sensors.RADARS, NEITHER: Sensors.CAMERAS}.get(self.declared, shown)

    @cached_property
    def are_both_rough(self) -> bool:
        """Whether both images have the speckle of a radar, or metadata that name one."""
        return all(one.is_known_radar or one.has_speckle for one in (self.reference, self.input))

    @cached_property
    def apparent(self) -> Sensors:
        """The apparent sensors: by stated views, else by metadata and speckle.

        They decide whether towns are looked for, whatever a tool is for: if only one image has
        speckle, the other may be a camera's.
        """
        if self.declared in (REFERENCE, INPUT):
            return Sensors.DIFFERENT
        radar = self.radar
        if not (radar.is_known_radar or radar.has_speckle):
            return Sensors.CAMERAS
        if not radar.is_known_radar and self._is_far_rougher:
            return Sensors.DIFFERENT
        if self.are_both_rough:
            return Sensors.RADARS
        return Sensors.DIFFERENT if radar.is_known_radar else Sensors.CAMERAS

    @property
    def _is_far_rougher(self) -> bool:
        return self.radar.variation2 >= LEAST_VARIATION2_RATIO * self.other.variation2

    @property
    def may_be_different(self) -> bool:
        """Whether they may be a radar and a camera image, unless a tool is for one kind.

        A layer drawn over both reduces speckle, and the camera's noise alike.
        """
        if self.declared in (BOTH, NEITHER) or self.apparent is Sensors.RADARS:
            return False
        is_rough = self.radar.variation2 >= _LEAST_BENEATH_LAYER * LEAST_VARIATION2
        return self.apparent is Sensors.DIFFERENT or (is_rough and self._is_far_rougher)

    def kinds_by(self, model: Model) -> ImageKinds:
        """Return what surveys of a model on the map need to know of the images."""
        return ImageKinds(
            self.sensors, self._open_ground_by(model), may_be_different=self.may_be_different
        )

    def _open_ground_by(self, model: Model) -> MaskOf | None:
        """Return a mask of what is not open ground in a radar image; None: there is none.

        Resampling reduces speckle, so what may be a radar image counts as one. The mask is that of
        the reference, or that of the input as a model on the map places it; pieces are moved there,
        but not rotated. It is found when first asked for.
        """
        if self.sensors is Sensors.CAMERAS and not self.may_be_different:
            return None

        def of_reference(piece: Grid) -> Mask:
            return self.reference.open_ground(piece)

        def of_input(piece: Grid) -> Mask:
            middle = piece.map_to_pixel(model(piece.pixel_to_map([piece.centre_px])))[0]
            col, row = np.rint(middle - piece.centre_px).astype(int).tolist()
            return self.input.open_ground(piece.window(col, row, *piece.size))

        is_of_reference = self.sensors is Sensors.RADARS or self.radar_name == REFERENCE
        return of_reference if is_of_reference else of_input

    @property
    def is_town(self) -> bool:
        """Whether the pair is a radar and a camera image, and the radar image shows a town."""
        return self.apparent is Sensors.DIFFERENT and self.radar.strong_share >= TOWN_SHARE

    @property
    def shows_ground(self) -> bool:
        """Whether the radar image resolves the ground between the buildings of a town."""
        return shows_ground(self.radar.scene)

    @property
    def is_town_of_unknown_size(self) -> bool:
        """Whether the radar image shows a town in pixels of unknown size.

        The ground is found, and the displacement by roofs is known, in metres. A user's mask needs
        neither.
        """
        return self.is_town and not self.radar.has_pixel_size and not self.has_user_mask

    @property
    def may_be_town(self) -> bool:
        """Whether an image may be a radar image of a town.

        Without speckle, a radar image has fewer strong scatterers and cannot be distinguished from
        a camera's. Both images are checked then, unless they are declared to be cameras'.
        """
        if self.are_both_rough:
            return False
        if self.apparent is Sensors.DIFFERENT:
            return self.radar.strong_share >= PERHAPS_TOWN_SHARE
        suspects = () if self.declared == NEITHER else (self.reference, self.input)
        return any(one.strong_share >= PERHAPS_TOWN_SHARE for one in suspects)

    @property
    def is_despeckled_town(self) -> bool:
        """Whether an image known or declared to be a radar's may show a town, and lacks speckle.

        Speckle filters leave no defined number of looks, and smooth roofs as they smooth the
        ground. A user's mask needs no speckle.
        """
        is_despeckled = self.apparent is Sensors.DIFFERENT and not self.radar.has_speckle
        return is_despeckled and self.may_be_town and not self.has_user_mask

    @property
    def _shown(self) -> Sensors | None:
        """The sensors that were found; None: they were not asked for."""
        known = vars(self)
        return Sensors.RADARS if known.get("are_both_rough") else known.get("apparent")

    def summary(self) -> dict[str, Any]:
        """Return the facts that were found, as values that JSON can carry; nothing is read."""
        found: dict[str, Any] = {}
        for name, facts in ((REFERENCE, self.reference), (INPUT, self.input)):
            known = vars(facts)
            values = {key: known[key] for key in _FACTS if key in known}
            if values:
                found[name] = values
        known = vars(self)
        shown = self._shown
        if shown is not None:
            found["sensors"] = shown.value
        if "radar_name" in known:
            found["radar_name"] = self.radar_name
        return found

    def facts(self) -> dict[str, str]:
        """Return the facts that were found, in words for people; nothing is read."""
        if self._shown is Sensors.RADARS:
            return {"images": "both are a radar's"}
        if self._shown is not Sensors.DIFFERENT:
            return {}
        facts = {"radar image": self.radar_name}
        radar = vars(self.radar)
        if "variation2" in radar:
            found = math.sqrt(radar["variation2"])
            facts["coefficient of variation"] = f"{found:.2f} in the most homogeneous windows"
        if "strong_share" in radar:
            facts["strong scatterers"] = f"{self.radar.strong_share:.0%} of the radar image"
        return facts


_FACTS = ("is_known_radar", "variation2", "strong_share")


def scene_of(pair: ImagePair, name: str) -> Scene:
    """Return one image of a pair on the matching grid, as far as searches may reach."""
    (image, to_px), grid = located(pair, name), pair.surroundings
    return Scene(grid, lambda at: image.read_onto(grid.window(*at), to_px), image.source)


def _facts_of(pair: ImagePair, name: str) -> ImageFacts:
    """Return the facts about an image; they are found in amplitudes, also those of decibels."""
    image, scene = located(pair, name)[0], scene_of(pair, name)
    part = window_below(image.source.grid, scene.grid)
    in_decibels = cache(lambda: is_in_decibels(image, part))

    def read(at: Window) -> Patch:
        return to_amplitude(scene.read(at)) if in_decibels() else scene.read(at)

    return ImageFacts(image, replace(scene, read=read))


def located(pair: ImagePair, name: str) -> tuple[Image, PointFunction]:
    """Return one image of a pair, and the nominal function from map positions to its pixels."""
    if name == REFERENCE:
        return pair.reference, pair.reference.source.grid.map_to_pixel
    return pair.input, pair.nominal_px
