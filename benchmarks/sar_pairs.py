"""Simulated pairs of radar images: one place from two viewing directions at two times."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import rasterio.crs
from affine import Affine
from numpy.typing import NDArray

from groundtie.geometry.transform import Transform
from groundtie.rasters.atomic import write_json
from groundtie.rasters.grid import Grid
from groundtie.simulation.files import NAMES
from groundtie.simulation.misregistration import (
    DistortionOptions,
    Positions,
    draw_misregistration,
    needed_margin,
    resample,
)
from groundtie.simulation.sar import (
    NOISE_FLOOR,
    SarOptions,
    add_speckle,
    quantise_amplitude,
    sar_power,
)
from groundtie.simulation.scene import Scene, SceneOptions, generate_scenes

from .attempt import Pair
from .cases import CRS, write_image
from .simulations import fingerprint, kept, read_exact, simulator_version

# Differences of the second image: incidence angles; the share of buildings that stand in only one
# image; the share of parcels (fields, woods) with other backscatter, and its largest change.
INCIDENCES_DEG = (30.0, 40.0)
CHANGED_BUILDINGS = 0.1
_CHANGED_PARCELS, _CHANGE_DB = 0.3, 4.0

# Seed offset of the second image's textures and speckle.
_LATER = 100_000

_GROUND = "ground.tif"

# The input may be displaced by this, so ground this near to layover or shadow is excluded, too.
_BESIDE_PX = 8


@dataclass(frozen=True)
class SarPair:
    """The parameters of a simulated pair of radar images.

    Parameters
    ----------
    size, density, seed
        See `groundtie.simulate`; pixels are of 1 m.
    looks
        Looks of both images.
    opposite
        Whether the images look from opposite sides, from an ascending and a descending orbit.
    relief_m
        Height of the hills; both images are terrain-corrected.
    """

    size: int
    density: str
    seed: int
    looks: int
    opposite: bool
    relief_m: float = 20.0

    @property
    def name(self) -> str:
        """Name for display."""
        sides = "opposite orbits" if self.opposite else "same orbit"
        return f"{self.density} {self.size}², {self.looks} looks, {sides}, seed {self.seed}"

    def pair(self, cache: Path) -> Pair:
        """Return the pair; it is made unless the folder `cache` has it."""
        words = "-".join(f"{value}" for value in asdict(self).values())
        folder = cache / f"sar-{words}-{simulator_version()}-{fingerprint([Path(__file__)])}"
        return read_exact(kept(folder, self._write))

    def ground(self, cache: Path) -> Path:
        """Return the mask of the level ground on the reference; the pair must exist."""
        return self.pair(cache).reference.with_name(_GROUND)

    def _write(self, folder: Path) -> None:
        folder.mkdir()
        grid = Grid(
            Affine(1, 0, 412_000, 0, -1, 5_334_000),
            rasterio.crs.CRS.from_string(CRS),
            self.size,
            self.size,
        )
        distortion = DistortionOptions("affine", shift_px=12.0, warp_px=4.0)
        model = draw_misregistration(distortion, grid, self.seed)
        truth = Transform(model, grid.crs, grid)
        # The rendered scene includes what the second image shows beyond the first.
        around = needed_margin(model, grid, grid)
        options = SceneOptions(
            (self.size + 2 * around,) * 2,
            density=self.density,
            relief_m=self.relief_m,
            seed=self.seed,
            changed=CHANGED_BUILDINGS,
        )
        earlier, later = generate_scenes(options, _reach_px(options))
        looks = float(self.looks)
        first = SarOptions(INCIDENCES_DEG[0], "ascending", looks)
        second = SarOptions(
            INCIDENCES_DEG[1], "descending" if self.opposite else "ascending", looks
        )
        inner = slice(around, around + self.size)
        speckle = np.random.default_rng((self.seed, 1)), np.random.default_rng((self.seed, 2))
        power = add_speckle(sar_power(earlier, first)[inner, inner], looks, speckle[0])
        image = quantise_amplitude(power, first)
        write_image(image[None], grid.transform, folder / NAMES["reference"])
        wide = grid.window(-around, -around, *options.size_px)
        positions = Positions.interpolated(truth, wide)
        seen = resample(sar_power(_changed(later), second), positions)
        # Bright points ring under resampling, so values are clipped at the noise floor.
        power = add_speckle(np.maximum(seen, np.float32(NOISE_FLOOR)), looks, speckle[1])
        write_image(
            quantise_amplitude(power, second)[None], grid.transform, folder / NAMES["input"]
        )
        hidden = _hidden(earlier, first) | _hidden(later, second)
        beside = np.ones((2 * _BESIDE_PX + 1,) * 2, np.uint8)
        ground = 1 - cv2.dilate(hidden.astype(np.uint8), beside)[earlier.window][inner, inner]
        write_image(ground[None], grid.transform, folder / _GROUND)
        write_json(folder / NAMES["truth"], truth.to_json())


def _hidden(scene: Scene, sar: SarOptions) -> NDArray[np.bool_]:
    """Return the ground hidden in an image: under layover, in radar shadow or built upon."""
    tangent = math.tan(math.radians(sar.incidence_deg))
    height_px = scene.object_m / scene.pixel_size_m
    towards = sar.towards_radar
    hidden = height_px > 0
    for direction, reach in ((towards, 1 / tangent), (-towards, tangent)):
        for steps in range(1, math.ceil(float(height_px.max()) * reach) + 1):
            tall = np.roll(height_px * reach >= steps, direction * steps, axis=1)
            hidden |= tall
    return hidden


def _changed(scene: Scene) -> Scene:
    """Return a scene at a later date: other textures, some parcels brighter or darker."""
    random = np.random.default_rng((scene.seed, 3))
    level = scene.parcels.backscatter_db
    change = random.uniform(-_CHANGE_DB, _CHANGE_DB, level.shape)
    change[random.random(level.shape) > _CHANGED_PARCELS] = 0
    parcels = replace(scene.parcels, backscatter_db=(level + change).astype(level.dtype))
    return replace(scene, seed=scene.seed + _LATER, parcels=parcels)


def _reach_px(options: SceneOptions) -> int:
    """Return how far from its foot a building or hill can appear in a radar image."""
    tangent = math.tan(math.radians(min(INCIDENCES_DEG)))
    height = options.highest_object_m + options.relief_m
    return math.ceil(height / tangent + options.highest_object_m * tangent) + 1
