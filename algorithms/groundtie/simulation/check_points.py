"""Points on open ground and on roofs whose positions in both images are known exactly."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import map_coordinates

from ..rasters.grid import FloatArray, Grid, mesh
from .cover import OPEN_GROUND, Cover
from .noise import Stream, random_stream
from .optical import OpticalOptions, direction
from .range_power import LEVEL_PX
from .sar import SarOptions
from .scene import Scene, Scenes

IntArray = npt.NDArray[np.intp]

_PER_SIDE = 12
_TRIES = 20
_ROOF_MARGIN_PX = 2
_ITERATIONS = 30


@dataclass(frozen=True)
class RoofPoints:
    """Points on flat roofs that stand at both acquisitions and are visible to both sensors.

    Attributes
    ----------
    px : float64 array (n, 2)
        Reference pixels (col, row) of their true position on the map.
    height_m : float64 array (n,)
        Height above the ground.
    reference_px, input_px : float64 array (n, 2)
        Positions in the images; those in the input include the misregistration of the ground. On
        level ground, a radar image displaces them towards the radar by height / tan(incidence), an
        optical image away from the camera by height · tan(off-nadir angle).
    """

    px: FloatArray
    height_m: FloatArray
    reference_px: FloatArray
    input_px: FloatArray


@dataclass(frozen=True)
class InputImage:
    """The mapping from the ground to the input image.

    Attributes
    ----------
    to_px : function
        Maps reference pixels (col, row) of points on the ground to image pixels, (n, 2).
    grid : Grid
        Pixel grid of the image.
    """

    to_px: Callable[[FloatArray], FloatArray]
    grid: Grid

    def seen(self, px: FloatArray) -> tuple[FloatArray, npt.NDArray[np.bool_]]:
        """Return image positions of reference pixels, (..., 2), and a mask of those inside."""
        shown = self.to_px(px.reshape(-1, 2))
        inside = self.grid.contains(shown)
        return shown.reshape(px.shape), inside.reshape(px.shape[:-1])


def ground_points(scenes: Scenes, grid: Grid, image: InputImage) -> FloatArray:
    """Return one point on open ground in each cell of a lattice that has one.

    Returns
    -------
    float64 array (n, 2)
        Reference pixels (col, row).
    """
    px, place = _drawn(scenes.radar, grid, Stream.CHECK_POINTS)
    _, usable = image.seen(px)
    for scene in (scenes.radar, scenes.camera):
        usable &= np.isin(scene.parcels.cover[scene.parcel[place]], OPEN_GROUND)
        usable &= scene.object_m[place] == 0
    return _first_of_each(px, usable)


def roof_points(
    scenes: Scenes,
    grid: Grid,
    image: InputImage,
    sar: SarOptions,
    optical: OpticalOptions,
    radar_is_input: bool = False,
) -> RoofPoints:
    """Return one roof point in each cell of a lattice that has one visible to both sensors."""
    px, place = _drawn(scenes.radar, grid, Stream.ROOF_POINTS)
    height_m = scenes.radar.object_m[place].astype(float)
    shown = radar_position(scenes.radar, px, height_m, sar)
    before = camera_position(scenes.camera, px, height_m, optical)
    if radar_is_input:
        shown, before = before, shown
    seen, usable = image.seen(before)
    usable &= grid.contains(shown.reshape(-1, 2)).reshape(usable.shape)
    usable &= _inside_a_roof(scenes, place)
    usable &= ~_hidden_from_radar(scenes.radar, place, sar)
    usable &= ~_hidden_from_camera(scenes.camera, place, optical)
    return RoofPoints(*(_first_of_each(values, usable) for values in (px, height_m, shown, seen)))


def radar_position(
    scene: Scene, px: FloatArray, height_m: FloatArray, sar: SarOptions
) -> FloatArray:
    """Return the positions of elevated points in the geocoded radar image.

    The radar measures only the slant range; geocoding takes the bare terrain at that range.

    Parameters
    ----------
    px : float64 array (..., 2)
        Reference pixels (col, row) below the points.
    height_m : float64 array (...)
        Heights above the ground.
    """
    column, row = px[..., 0], px[..., 1]

    def terrain_m(x: FloatArray) -> FloatArray:
        place = np.stack([row, x]) + scene.margin_px
        # As in the radar image: no interpolation across rows, linear interpolation along them.
        place[0] = np.rint(place[0])
        return np.asarray(map_coordinates(scene.terrain_m, place, float, order=1, mode="nearest"))

    level_m, shown = terrain_m(column), column
    for _ in range(_ITERATIONS):
        above_m = level_m + height_m - terrain_m(shown)
        shown = column + sar.towards_radar * above_m * sar.cot_incidence / scene.pixel_size_m
    return np.stack([shown, row], axis=-1)


def camera_position(
    scene: Scene, px: FloatArray, height_m: FloatArray, optical: OpticalOptions
) -> FloatArray:
    """Return the positions of elevated points in an optical image without misregistration."""
    towards_camera = np.array(direction(optical.view_azimuth_deg))
    return np.asarray(
        px - towards_camera * (height_m * optical.lean / scene.pixel_size_m)[..., None]
    )


def _drawn(
    scene: Scene, grid: Grid, stream: Stream
) -> tuple[FloatArray, tuple[IntArray, IntArray]]:
    """Draw places in each cell of a lattice: reference pixels and scene (row, column)."""
    side = np.arange(_PER_SIDE)
    cell = mesh(side, side)[:, None]
    drawn = random_stream(scene.seed, stream).random((len(cell), _TRIES, 2))
    px = (cell + drawn) / _PER_SIDE * [grid.width - 1, grid.height - 1]
    column, row = np.rint(px).astype(np.intp).transpose(2, 0, 1) + scene.margin_px
    return px, (row, column)


def _first_of_each(values: FloatArray, usable: npt.NDArray[np.bool_]) -> FloatArray:
    """Return the values at the first usable place of each cell that has one."""
    first, has_one = usable.argmax(axis=1), usable.any(axis=1)
    return np.asarray(values[np.nonzero(has_one)[0], first[has_one]])


def _inside_a_roof(scenes: Scenes, place: tuple[IntArray, IntArray]) -> npt.NDArray[np.bool_]:
    """Whether the same roof surrounds a place in both scenes."""
    row, column = place
    number = scenes.radar.parcel[place]
    inside = scenes.radar.parcels.cover[number] == Cover.BUILDING
    rows, columns = scenes.radar.parcel.shape
    for scene in (scenes.radar, scenes.camera):
        for down in (-_ROOF_MARGIN_PX, 0, _ROOF_MARGIN_PX):
            for along in (-_ROOF_MARGIN_PX, 0, _ROOF_MARGIN_PX):
                beside = np.clip(row + down, 0, rows - 1), np.clip(column + along, 0, columns - 1)
                inside &= scene.parcel[beside] == number
    return np.asarray(inside)


def _hidden_from_radar(
    scene: Scene, place: tuple[IntArray, IntArray], sar: SarOptions
) -> npt.NDArray[np.bool_]:
    step = (sar.towards_radar, 0)
    return _hidden(scene.terrain_m + scene.object_m, scene, place, step, sar.cot_incidence)


def _hidden_from_camera(
    scene: Scene, place: tuple[IntArray, IntArray], optical: OpticalOptions
) -> npt.NDArray[np.bool_]:
    if optical.lean < 1e-6:
        return np.zeros(place[0].shape, bool)
    # The optical image is orthorectified: its terrain hides nothing.
    step = direction(optical.view_azimuth_deg)
    return _hidden(scene.object_m, scene, place, step, 1 / optical.lean)


def _hidden(
    height_m: npt.NDArray[np.float32],
    scene: Scene,
    place: tuple[IntArray, IntArray],
    step: tuple[float, float],
    rise: float,
) -> npt.NDArray[np.bool_]:
    """Whether the ray that rises towards a sensor is blocked; `step` is (columns, rows)."""
    row, column = place
    height_px = height_m / np.float32(scene.pixel_size_m)
    ray, highest = height_px[place], float(height_px.max())
    hidden = np.zeros(row.shape, bool)
    rows, columns = height_px.shape
    for k in range(1, math.ceil((highest - float(ray.min())) / rise) + 1):
        there = (
            np.rint(row + k * step[1]).astype(np.intp),
            np.rint(column + k * step[0]).astype(np.intp),
        )
        there = np.clip(there[0], 0, rows - 1), np.clip(there[1], 0, columns - 1)
        hidden |= height_px[there] > ray + k * rise + LEVEL_PX
    return hidden
