"""Ground of a town: pixels apart from layover, radar shadow and roofs.

Along the radar's range direction an elevated object shows its bright layover first and its shadow
last. A roof therefore has layover before it and shadow behind it; ground between buildings has the
shadow of the nearer one before it and the layover of the farther one behind it. Layover and shadow
delimit the ground better than its brightness or texture.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ..errors import RasterContentError
from ..progress import SILENT, Progress
from ..rasters.patch import Patch, distance_to_masked
from ..rasters.reading import FloatImage, Mask
from .reduced import BlockMask, ReducedScene, reduction
from .scene import Scene
from .shadow_direction import shadow_azimuth_deg

# Dark pixels lie behind bright ones at distances up to the length of a building's layover and
# shadow together; larger distances are cut off. This and the following values were set on simulated
# cities (suites ground and towns).
_APART_M = 40.0
_OUTER_PERCENT = 25.0

# Percentage of the darkest means over 3 × 3 pixels that may be radar shadow, and of the brightest
# that may be layover.
_MEAN_PX = 3
_DARK_PERCENT, _BRIGHT_PERCENT = 25.0, 20.0

# Least mean distance of ground from layover and shadow, in metres and in pixels.
_GROUND_M, _GROUND_PX = 7.0, 3.0

# In larger pixels, no place in a main street, 18 m wide, lies far enough from layover and shadow on
# both sides; only roofs do. Suite coarse_towns: towns are registered right by the ground found in
# pixels of 3 m, and without this limit up to 4.5 px wrong in pixels of 4 to 6 m.
_COARSEST_M = 3.0


def shows_ground(scene: Scene) -> bool:
    """Whether a radar image, reduced as in `find_ground`, resolves ground between buildings.

    False without a CRS, as the pixel size is unknown.
    """
    grid = scene.grid
    return grid.crs is not None and grid.pixel_size_m * reduction(scene) <= _COARSEST_M


def find_ground(scene: Scene, progress: Progress = SILENT) -> BlockMask:
    """Find the ground of a town in its radar image.

    Parameters
    ----------
    scene
        Grey values are amplitudes.
    progress
        Receives every step.

    Raises
    ------
    RasterContentError
        No pixel of the scene is valid, or pixels are too large to resolve it, or of unknown size.
    """
    if scene.grid.crs is None:
        raise RasterContentError(
            f"{scene.like.path} has no CRS, and without the size of its pixels in metres the "
            "ground between buildings is not found; give it one"
        )
    if not shows_ground(scene):
        raise RasterContentError(
            f"{scene.like.path} does not resolve the ground between buildings: pixels are larger "
            f"than {_COARSEST_M:g} m, by themselves or as large scenes are reduced; give finer "
            "pixels, or a part of the scene"
        )
    image = ReducedScene.of(scene, progress)
    level_db, _ = image.without_speckle()
    return image.mask(ground_between_buildings(level_db, image.patch.valid, image.pixel_m))


def ground_between_buildings(level_db: FloatImage, valid: Mask, pixel_m: float) -> Mask:
    """Return the ground between the buildings of a radar image.

    Ground is where a geometric mean of four distances is large: to the nearest layover and to the
    nearest shadow in any direction, both with double weight, to the layover before the place in the
    radar's look direction, and to the shadow behind it. The look direction is inferred from the
    image.

    Parameters
    ----------
    level_db
        Smoothed image in decibels, shape (h, w).
    valid
        Validity of its pixels, same shape.
    pixel_m
        Size of a pixel.
    """
    farthest_px = max(_APART_M / pixel_m, _GROUND_PX)
    azimuth_deg = shadow_azimuth_deg(Patch(level_db, valid), _OUTER_PERCENT, round(farthest_px))
    level = cv2.blur(level_db, (_MEAN_PX, _MEAN_PX))
    darkest, brightest = np.percentile(level[valid], [_DARK_PERCENT, 100 - _BRIGHT_PERCENT])
    dark, bright = (level < darkest) & valid, (level > brightest) & valid
    least_px = max(_GROUND_M / pixel_m, _GROUND_PX)
    # The sixth power of the mean distance, as a ratio to the least one.
    mean6 = np.ones(level.shape, np.float32)
    for weight, px in (
        (2, distance_to_masked(~bright)),
        (2, distance_to_masked(~dark)),
        (1, distance_back_px(bright, azimuth_deg)),
        (1, distance_back_px(dark, azimuth_deg + 180)),
    ):
        ratio = np.minimum(px / np.float32(least_px), np.float32(farthest_px / least_px))
        mean6 *= ratio**weight
    return np.asarray((mean6 >= 1) & valid)


def distance_back_px(mask: Mask, azimuth_deg: float) -> FloatImage:
    """Return the distance of each pixel from the nearest mask pixel before it along a direction.

    Parameters
    ----------
    mask
        Shape (h, w).
    azimuth_deg
        The direction from the mask to the pixels, clockwise from the top of the image.

    Returns
    -------
    FloatImage
        Infinite where no pixel of the mask lies before it, same shape.
    """
    along = np.deg2rad(azimuth_deg)
    way = np.array([-np.cos(along), np.sin(along)])  # rows, columns
    axis = int(np.abs(way).argmax())
    forward = slice(None, None, 1 if way[axis] > 0 else -1)
    lines = (mask if axis == 0 else mask.T)[forward]
    # A line of sight moves sideways from one row to the next, but keeps its place in `last`.
    aside = np.rint(np.arange(len(lines)) * way[1 - axis] / abs(way[axis])).astype(int)
    places = aside.max() - aside
    last: NDArray[np.float32] = np.full(lines.shape[1] + np.ptp(aside), -np.inf, np.float32)
    steps = np.empty(lines.shape, np.float32)
    for number, (line, place) in enumerate(zip(lines, places, strict=True)):
        passed = last[place : place + len(line)]
        passed[line] = number
        steps[number] = number - passed
    steps = (steps / np.float32(abs(way[axis])))[forward]
    return np.asarray(steps if axis == 0 else steps.T)
