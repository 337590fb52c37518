"""What two images have the same, and what it may be: ground, a copy, or something drawn."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from ..similarity.in_common import Sameness


class Sensors(Enum):
    """What sensors the images may be of."""

    CAMERAS = "cameras"
    RADARS = "radars"
    DIFFERENT = "radar and camera"


@dataclass(frozen=True)
class SharedContent:
    """What images have the same where a transform has them, and what it may be.

    Parameters
    ----------
    sameness
        How much.
    sensors
        What the images may be.
    is_whole
        Whether the transform moves the array by whole pixels all over, whatever is nominal, as far
        as that is known: speckle moves what is drawn over two radars' images off whole pixels.
    off_drawn
        How far the transform is from those that move what is drawn: by whole pixels of the array,
        or hardly at all on the map. Up to 1, it may be one of them.
    """

    sameness: Sameness
    sensors: Sensors
    is_whole: bool = False
    off_drawn: float = 0.0

    @property
    def is_exact(self) -> bool:
        """Whether it lies too exactly on whole pixels for ground.

        Radar images of one ground vary alike where speckle has averaged out: those that do, do not
        count as exact.
        """
        is_ground = self.sensors is Sensors.RADARS and self.sameness.varies_as_ground
        return self.is_whole and not is_ground

    @property
    def is_evident(self) -> bool:
        """Whether more is the same than two views show of one ground, or lies too exactly so.

        Two radar images of one ground vary alike where speckle has averaged out, as in pixels of
        many looks.
        """
        same, are_moved = self.sameness, self.sensors is Sensors.RADARS and self.moves_as_ground
        is_ground = are_moved and same.has_one_ground and not same.covers_most
        return self.is_exact or (same.is_marked if is_ground else same.is_evident)

    @property
    def is_of_cameras(self) -> bool:
        """Whether none of the images is a radar's, as far as what they share shows it.

        A radar's and a camera's are hardly alike in coarse pixels, speckle or not.
        """
        return self.sensors is Sensors.CAMERAS and self.sameness.is_of_one_sensor

    @property
    def moves_as_ground(self) -> bool:
        """Whether the transform moves the image as nothing drawn is moved."""
        return self.off_drawn > 1

    @property
    def may_be_drawn(self) -> bool:
        """Whether what is the same may be all that matches, though no more than of one ground."""
        return self.sameness.covers_some and not self.is_explained

    @property
    def is_explained(self) -> bool:
        """Whether the images are copies, or one camera's views of one ground.

        What is left of them need not confirm the transform: copies leave nothing, and what a camera
        shows alike is most of what it shows. Each view of a radar has speckle of its own.
        """
        if self.sensors is Sensors.DIFFERENT:
            return False
        is_view = self.sensors is Sensors.CAMERAS and self.sameness.is_view
        return is_view or self.is_moved_view or self.sameness.is_copy

    @property
    def is_moved_view(self) -> bool:
        """Whether cameras' images are views of one ground by where they lie, and no copies."""
        are_views = self.sensors is Sensors.CAMERAS and not self.sameness.is_copy
        return are_views and self.moves_as_ground and self.sameness.leaves_ground

    @property
    def may_hide_ground(self) -> bool:
        """Whether what is explained may be drawn all the same, by its edges and place."""
        return self.sameness.has_sharp_edges and not self.is_moved_view

    @property
    def is_drawn(self) -> bool:
        """Whether its edges are not those of one ground.

        They lie beside one another; or they are sharper, of what is no copy or view.
        """
        same = self.sameness
        is_image = self.is_explained or same.is_copy_in_other_colours
        return same.has_edges_beside or (same.has_sharp_edges and not is_image)
