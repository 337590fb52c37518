"""A simulated landscape with terrain, land cover and objects of known height."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ..errors import ParameterError
from .blocks import HIGHEST_M
from .canvas import Changes, Labels
from .city import CITY, CityLayout
from .cover import Cover, ParcelBook, ParcelTable
from .layout import DENSITIES, Layout, highest_object_m
from .noise import SmoothNoise, Stream, random_stream, strips

# Standard deviation of slopes along an axis over that of heights, on a lattice of spacing 1. It
# follows from the mean squares of a cubic B-spline and of its derivative: 151/315 and 2/3.
_SLOPE_OF_SPLINES = math.sqrt((2 / 3) / (151 / 315))

# Slope that one place in a thousand exceeds, in these standard deviations (Rayleigh); and height
# above the lowest places that few places exceed, in standard deviations of the height.
_STEEPEST = math.sqrt(2 * math.log(1000))
_RELIEF_SIGMAS = 4.6

_LEAST_CELL_PX = 4.0

_CROWN_M = 2.2
_COARSEST_FULL_SIZE_M = 2.5

DENSITY_NAMES = (*DENSITIES, CITY)


@dataclass(frozen=True)
class SceneOptions:
    """Properties of the simulated landscape.

    Attributes
    ----------
    size_px : tuple of int
        Width and height of the scene without its margin.
    pixel_size_m : float
        Size of the pixels of the scene and of its SAR image.
    density : str
        "rural" (0–3 % built, 3–8 m high), "suburban" (up to 25 %, 4–12 m), "urban" (about half,
        10–60 m) or "city" (streets, courtyards and towers up to 60 m, cars and railways).
    relief_m : float
        Height range of the terrain in scenes that are larger than their hills.
    seed : int
        Seed of everything random.
    changed : float
        Share of the buildings that only one image shows: half of them are demolished after the
        radar's acquisition, half are new in the camera's image.
    slope_deg : float or None
        Slope that one place in a thousand exceeds, in terrain that is rough at all scales; None:
        gentle terrain.
    """

    size_px: tuple[int, int] = (1000, 1000)
    pixel_size_m: float = 1.0
    density: str = "suburban"
    relief_m: float = 20.0
    seed: int = 0
    changed: float = 0.0
    slope_deg: float | None = None

    def __post_init__(self) -> None:
        """Refuse options that cannot be simulated."""
        if min(self.size_px) < 16:
            raise ParameterError(
                f"the scene must be at least 16 px wide and high, not {self.size_px}"
            )
        if self.density not in DENSITY_NAMES:
            raise ParameterError(
                f"density must be one of {', '.join(DENSITY_NAMES)}, not {self.density!r}"
            )
        if not self.pixel_size_m > 0 or self.relief_m < 0:
            raise ParameterError("pixel_size_m must be positive and relief_m not negative")
        if self.slope_deg is not None and not 1 <= self.slope_deg <= 60:
            raise ParameterError(f"slope_deg must be 1 to 60, not {self.slope_deg}")
        if not 0 <= self.changed <= 1:
            raise ParameterError(f"changed must be 0 to 1, not {self.changed}")

    @property
    def highest_object_m(self) -> float:
        """Greatest possible height of a building or a canopy."""
        return HIGHEST_M if self.density == CITY else highest_object_m(self.density)


@dataclass(frozen=True)
class Scene:
    """Ground truth of a scene, with a margin on all sides.

    Attributes
    ----------
    pixel_size_m : float
        Pixel size.
    margin_px : int
        Rows and columns on each side that are not part of the reference image.
    seed : int
        Seed of the textures in the images.
    terrain_m : float32 array (rows, columns)
        Height of the bare ground.
    object_m : float32 array (rows, columns)
        Height of roof or canopy above the ground, 0 where there is neither.
    parcel : int32 array (rows, columns)
        Number of the parcel in `parcels`.
    parcels : ParcelTable
        Class and radiometry of the parcels.
    """

    pixel_size_m: float
    margin_px: int
    seed: int
    terrain_m: npt.NDArray[np.float32]
    object_m: npt.NDArray[np.float32]
    parcel: npt.NDArray[np.int32]
    parcels: ParcelTable

    @property
    def window(self) -> tuple[slice, slice]:
        """Rows and columns of the reference image."""
        rows, columns = self.terrain_m.shape
        m = self.margin_px
        return slice(m, rows - m), slice(m, columns - m)

    @property
    def surface_m(self) -> npt.NDArray[np.float32]:
        """Digital surface model: heights of ground, roofs and canopies, without vehicles."""
        stands = self.cover() != Cover.CAR
        return np.asarray(self.terrain_m + np.where(stands, self.object_m, np.float32(0)))

    def cover(self, rows: slice = slice(None)) -> npt.NDArray[np.uint8]:
        """Return the class (`Cover`) of the pixels of some rows."""
        return self.parcels.cover[self.parcel[rows]]

    def patches(self, stream: Stream, size_m: float) -> SmoothNoise:
        """Return a random field, smooth over some metres, for the variation within parcels."""
        shape = (self.parcel.shape[0], self.parcel.shape[1])
        cell_px = max(size_m / self.pixel_size_m, 3.0)
        return SmoothNoise.draw(shape, cell_px, random_stream(self.seed, stream))


class Scenes(NamedTuple):
    """A scene as it is at the radar's and at the camera's acquisition."""

    radar: Scene
    camera: Scene


def generate_scenes(options: SceneOptions, margin_px: int = 0) -> Scenes:
    """Generate a scene as it is at the radar's and at the camera's acquisition.

    Parameters
    ----------
    options : SceneOptions
        Properties of the landscape.
    margin_px : int
        Margin of the scene beyond the requested size.

    Returns
    -------
    Scenes
        Both are the same object if nothing has changed.
    """
    width, height = (size + 2 * margin_px for size in options.size_px)
    shape = (height, width)
    book = ParcelBook(random_stream(options.seed, Stream.SURFACES))
    labels = _layout(options, shape, book).draw()
    parcels = book.table()
    terrain_m = _terrain(options, shape)

    def scene(parcel: Labels) -> Scene:
        objects_m = _object_heights(options, parcel, parcels)
        seed, pixel_m = options.seed, options.pixel_size_m
        return Scene(pixel_m, margin_px, seed, terrain_m, objects_m, parcel, parcels)

    radar = scene(labels[0])
    return Scenes(radar, radar if labels[1] is labels[0] else scene(labels[1]))


def _layout(options: SceneOptions, shape: tuple[int, int], book: ParcelBook) -> Layout | CityLayout:
    # In coarse images, fields and houses grow with the pixel, or they would be smaller than one.
    enlargement = max(options.pixel_size_m / _COARSEST_FULL_SIZE_M, 1.0)
    scale = enlargement / options.pixel_size_m
    generator = random_stream(options.seed, Stream.LAYOUT)
    changes = Changes(options.changed, random_stream(options.seed, Stream.CHANGES))
    if options.density == CITY:
        traffic = random_stream(options.seed, Stream.TRAFFIC)
        return CityLayout(shape, scale, generator, book, changes, traffic)
    return Layout(shape, scale, generator, book, changes, options.density)


def _terrain(options: SceneOptions, shape: tuple[int, int]) -> npt.NDArray[np.float32]:
    terrain = np.zeros(shape, np.float32)
    if options.relief_m == 0:
        return terrain
    if options.slope_deg is not None:
        # Keep the terrain above the sea: heights below all land are read as voids.
        terrain += options.relief_m
    for octave, (cell_m, sigma_m) in enumerate(_octaves(options)):
        cell_px = max(cell_m / options.pixel_size_m, _LEAST_CELL_PX)
        noise = SmoothNoise.draw(
            shape, cell_px, random_stream(options.seed, Stream.TERRAIN, octave)
        )
        for _, start, stop in strips(shape[0]):
            terrain[start:stop] += noise.rows(start, stop) * sigma_m
    return terrain


def _octaves(options: SceneOptions) -> list[tuple[float, float]]:
    """Return each octave's lattice spacing and standard deviation of heights, in metres.

    Terrain is gentle unless a slope is given. Mountains are equally rough at all scales: every
    octave, down to some pixels, has the same slopes.
    """
    relief_m = options.relief_m
    if options.slope_deg is None:
        # A lattice spacing of six times the relief keeps slopes below some 12 degrees.
        hill_m = max(300.0, 6 * relief_m)
        shares = ((1.0, 0.9), (0.35, 0.2), (0.12, 0.04))
        return [(hill_m * size, share * relief_m / 4) for size, share in shares]
    sigma_m = relief_m / _RELIEF_SIGMAS
    steep = math.tan(math.radians(options.slope_deg)) / _STEEPEST
    least_m = _LEAST_CELL_PX * options.pixel_size_m
    count = 1
    # With more octaves, each has a smaller share of the slopes, and the widest becomes wider.
    while _widest_m(sigma_m, steep, count) / 2 ** (count - 1) > 2 * least_m:
        count += 1
    widest_m = _widest_m(sigma_m, steep, count)
    return [(widest_m / 2**k, sigma_m / 2**k) for k in range(count)]


def _widest_m(sigma_m: float, steep: float, octaves: int) -> float:
    """Return the widest spacing at which the slopes of all octaves have deviation `steep`."""
    return _SLOPE_OF_SPLINES * sigma_m * math.sqrt(octaves) / steep


def _object_heights(
    options: SceneOptions, parcel: npt.NDArray[np.int32], parcels: ParcelTable
) -> npt.NDArray[np.float32]:
    """Return object heights: roofs are flat, canopies consist of crowns."""
    heights = np.empty(parcel.shape, np.float32)
    cell_px = max(_CROWN_M / options.pixel_size_m, 1.0)
    crowns = SmoothNoise.draw(
        (parcel.shape[0], parcel.shape[1]), cell_px, random_stream(options.seed, Stream.CROWNS)
    )
    for _, start, stop in strips(parcel.shape[0]):
        label = parcel[start:stop]
        heights[start:stop] = parcels.height_m[label]
        wood = parcels.cover[label] == Cover.FOREST
        factor = np.clip(0.9 + 0.08 * crowns.rows(start, stop), 0.6, 1.0)
        heights[start:stop][wood] *= factor[wood]
    return heights
