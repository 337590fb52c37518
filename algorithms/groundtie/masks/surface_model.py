"""Ground and elevated objects of a surface model that images show, by the geometry of their views.

Elevated objects are imaged elsewhere than their feet, hide ground, and cast shadows. All of this is
computed from heights and views, without any inference from grey values.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import IntFlag
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import NoOverlapError
from ..geometry.views import RADAR, View, direction
from ..progress import SILENT, Progress
from ..rasters.grid import linear_part
from ..rasters.reading import FloatImage, Mask, Window
from ..rasters.tiling import tiles
from .object_heights import GROUND_REACH_M, LOWEST_M, FootprintModel, SurfaceModel, ground_cell_px
from .ray_casting import Heights, LineOfSight, double_bounce, hidden_ground, radar_echoes
from .scene import Scene, Selection, write_tiles
from .threshold import disc, grown

# Brightness of shadow relative to ground; correlation with an image hardly depends on it.
_SHADOW = np.float32(0.1)

# Echoes that double bounce adds for each pixel of a wall's height. Suite double_bounce: without
# double bounce, the error of the registration is 1.5 times as large; more echoes gain little.
DOUBLE_BOUNCE = 3.0

# Borders between pixels of the model and of rays are accurate to one pixel.
_GROWN_PX = 1


class Reason(IntFlag):
    """Reason why a pixel of the map takes no part; 0: both images show its ground."""

    RAISED = 1
    LAYOVER = 2
    RADAR_SHADOW = 4
    HIDDEN = 8
    CAST_SHADOW = 16
    UNKNOWN = 32


@dataclass(frozen=True)
class SurfaceGround:
    """The ground of a scene that is visible in the images of all given views.

    Parameters
    ----------
    scene
        The image whose pixels are selected; it is correctly placed on the map.
    model
        The elevated objects on the map.
    views
        Views from which the images were taken.
    offset_px
        Displacement of elevated objects in the scene relative to the model, in columns and rows.
    """

    scene: Scene
    model: SurfaceModel
    views: tuple[View, ...]
    offset_px: tuple[int, int] = (0, 0)

    def select(self, window: Window) -> Selection:
        """Return which pixels of a window take part."""
        valid = self.scene.read(window).valid
        return Selection(valid & (self.reasons(window) == 0), valid)

    def reasons(self, window: Window) -> NDArray[np.uint8]:
        """Return why pixels of a window take no part: bits of `Reason`, shape (h, w)."""
        heights, known, inside = self._around(window)
        found = [(Reason.RAISED, heights.surface_m > heights.ground_m), (Reason.UNKNOWN, ~known)]
        for view in self.views:
            found += self._not_shown(heights, view)
        reasons = np.zeros(known.shape, np.uint8)
        for reason, where in found:
            reasons[grown(where, disc(_GROWN_PX))] |= np.uint8(reason)
        return reasons[inside]

    def level(self, window: Window, view: View) -> FloatImage:
        """Return the logarithm of the simulated image from a view in a window, shape (h, w).

        All surfaces are assumed equally bright, radar shadow and cast shadow darker by 10 dB.
        """
        heights, _, inside = self._around(window)
        if view.sensor == RADAR:
            shown = self._echoes(heights, view).astype(np.float32)
        else:
            found = dict(self._not_shown(heights, view))
            dark = found.get(Reason.CAST_SHADOW, np.zeros((), bool)) & ~found[Reason.HIDDEN]
            shown = np.asarray(~dark, np.float32)
        return np.log(shown[inside] + _SHADOW)

    def image(self, window: Window, view: View, bounce: float = DOUBLE_BOUNCE) -> FloatImage:
        """Return the simulated radar amplitude from a view, shape (h, w); NaN where not known.

        `bounce` is the number of echoes that double bounce adds for each pixel of a wall's height.
        """
        heights, known, inside = self._around(window)
        lines = double_bounce(heights, self._sight(view.azimuth_deg, view.incidence_deg))
        power = (self._echoes(heights, view) + np.float32(bounce) * lines)[inside] + _SHADOW
        return np.where(known[inside], np.sqrt(power), np.float32(np.nan))

    def _echoes(self, heights: Heights, view: View) -> NDArray[np.int32]:
        """Return the number of echoes in each pixel of a radar image, including the ground's."""
        sight = self._sight(view.azimuth_deg, view.incidence_deg)
        ground = ~hidden_ground(heights, sight) & (heights.surface_m == heights.ground_m)
        return radar_echoes(heights, sight) + ground

    def _not_shown(self, heights: Heights, view: View) -> list[tuple[Reason, Mask]]:
        """Return the ground that an image from a view does not show, by reason."""
        sight = self._sight(view.azimuth_deg, view.incidence_deg)
        hidden = hidden_ground(heights, sight)
        if view.sensor == RADAR:
            laid_over = radar_echoes(heights, sight) > 0
            return [(Reason.RADAR_SHADOW, hidden), (Reason.LAYOVER, np.asarray(laid_over))]
        found = [(Reason.HIDDEN, hidden)]
        if view.sun_azimuth_deg is not None and view.sun_elevation_deg is not None:
            sunlight = self._sight(view.sun_azimuth_deg, 90 - view.sun_elevation_deg)
            found.append((Reason.CAST_SHADOW, hidden_ground(heights, sunlight)))
        return found

    def _sight(self, azimuth_deg: float, angle_deg: float) -> LineOfSight:
        """Return the line of sight towards an azimuth, at an angle from the vertical."""
        grid = self.scene.grid
        units = np.matmul(direction(azimuth_deg), grid.east_north)
        cols, rows = np.linalg.solve(linear_part(grid.transform), units).tolist()
        return LineOfSight((cols, rows), angle_deg)

    def require_cover(self) -> None:
        """Raise `NoOverlapError` if the model has no heights in the scene."""
        # A layer states no extent: without a building here, it is one of another place.
        is_layer = isinstance(self.model, FootprintModel)
        if self._highest_m is None or (is_layer and self._highest_m == 0):
            raise NoOverlapError("the surface model does not cover the reference")

    def _around(self, window: Window) -> tuple[Heights, Mask, tuple[slice, slice]]:
        """Return the heights that affect a window, where they are known, and the window in them."""
        longest = max(_longest(view) for view in self.views)
        return self._piece(window, (self._highest_m or 0.0) * longest)

    def _piece(self, window: Window, reach_m: float) -> tuple[Heights, Mask, tuple[slice, slice]]:
        """Return heights within reach of a window, where they are known, and the window in them."""
        # Ground is found in cells, which are aligned so that they are the same in every window.
        cell = ground_cell_px(self.scene.grid.pixel_size_m)
        around = (reach_m + GROUND_REACH_M) / self.scene.grid.pixel_size_m
        reach = math.ceil(around) + _GROWN_PX + cell
        piece = window.widened(reach).aligned(cell)
        right, down = self.offset_px
        moved = piece._replace(col=piece.col - right, row=piece.row - down)
        heights, known = self.model.heights(self.scene.grid.window(*moved))
        # Objects so low count as ground, which hides nothing.
        is_raised = heights.surface_m - heights.ground_m > LOWEST_M
        surface = np.where(is_raised, heights.surface_m, heights.ground_m)
        first_px = piece.col, piece.row
        return Heights(surface, heights.ground_m, first_px), known, window.slices_in(piece)

    @cached_property
    def _highest_m(self) -> float | None:
        """Height of the highest object; None if the model has no heights here."""
        highest = []
        for tile in tiles(self.scene.grid):
            heights, known, _ = self._piece(tile, 0.0)
            if known.any():
                highest.append(float((heights.surface_m - heights.ground_m).max()))
        return max(highest, default=None)


def write_image(
    ground: SurfaceGround,
    view: View,
    path: Path,
    progress: Progress = SILENT,
    bounce: float = DOUBLE_BOUNCE,
) -> None:
    """Write a raster of `SurfaceGround.image`."""

    def image(tile: Window) -> FloatImage:
        return ground.image(tile, view, bounce)

    write_tiles(ground.scene, path, image, progress, "float32", math.nan)


def _longest(view: View) -> float:
    """Return the longest reach on the ground, in metres, for each metre of height."""
    tangents = [math.tan(math.radians(view.incidence_deg))]
    if view.sensor == RADAR:
        tangents.append(1 / tangents[0])
    if view.sun_elevation_deg is not None:
        tangents.append(1 / math.tan(math.radians(view.sun_elevation_deg)))
    return max(tangents)
