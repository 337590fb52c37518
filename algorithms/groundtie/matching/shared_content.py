"""Identical content of two images, and its likely origin: ground, a copy, or drawn content."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from ..similarity.in_common import Sameness
from .matcher import MaskOf


class Sensors(Enum):
    """Kinds of sensors that the images may come from."""

    CAMERAS = "cameras"
    RADARS = "radars"
    DIFFERENT = "radar and camera"


@dataclass(frozen=True)
class ImageKinds:
    """What surveys need to know of the images of a pair.

    Parameters
    ----------
    sensors
        Kinds of sensors that the images may come from; None: one is rendered from heights, and has
        no drawn content.
    open_ground
        Returns which pixels of a radar image are not open ground, of two that of the reference;
        None: there is no radar image.
    is_masked
        Whether a mask leaves the ground, so that open ground is not surveyed by itself.
    may_be_different
        Whether they may be a radar and a camera image, with a layer drawn over both.
    """

    sensors: Sensors | None
    open_ground: MaskOf | None = None
    is_masked: bool = False
    may_be_different: bool = False


@dataclass(frozen=True)
class SharedContent:
    """Identical content of two images aligned by a transform, and its likely origin.

    Parameters
    ----------
    sameness
        Measures of how much is identical.
    sensors
        Kinds of sensors that the images may come from.
    is_whole
        Whether the transform shifts the array by whole pixels everywhere, within its accuracy and
        whatever the nominal geotransform. Speckle moves an overlay in two radar images off whole
        pixels.
    off_drawn
        Distance of the transform from those that drawn content follows: shifts by whole pixels of
        the array, or hardly any shift on the map. Up to 1, it may be one of them.
    """

    sameness: Sameness
    sensors: Sensors
    is_whole: bool = False
    off_drawn: float = 0.0

    @property
    def is_exact(self) -> bool:
        """Whether the content lies too exactly on whole pixels for ground.

        Radar images of the same ground vary alike where speckle has averaged out, so images that
        do so never count as exact.
        """
        is_ground = self.sensors is Sensors.RADARS and self.sameness.varies_as_ground
        return self.is_whole and not is_ground

    @property
    def is_evident(self) -> bool:
        """Whether more is identical than in two views of the same ground, or `is_exact`.

        Two radar images of the same ground vary alike where speckle has averaged out, as in pixels
        of many looks.
        """
        same, are_moved = self.sameness, self.sensors is Sensors.RADARS and self.moves_as_ground
        is_ground = are_moved and same.has_one_ground and not same.covers_most
        return self.is_exact or self.is_noise or (same.is_marked if is_ground else same.is_evident)

    @property
    def is_noise(self) -> bool:
        """Whether two radar images share a pattern of noise.

        Other sensors, light and seasons change coarse structure.
        """
        return self.sensors is Sensors.RADARS and self.sameness.is_noise

    @property
    def is_of_cameras(self) -> bool:
        """Whether, judging by the shared content, neither image is a radar image.

        Radar and camera images are hardly alike in coarse pixels, with or without speckle.
        """
        return self.sensors is Sensors.CAMERAS and self.sameness.is_of_one_sensor

    @property
    def moves_as_ground(self) -> bool:
        """Whether the transform moves the image in a way that drawn content is never moved."""
        return self.off_drawn > 1

    @property
    def may_be_drawn(self) -> bool:
        """Whether drawn content may be all that matches, although it is not evident."""
        return not (self.is_evident or self.is_explained)

    @property
    def is_explained(self) -> bool:
        """Whether the images are copies, or views of the same ground by one camera.

        Then the remaining content need not confirm the transform: copies leave none, and most of
        what one camera shows is alike. Radar views are no such case: each has its own speckle.
        """
        if self.sensors is Sensors.DIFFERENT:
            return False
        is_view = self.sensors is Sensors.CAMERAS and self.sameness.is_view
        return is_view or self.is_moved_view or self.sameness.is_copy

    @property
    def is_moved_view(self) -> bool:
        """Whether the transform shows that camera images are views of the ground, not copies."""
        are_views = self.sensors is Sensors.CAMERAS and not self.sameness.is_copy
        return are_views and self.moves_as_ground and self.sameness.leaves_ground

    @property
    def may_hide_ground(self) -> bool:
        """Whether explained content may still be drawn, judging by its edges and position."""
        return self.sameness.has_sharp_edges and not self.is_moved_view

    @property
    def is_drawn(self) -> bool:
        """Whether the content cannot be that of the same ground.

        It is a pattern of noise, or its edges lie beside one another, or they coincide too sharply
        in images that are neither copies nor views.
        """
        same = self.sameness
        is_image = self.is_explained or same.is_copy_in_other_colours
        has_drawn_edges = same.has_edges_beside or (same.has_sharp_edges and not is_image)
        return self.is_noise or has_drawn_edges
