"""A geocoded amplitude image of a side-looking radar.

The radar is far away (parallel rays), flies along the columns and looks along the rows. Power is
accumulated over slant range, which yields foreshortening, layover, double bounce and shadow without
further modelling. The image is then geocoded with the bare terrain, like terrain-corrected
products: ground lies at its place on the map, and roofs are displaced towards the sensor by
height / tan(incidence).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..errors import ParameterError
from ..rasters.reading import FloatImage
from .cover import Cover
from .noise import SmoothNoise, Stream, random_stream, strips
from .range_power import range_power
from .scene import Scene

ORBITS = ("ascending", "descending")

# `benchmarks/run.py --only radar_likeness` measures how closely this resembles real radar images.

# Standard deviation of the fine texture of each class in dB, in the order of Cover.
_TEXTURE_DB = np.array([0.3, 0.6, 0.8, 2.0, 0.3, 2.5, 2.5, 2.0, 2.0, 0.3], np.float32)
_PATCH_DB = 0.7
_PATCH_M = 25.0
_BRIGHT_POINT_SHARE = 0.004
_BRIGHT_POINTS_ON = (Cover.BUILDING, Cover.PAVEMENT, Cover.RAIL)
_BRIGHT_POINT_DB = 15.0
_STOREY_M = 3.0
NOISE_FLOOR = 10 ** (-25 / 10)


@dataclass(frozen=True)
class SarOptions:
    """Viewing geometry and radiometry of the radar image.

    Attributes
    ----------
    incidence_deg : float
        Incidence angle on level ground.
    orbit : str
        "ascending": flies north and looks east (towards +columns); "descending": flies south and
        looks west. The radar is right-looking.
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
        """Refuse options that cannot be simulated."""
        if not 10 <= self.incidence_deg <= 70:
            raise ParameterError(f"incidence_deg must be 10 to 70, not {self.incidence_deg}")
        if self.orbit not in ORBITS:
            raise ParameterError(f"orbit must be ascending or descending, not {self.orbit!r}")
        if not self.looks > 0 or not self.amplitude_at_0_db > 0:
            raise ParameterError("looks and amplitude_at_0_db must be positive")

    @property
    def cot_incidence(self) -> float:
        """Layover on the ground in metres per metre of height."""
        return 1 / math.tan(math.radians(self.incidence_deg))

    @property
    def towards_radar(self) -> int:
        """Sign of the column step towards the radar."""
        return -1 if self.orbit == "ascending" else 1

    @property
    def azimuth_deg(self) -> float:
        """Direction from the ground to the radar, clockwise from the top of the image."""
        return 270.0 if self.orbit == "ascending" else 90.0


def render_sar(scene: Scene, options: SarOptions) -> npt.NDArray[np.uint16]:
    """Return the amplitude image, uint16 (rows, columns), of the scene without its margin."""
    image = np.empty(scene.terrain_m[scene.window].shape, np.uint16)
    for (index, start, stop), power in _strips(scene, options):
        speckle = random_stream(scene.seed, Stream.SPECKLE, index)
        image[start:stop] = quantise_amplitude(add_speckle(power, options.looks, speckle), options)
    return image


def sar_power(scene: Scene, options: SarOptions) -> FloatImage:
    """Return the expected power, float32, of `render_sar` without speckle."""
    return np.concatenate([power for _, power in _strips(scene, options)])


def add_speckle(power: FloatImage, looks: float, generator: np.random.Generator) -> FloatImage:
    """Multiply a power image by fully developed speckle (gamma distributed, mean 1)."""
    if math.isinf(looks):
        return power
    speckle = generator.standard_gamma(looks, power.shape, dtype=np.float32)
    return power * speckle / np.float32(looks)


def quantise_amplitude(power: FloatImage, options: SarOptions) -> npt.NDArray[np.uint16]:
    """Return amplitudes as grey values from 1; 0 is reserved for nodata."""
    amplitude = np.sqrt(power) * np.float32(options.amplitude_at_0_db)
    return np.clip(np.rint(amplitude), 1, 65535).astype(np.uint16)


def _strips(scene: Scene, options: SarOptions) -> Iterator[tuple[tuple[int, int, int], FloatImage]]:
    """Yield strips of the scene without its margin, see `noise.strips`, and their power."""
    rows, columns = scene.window
    patches = scene.patches(Stream.SAR_PATCHES, _PATCH_M)
    for index, start, stop in strips(rows.stop - rows.start):
        part = slice(rows.start + start, rows.start + stop)
        power = _strip_power(scene, part, index, options, patches)
        yield (index, start, stop), power[:, columns]


def _strip_power(
    scene: Scene, rows: slice, index: int, options: SarOptions, patches: SmoothNoise
) -> FloatImage:
    """Return the expected power of some full rows of the scene, geocoded."""
    texture = random_stream(scene.seed, Stream.SAR_TEXTURE, index)
    # Looking towards -columns equals looking towards +columns at the mirrored scene.
    mirror = slice(None, None, -1 if options.orbit == "descending" else 1)
    terrain = scene.terrain_m[rows, mirror] / np.float32(scene.pixel_size_m)
    objects = scene.object_m[rows, mirror] / np.float32(scene.pixel_size_m)
    backscatter = _backscatter(scene, rows, patches, texture)[:, mirror]
    building = scene.cover(rows)[:, mirror] == Cover.BUILDING
    walls = random_stream(scene.seed, Stream.SAR_WALLS, index)
    storey_px = max(_STOREY_M / scene.pixel_size_m, 1.0)
    cot = options.cot_incidence
    windows = _window_gain(scene, rows)[:, mirror]
    power = range_power(terrain, objects, backscatter, building, windows, cot, storey_px, walls)
    power += np.float32(NOISE_FLOOR)
    return power[:, mirror]


def _window_gain(scene: Scene, rows: slice) -> FloatImage:
    """Return the gain of window corners in each row over their mean; −1 for plain walls."""
    window_m = scene.parcels.window_m[scene.parcel[rows]]
    pitch_px = np.maximum(window_m / np.float32(scene.pixel_size_m), 1)
    hit = np.arange(rows.start, rows.stop)[:, None] % pitch_px < 1
    return np.where(window_m > 0, np.where(hit, pitch_px, 0), np.float32(-1))


def _backscatter(
    scene: Scene, rows: slice, patches: SmoothNoise, generator: np.random.Generator
) -> FloatImage:
    """Return the linear backscatter coefficient of level ground, canopies and roofs."""
    label = scene.parcel[rows]
    cover = scene.parcels.cover[label]
    level_db = scene.parcels.backscatter_db[label]
    level_db += _PATCH_DB * patches.rows(rows.start, rows.stop)
    level_db += _TEXTURE_DB[cover] * generator.standard_normal(label.shape, dtype=np.float32)
    bright = generator.random(label.shape, dtype=np.float32) < _BRIGHT_POINT_SHARE
    bright &= np.isin(cover, _BRIGHT_POINTS_ON)
    level_db[bright] += _BRIGHT_POINT_DB
    return np.exp(level_db * np.float32(math.log(10) / 10))
