"""Open ground of a radar image, between forests and settlements: areas without texture.

In a homogeneous area, speckle is the only variation; canopies, roofs and their shadows vary more
([Lopes1990a]), and so do borders, such as those of fields and roads. Borders are narrow, and remain
part of the open ground.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..rasters.grid import Grid
from ..rasters.patch import Patch, distance_to_masked, sample_of
from ..rasters.reading import Mask, Window
from ..speckle.statistics import (
    HOMOGENEOUS_EXCESS,
    LOOKS_WINDOW_PX,
    estimate_looks,
    local_statistics,
    window_counts,
)
from .radar import power
from .scene import Scene, Selection

# Side of areas, and the share of inhomogeneous windows from which on they have texture. Areas are
# wider than three windows: a border of two regions makes one window width inhomogeneous, the two
# sides of a road make two. Where two roads cross, that is 82 % of the area: 1 - (1 - 18 / 31)².
_AREA_PX, _SHARE = 31, 0.85

# Length of the radar shadow of trees 20 m high at an incidence angle of 37°.
_REACH_M = 15.0


@dataclass(frozen=True)
class OpenGround:
    """The part of a radar image that lies apart from areas with texture.

    Called with a piece of its grid, or of a reduced one, it returns all other pixels, as a
    `MaskOf`.

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
        """Return the open ground of a scene; its looks are estimated from a sample."""
        patch = sample_of(scene.read, scene.grid)
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
        """Return the pixels of a piece of the scene's grid that are no open ground, shape (h, w).

        A pixel of a reduced grid is open ground if all pixels that it averages are.
        """
        factor = round(piece.pixel_size_m / self.scene.grid.pixel_size_m)
        corner = self.scene.grid.map_to_pixel(piece.pixel_to_map([[-0.5, -0.5]])) + 0.5
        col, row = np.rint(corner[0]).astype(int)
        size = piece.width * factor, piece.height * factor
        part = self.select(Window(int(col), int(row), *size)).part
        return np.asarray(~part.reshape(piece.height, factor, piece.width, factor).all(axis=(1, 3)))

    @property
    def _beside_px(self) -> int:
        """Distance from the middle of an area with texture within which no pixel takes part."""
        return _AREA_PX // 2 + math.ceil(_REACH_M / self.scene.grid.pixel_size_m)

    def _areas(self, patch: Patch) -> Mask:
        """Return the middles of areas with texture."""
        variation2 = local_statistics(power(patch), patch.valid, LOOKS_WINDOW_PX).variation2
        textured = (variation2 > HOMOGENEOUS_EXCESS / self.looks) & patch.valid
        known = window_counts(patch.valid, _AREA_PX)
        return np.asarray((window_counts(textured, _AREA_PX) >= _SHARE * known) & (known > 0))
