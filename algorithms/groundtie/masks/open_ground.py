"""Open ground of a radar image, between forests and settlements: areas without texture.

In a homogeneous area speckle alone varies; canopies, roofs and their shadows vary more
([Lopes1990a]), and so do borders, as those of fields and roads. Borders are narrow, and stay.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..rasters.grid import Grid
from ..rasters.patch import Patch, distance_to_masked, middle_window
from ..rasters.reading import Mask, Window
from ..speckle.statistics import (
    HOMOGENEOUS_EXCESS,
    LOOKS_WINDOW_PX,
    estimate_looks,
    local_statistics,
    window_counts,
)
from .radar import SAMPLE_PX, power
from .scene import Scene, Selection

# Areas with texture are where so many windows are not homogeneous. They are wider than three
# windows: along the border of two regions one is not, along both sides of a road two, which is
# 82 % of an area where two roads cross: 1 - (1 - 18 / 31)².
_AREA_PX, _SHARE = 31, 0.85

# Radar shadow of trees of 20 m reaches so far at an incidence angle of 37°.
_REACH_M = 15.0


@dataclass(frozen=True)
class OpenGround:
    """What of a radar image lies apart from areas with texture.

    Called with a piece of its grid, or of a reduced one, it returns what is none, as a `MaskOf`.

    Parameters
    ----------
    scene
        Grey values are amplitudes.
    looks
        Equivalent number of looks.
    """

    scene: Scene
    looks: float

    @classmethod
    def of(cls, scene: Scene) -> OpenGround:
        """Return that of a scene whose looks are estimated in its middle."""
        patch = scene.read(middle_window(scene.grid, SAMPLE_PX))
        return cls(scene, estimate_looks(power(patch), patch.valid))

    def select(self, window: Window) -> Selection:
        """Return which pixels of a window take part."""
        around = window.widened(LOOKS_WINDOW_PX // 2 + _AREA_PX // 2 + self._beside_px)
        patch = self.scene.read(around)
        inside = window.slices_in(around)
        far = distance_to_masked(~self._areas(patch)) > self._beside_px
        valid = patch.valid[inside]
        return Selection(far[inside] & valid, valid)

    def __call__(self, piece: Grid) -> Mask:
        """Return which pixels of a piece of the scene's grid are no open ground, shape (h, w).

        A pixel of a reduced grid is where all are that it is the mean of.
        """
        factor = round(piece.pixel_size_m / self.scene.grid.pixel_size_m)
        corner = self.scene.grid.map_to_pixel(piece.pixel_to_map([[-0.5, -0.5]])) + 0.5
        col, row = np.rint(corner[0]).astype(int)
        size = piece.width * factor, piece.height * factor
        part = self.select(Window(int(col), int(row), *size)).part
        return np.asarray(~part.reshape(piece.height, factor, piece.width, factor).all(axis=(1, 3)))

    @property
    def _beside_px(self) -> int:
        """How far from the middle of an area with texture nothing takes part."""
        return _AREA_PX // 2 + math.ceil(_REACH_M / self.scene.grid.pixel_size_m)

    def _areas(self, patch: Patch) -> Mask:
        """Return the middles of areas with texture."""
        variation2 = local_statistics(power(patch), patch.valid, LOOKS_WINDOW_PX).variation2
        textured = (variation2 > HOMOGENEOUS_EXCESS / self.looks) & patch.valid
        known = window_counts(patch.valid, _AREA_PX)
        return np.asarray((window_counts(textured, _AREA_PX) >= _SHARE * known) & (known > 0))
