"""A geocoded amplitude image of a side-looking radar.

The radar is far away (parallel rays), flies along the columns and looks along the rows. Power is
accumulated over slant range, which brings foreshortening, layover, double bounce and shadow by
itself. The image is then geocoded with the bare terrain, as products are that were corrected with
a terrain model: ground lies at its place on the map, roofs are displaced towards the sensor by
height / tan(incidence).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter

from ..errors import ParameterError
from ..rasters.reading import FloatImage
from .cover import Cover
from .noise import SmoothNoise, Stream, random_stream, strips
from .scene import Scene

ORBITS = ("ascending", "descending")

_SAMPLES_PER_PIXEL = 2
_MIN_WALL_PX = 0.5
_NORMAL_SIGMA_PX = 1.5
_LEVEL_PX = 0.05

# Standard deviation of the fine texture of each class in dB, in the order of Cover.
_TEXTURE_DB = np.array([0.3, 0.6, 0.8, 2.0, 0.3, 2.5, 2.5, 2.0, 2.0, 0.3], np.float32)
_PATCH_DB = 0.7
_PATCH_M = 25.0
_BRIGHT_POINT_SHARE = 0.004
_BRIGHT_POINTS_ON = (Cover.BUILDING, Cover.PAVEMENT, Cover.RAIL)
_BRIGHT_POINT_DB = 15.0
_STOREY_M = 3.0
_WALL_BACKSCATTER = 0.3
# Share of a wall's power that comes from the corners of its windows, and where in a storey.
_GLITTER_SHARE = 0.7
_SILL = 0.3
_DOUBLE_BOUNCE_PER_PX = 1.2
_CORNER_WIDTH_COS = math.cos(math.radians(12))
_NOISE_FLOOR = 10 ** (-25 / 10)


@dataclass(frozen=True)
class SarOptions:
    """How the radar looks.

    Attributes
    ----------
    incidence_deg : float
        Incidence angle on level ground.
    orbit : str
        "ascending": flies north and looks east (towards +columns); "descending": flies south and
        looks west. The radar looks to the right.
    looks : float
        Equivalent number of looks; infinity for an image without speckle.
    amplitude_at_0_db : float
        Grey value of a backscatter of 0 dB.
    """

    incidence_deg: float = 35.0
    orbit: str = "ascending"
    looks: float = 1.0
    amplitude_at_0_db: float = 2000.0

    def __post_init__(self) -> None:
        """Refuse what cannot be simulated."""
        if not 10 <= self.incidence_deg <= 70:
            raise ParameterError(f"incidence_deg must be 10 to 70, not {self.incidence_deg}")
        if self.orbit not in ORBITS:
            raise ParameterError(f"orbit must be ascending or descending, not {self.orbit!r}")
        if not self.looks > 0 or not self.amplitude_at_0_db > 0:
            raise ParameterError("looks and amplitude_at_0_db must be positive")

    @property
    def cot_incidence(self) -> float:
        """Ground metres of layover for a metre of height."""
        return 1 / math.tan(math.radians(self.incidence_deg))

    @property
    def azimuth_deg(self) -> float:
        """Where the radar stands, seen from the ground, clockwise from the top of the image."""
        return 270.0 if self.orbit == "ascending" else 90.0


def render_sar(scene: Scene, options: SarOptions) -> npt.NDArray[np.uint16]:
    """Return the amplitude image, uint16 (rows, columns), of the scene without its margin."""
    rows, columns = scene.window
    image = np.empty((rows.stop - rows.start, columns.stop - columns.start), np.uint16)
    patches = _patches(scene)
    for index, start, stop in strips(image.shape[0]):
        power = _strip_power(
            scene, slice(rows.start + start, rows.start + stop), index, options, patches
        )[:, columns]
        speckle = random_stream(scene.seed, Stream.SPECKLE, index)
        image[start:stop] = quantise_amplitude(add_speckle(power, options.looks, speckle), options)
    return image


def sar_power(scene: Scene, options: SarOptions) -> FloatImage:
    """Return the expected power, float32, that `render_sar` would put speckle on."""
    rows, columns = scene.window
    patches = _patches(scene)
    return np.concatenate(
        [
            _strip_power(scene, slice(rows.start + a, rows.start + b), i, options, patches)
            for i, a, b in strips(rows.stop - rows.start)
        ]
    )[:, columns]


def add_speckle(power: FloatImage, looks: float, generator: np.random.Generator) -> FloatImage:
    """Multiply a power image by fully developed speckle (gamma distributed, mean 1)."""
    if math.isinf(looks):
        return power
    speckle = generator.standard_gamma(looks, power.shape, dtype=np.float32)
    return power * speckle / np.float32(looks)


def quantise_amplitude(power: FloatImage, options: SarOptions) -> npt.NDArray[np.uint16]:
    """Return amplitudes as grey values from 1; 0 stays free for nodata."""
    amplitude = np.sqrt(power) * np.float32(options.amplitude_at_0_db)
    return np.clip(np.rint(amplitude), 1, 65535).astype(np.uint16)


def _patches(scene: Scene) -> SmoothNoise:
    generator = random_stream(scene.seed, Stream.SAR_PATCHES)
    shape = (scene.parcel.shape[0], scene.parcel.shape[1])
    return SmoothNoise.draw(shape, max(_PATCH_M / scene.pixel_size_m, 3.0), generator)


def _strip_power(
    scene: Scene, rows: slice, index: int, options: SarOptions, patches: SmoothNoise
) -> FloatImage:
    """Expected power of some full rows of the scene, geocoded."""
    texture = random_stream(scene.seed, Stream.SAR_TEXTURE, index)
    # A look towards -columns is one towards +columns at the mirrored scene.
    mirror = slice(None, None, -1 if options.orbit == "descending" else 1)
    terrain = scene.terrain_m[rows, mirror] / np.float32(scene.pixel_size_m)
    objects = scene.object_m[rows, mirror] / np.float32(scene.pixel_size_m)
    backscatter = _backscatter(scene, rows, patches, texture)[:, mirror]
    building = scene.cover(rows)[:, mirror] == Cover.BUILDING
    walls = random_stream(scene.seed, Stream.SAR_WALLS, index)
    storey_px = max(_STOREY_M / scene.pixel_size_m, 1.0)
    cot = options.cot_incidence
    windows = _window_gain(scene, rows)[:, mirror]
    power = _range_power(terrain, objects, backscatter, building, windows, cot, storey_px, walls)
    power += np.float32(_NOISE_FLOOR)
    return power[:, mirror]


def _window_gain(scene: Scene, rows: slice) -> FloatImage:
    """How much stronger than on average windows glitter in each row; −1 for plain walls."""
    window_m = scene.parcels.window_m[scene.parcel[rows]]
    pitch_px = np.maximum(window_m / np.float32(scene.pixel_size_m), 1)
    hit = np.arange(rows.start, rows.stop)[:, None] % pitch_px < 1
    return np.where(window_m > 0, np.where(hit, pitch_px, 0), np.float32(-1))


def _backscatter(
    scene: Scene, rows: slice, patches: SmoothNoise, generator: np.random.Generator
) -> FloatImage:
    """Backscatter coefficient (linear) of level ground, canopies and roofs."""
    label = scene.parcel[rows]
    cover = scene.parcels.cover[label]
    level_db = scene.parcels.backscatter_db[label]
    level_db += _PATCH_DB * patches.rows(rows.start, rows.stop)
    level_db += _TEXTURE_DB[cover] * generator.standard_normal(label.shape, dtype=np.float32)
    bright = generator.random(label.shape, dtype=np.float32) < _BRIGHT_POINT_SHARE
    bright &= np.isin(cover, _BRIGHT_POINTS_ON)
    level_db[bright] += _BRIGHT_POINT_DB
    return np.exp(level_db * np.float32(math.log(10) / 10))


@dataclass(frozen=True)
class _RangeLine:
    """Bins of ground-projected slant range: a point at x with height z falls on x − z·cot."""

    rows: int
    origin: float
    bins: int

    def splat(
        self, row: npt.NDArray[np.intp], position: npt.NDArray, weight: npt.NDArray
    ) -> npt.NDArray[np.float64]:
        """Add up weights at positions, shared between the two nearest bins."""
        offset = position - self.origin
        lower = np.floor(offset)
        share = offset - lower
        index = row * self.bins + lower.astype(np.intp)
        count = self.rows * self.bins
        total = np.zeros(count)
        total += np.bincount(index, weight * (1 - share), count)
        total += np.bincount(index + 1, weight * share, count)
        return total.reshape(self.rows, self.bins)


def _range_power(
    terrain: FloatImage,
    objects: FloatImage,
    backscatter: FloatImage,
    building: npt.NDArray[np.bool_],
    windows: FloatImage,
    cot: float,
    storey_px: float,
    generator: np.random.Generator,
) -> FloatImage:
    """Accumulate power over slant range for a look along +columns and geocode it.

    All heights are in pixels.
    """
    top = terrain + objects
    lowest, highest = float(terrain.min()), float(top.max())
    rows, columns = terrain.shape
    reach = (highest - lowest) * cot
    line = _RangeLine(rows, math.floor(-highest * cot) - 2, int(columns + reach) + 8)
    slope = np.gradient(terrain, axis=1)
    skyline = _skyline(top + slope / 2, cot)
    power = _surface_power(line, top, slope, backscatter, skyline, cot)
    power += _wall_power(
        line, terrain + slope / 2, objects, building, windows, skyline, cot, storey_px, generator
    )
    position = np.arange(columns, dtype=np.float32) - terrain * np.float32(cot) - line.origin
    lower = position.astype(np.intp)
    share = position - lower
    flat = power.astype(np.float32).ravel()
    lower += np.arange(rows)[:, None] * line.bins
    return np.asarray(flat[lower] * (1 - share) + flat[lower + 1] * share, np.float32)


def _skyline(far_end: FloatImage, cot: float) -> npt.NDArray[np.float64]:
    """Height over the ray through x = 0 of the highest thing up to the far end of each pixel."""
    over_ray = far_end + (np.arange(far_end.shape[1]) + 0.5) * cot
    return np.maximum.accumulate(over_ray, axis=1)


def _surface_power(
    line: _RangeLine,
    top: FloatImage,
    slope: FloatImage,
    backscatter: FloatImage,
    skyline: npt.NDArray[np.float64],
    cot: float,
) -> npt.NDArray[np.float64]:
    """Power of ground, canopies and roofs that the radar sees."""
    row = np.broadcast_to(np.arange(top.shape[0])[:, None], top.shape)
    before = np.concatenate([np.full((len(row), 1), -np.inf), skyline[:, :-1]], axis=1)
    total = np.zeros((line.rows, line.bins))
    for k in range(_SAMPLES_PER_PIXEL):
        offset = (k + 0.5) / _SAMPLES_PER_PIXEL - 0.5
        x = np.arange(top.shape[1]) + offset
        z = top + slope * np.float32(offset)
        seen = np.nonzero(z + x * cot >= before - _LEVEL_PX)
        position = (x - z * cot)[seen]
        weight = backscatter[seen] / _SAMPLES_PER_PIXEL
        total += line.splat(row[seen], position, weight)
    return total


def _wall_power(
    line: _RangeLine,
    ground: FloatImage,
    objects: FloatImage,
    building: npt.NDArray[np.bool_],
    windows: FloatImage,
    skyline: npt.NDArray[np.float64],
    cot: float,
    storey_px: float,
    generator: np.random.Generator,
) -> npt.NDArray[np.float64]:
    """Power of the walls that face the radar and of the corners at their feet."""
    step = np.diff(objects, axis=1)
    row, left = np.nonzero((step > _MIN_WALL_PX) & building[:, 1:])
    x = left + 0.5
    foot = ground[row, left] + objects[row, left]
    head = ground[row, left] + objects[row, left + 1]
    visible_foot = np.maximum(foot, skyline[row, left] - x * cot)
    visible = np.maximum(head - visible_foot, 0)
    facing = _facing(objects, row, left)
    # One box of even power over range for each storey, windows and balconies differ.
    storeys = np.ceil(visible / storey_px).astype(np.intp)
    wall = np.repeat(np.arange(len(row)), storeys)
    storey = np.arange(len(wall)) - np.repeat(np.cumsum(storeys) - storeys, storeys)
    height = visible[wall] / storeys[wall]
    low = (head - visible)[wall] + storey * height
    drawn = generator.standard_exponential(len(wall))
    gain = windows[row, left + 1][wall]
    plain = np.where(gain < 0, 1, 1 - _GLITTER_SHARE)
    strength = drawn * facing[wall] ** 2 * _WALL_BACKSCATTER * plain
    # The running sum of a box's start and end, which lie half a pixel further because a bin
    # reaches half a pixel to both sides of its position.
    edges = x[wall] + 0.5 - np.stack([low + height, low]) * cot
    ends = np.stack([strength / cot, -strength / cot])
    total = np.cumsum(line.splat(np.tile(row[wall], 2), edges.ravel(), ends.ravel()), axis=1)
    # The windows of a wall are alike, so that their corners make a regular lattice.
    glitter = (1 + drawn) / 2 * height * np.maximum(gain, 0)
    glitter *= facing[wall] ** 2 * _WALL_BACKSCATTER * _GLITTER_SHARE
    total += line.splat(row[wall], x[wall] - (low + _SILL * height) * cot, glitter)
    grounded = visible_foot <= foot + _LEVEL_PX
    corner = np.exp((facing - 1) / (1 - _CORNER_WIDTH_COS)) * visible * grounded
    strength = generator.standard_exponential(len(row)) * _DOUBLE_BOUNCE_PER_PX
    total += line.splat(row, x - foot * cot, corner * strength)
    return np.maximum(total, 0)


def _facing(
    objects: FloatImage, row: npt.NDArray[np.intp], left: npt.NDArray[np.intp]
) -> npt.NDArray[np.float32]:
    """Cosine between the wall's normal and the look direction, from the smoothed heights."""
    smooth = gaussian_filter(objects, _NORMAL_SIGMA_PX)
    down = np.gradient(smooth, axis=0)[row, left] if objects.shape[0] > 1 else np.zeros(len(row))
    along = smooth[row, left + 1] - smooth[row, left]
    return np.abs(along) / np.maximum(np.hypot(along, down), 1e-6)
