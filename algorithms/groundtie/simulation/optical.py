"""The radiance that an off-nadir camera receives, on the pixels of the scene.

Terrain is orthorectified; buildings and trees are not. Relief displacement moves them away from the
camera by height · tan(off-nadir angle), where they occlude the ground behind. They cast shadows of
length height / tan(sun elevation).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter

from ..errors import ParameterError
from ..rasters.reading import FloatImage
from .cover import BANDS, Cover
from .noise import SmoothNoise, Stream, random_stream, strips
from .scene import Scene

MAX_DN = 2047

_DARK_DN = 60.0
_DN_PER_REFLECTANCE = 3400.0
_LEVEL_PX = 0.01
_AMBIENT = 0.3
_PATCHES_M = 18.0
_ROW_PERIOD_M = 5.0
# Relative contrast of fine texture, patches and plough rows of each class, in the order of Cover.
_FINE = np.array([0.03, 0.05, 0.07, 0.10, 0.02, 0.05, 0.12, 0.1, 0.15, 0.03], np.float32)
_PATCH = np.array([0.04, 0.07, 0.08, 0.05, 0.02, 0.0, 0.08, 0.0, 0.1, 0.04], np.float32)
_ROWS = np.array([0.0, 0.05, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.25, 0.0], np.float32)


@dataclass(frozen=True)
class OpticalOptions:
    """Viewing geometry, illumination and quality of the camera image.

    Attributes
    ----------
    sun_azimuth_deg, sun_elevation_deg : float
        Direction to the sun, clockwise from north and above the horizon.
    view_azimuth_deg, off_nadir_deg : float
        Direction from the ground to the camera, clockwise from north and from the vertical.
    bands : tuple of str
        Any of "blue", "green", "red", "nir".
    psf_sigma_px : float
        Standard deviation of the Gaussian point spread function, in pixels of the input image.
    noise_dn : float
        Standard deviation of the noise of a dark pixel; it grows with the square root of the
        signal.
    """

    sun_azimuth_deg: float = 155.0
    sun_elevation_deg: float = 48.0
    view_azimuth_deg: float = 250.0
    off_nadir_deg: float = 12.0
    bands: tuple[str, ...] = BANDS
    psf_sigma_px: float = 0.8
    noise_dn: float = 4.0

    def __post_init__(self) -> None:
        """Refuse options that cannot be simulated."""
        if not 10 <= self.sun_elevation_deg <= 90:
            raise ParameterError(
                f"sun_elevation_deg must be 10 to 90, not {self.sun_elevation_deg}"
            )
        if not 0 <= self.off_nadir_deg <= 60:
            raise ParameterError(f"off_nadir_deg must be 0 to 60, not {self.off_nadir_deg}")
        if not self.bands or not set(self.bands) <= set(BANDS):
            raise ParameterError(f"bands must be some of {', '.join(BANDS)}, not {self.bands}")
        if not 0.6 <= self.psf_sigma_px <= 5 or self.noise_dn < 0:
            raise ParameterError("psf_sigma_px must be 0.6 to 5 and noise_dn not negative")

    @property
    def lean(self) -> float:
        """Relief displacement in metres per metre of height."""
        return math.tan(math.radians(self.off_nadir_deg))

    @property
    def shadow(self) -> float:
        """Length of the cast shadow in metres per metre of height."""
        return 1 / math.tan(math.radians(self.sun_elevation_deg))


def render_radiance(scene: Scene, options: OpticalOptions) -> FloatImage:
    """Return the radiance that reaches the camera, before its optics and its noise.

    Returns
    -------
    float32 array (bands, rows, columns)
        Reflectance units, on all pixels of the scene including its margin.
    """
    rows, columns = scene.parcel.shape
    band_index = [BANDS.index(band) for band in options.bands]
    image = np.empty((len(band_index), rows, columns), np.float32)
    highest_px = float(scene.object_m.max()) / scene.pixel_size_m
    reach = math.ceil(highest_px * max(options.lean, options.shadow)) + 2
    patches = scene.patches(Stream.OPTICAL_PATCHES, _PATCHES_M)
    for index, start, stop in strips(rows):
        context = slice(max(start - reach, 0), min(stop + reach, rows))
        inside = slice(start - context.start, stop - context.start)
        brightness = _illumination(scene, context, options)
        texture = _texture(scene, context, patches, index)
        seen, is_wall = _visible(scene, context, options, inside)
        label = scene.parcel[context].ravel()[seen]
        wall = scene.parcels.wall_reflectance[label[is_wall]] * np.float32(_wall_light(options))
        factor = (brightness * texture).ravel()[seen]
        for k, band in enumerate(band_index):
            light = scene.parcels.reflectance[label, band] * factor
            light[is_wall] = wall
            image[k, start:stop] = light
    return image


def direction(azimuth_deg: float) -> tuple[float, float]:
    """Return the step (columns, rows) of length 1 towards an azimuth."""
    azimuth = math.radians(azimuth_deg)
    return math.sin(azimuth), -math.cos(azimuth)


def blur(image: FloatImage, sigma_px: float) -> None:
    """Apply a Gaussian point spread function to an image (rows, columns), in place."""
    gaussian_filter(image, sigma_px, output=image, mode="nearest")


def quantise(
    radiance: FloatImage, options: OpticalOptions, generator: np.random.Generator
) -> npt.NDArray[np.uint16]:
    """Return 11-bit grey values from 1, with noise that grows with the signal's square root."""
    signal = np.float32(_DARK_DN) + np.maximum(radiance, 0) * np.float32(_DN_PER_REFLECTANCE)
    if options.noise_dn > 0:
        noise = generator.standard_normal(signal.shape, dtype=np.float32)
        signal += noise * np.float32(options.noise_dn) * np.sqrt(signal / np.float32(_DARK_DN))
    return np.clip(np.rint(signal), 1, MAX_DN).astype(np.uint16)


def _wall_light(options: OpticalOptions) -> float:
    """Illumination of the walls that face the camera, which are treated as one plane."""
    turn = math.radians(options.sun_azimuth_deg - options.view_azimuth_deg)
    return _AMBIENT + (1 - _AMBIENT) * max(0.0, math.cos(turn)) * min(options.shadow, 1.0)


def _illumination(scene: Scene, rows: slice, options: OpticalOptions) -> FloatImage:
    """Illumination of ground, canopies and roofs; 1 on sunlit level ground."""
    terrain = scene.terrain_m[rows] / np.float32(scene.pixel_size_m)
    objects = scene.object_m[rows] / np.float32(scene.pixel_size_m)
    down, along = np.gradient(terrain)
    east, south = direction(options.sun_azimuth_deg)
    # Lambert's cosine relative to that of level ground.
    direct = 1 - (along * east + down * south) * np.float32(options.shadow)
    direct = np.maximum(direct, 0) / np.sqrt(1 + along**2 + down**2)
    wood = scene.cover(rows) == Cover.FOREST
    towards_sun = np.roll(objects, (-round(2 * south), -round(2 * east)), (0, 1))
    crowns = 1 + 0.45 * np.tanh((objects - towards_sun) * np.float32(0.6))
    direct[wood] *= crowns[wood]
    direct[_in_shadow(objects, options)] = 0
    return np.float32(_AMBIENT) + np.float32(1 - _AMBIENT) * direct


def _in_shadow(objects: FloatImage, options: OpticalOptions) -> npt.NDArray[np.bool_]:
    """Return a mask of the surfaces that lie in cast shadow.

    `shaded` is the height below which a point is shaded by objects within some distance towards
    the sun; each iteration doubles that distance. `ceiling` includes the point itself.
    """
    longest = float(objects.max()) * options.shadow
    if longest < 0.5:
        return np.zeros(objects.shape, bool)
    east, south = direction(options.sun_azimuth_deg)
    lowest = np.float32(-1e6)
    ceiling = _from_place(objects, 0, 0, lowest)
    shaded = np.full(objects.shape, lowest)
    distance = 1.0
    while distance <= longest + 1:
        step = round(distance * east), round(distance * south)
        drop = np.float32(math.hypot(*step) / options.shadow)
        moved = _from_place(ceiling, *step, lowest) - drop
        shaded = np.maximum(shaded, moved)
        ceiling = np.maximum(ceiling, moved)
        distance *= 2
    # An object that casts a shadow extends half a pixel beyond its pixel's centre.
    return objects < shaded + np.float32(0.5 / options.shadow - _LEVEL_PX)


def _from_place(image: FloatImage, columns: int, rows: int, outside: np.float32) -> FloatImage:
    """Return an image whose values come from `columns` and `rows` further on."""
    moved = np.full(image.shape, outside, image.dtype)
    height, width = image.shape
    if abs(rows) < height and abs(columns) < width:
        to = (
            slice(max(-rows, 0), height - max(rows, 0)),
            slice(max(-columns, 0), width - max(columns, 0)),
        )
        source = (
            slice(max(rows, 0), height - max(-rows, 0)),
            slice(max(columns, 0), width - max(-columns, 0)),
        )
        moved[to] = image[source]
    return moved


def _visible(
    scene: Scene, rows: slice, options: OpticalOptions, inside: slice
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.bool_]]:
    """Find the surface that the camera sees at each pixel of the map.

    Returns
    -------
    seen : array of the shape of the inside rows
        Flat index, within the context rows, of the pixel whose surface is seen.
    is_wall : bool array
        Whether the surface is that pixel's wall instead of its roof.
    """
    objects = scene.object_m[rows] / np.float32(scene.pixel_size_m)
    width = objects.shape[1]
    place = np.arange(objects.size).reshape(objects.shape)[inside]
    if options.lean < 1e-6:
        return place, np.zeros(place.shape, bool)
    # The ray to the camera rises with the distance from the pixel. The camera sees the farthest of
    # all objects that reach up to the ray.
    east, south = direction(options.view_azimuth_deg)
    per_px = np.float32(1 / options.lean)
    above = objects[inside].copy()
    seen = place.copy()
    # A pixel is seen if the ray passes less than half a pixel's rise above its centre.
    farthest = round(float(objects.max()) * options.lean + 0.5)
    for distance in range(1, farthest + 1):
        step = round(distance * east), round(distance * south)
        excess = _from_place(objects, *step, np.float32(-1))[inside] - distance * per_px
        hit = excess >= -per_px / 2
        seen[hit] = place[hit] + step[1] * width + step[0]
        above[hit] = excess[hit]
    cover = scene.parcels.cover[scene.parcel[rows].ravel()[seen]]
    return seen, (above >= per_px / 2) & (cover == Cover.BUILDING)


def _texture(scene: Scene, rows: slice, patches: SmoothNoise, index: int) -> FloatImage:
    """Relative brightness within the parcels, around 1."""
    label = scene.parcel[rows]
    cover = scene.parcels.cover[label]
    generator = random_stream(scene.seed, Stream.OPTICAL_TEXTURE, index)
    texture = 1 + _FINE[cover] * generator.standard_normal(label.shape, dtype=np.float32)
    texture += _PATCH[cover] * patches.rows(rows.start, rows.stop)
    if scene.pixel_size_m < _ROW_PERIOD_M / 2:
        angle = scene.parcels.rows_rad
        wave = np.float32(2 * math.pi * scene.pixel_size_m / _ROW_PERIOD_M)
        x = np.arange(label.shape[1], dtype=np.float32) * wave
        y = np.arange(rows.start, rows.stop, dtype=np.float32)[:, None] * wave
        phase = np.cos(angle)[label] * x + np.sin(angle)[label] * y
        texture += _ROWS[cover] * np.sin(phase)
    return np.maximum(texture, np.float32(0.2))
