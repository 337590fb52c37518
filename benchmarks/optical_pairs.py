"""Simulated pairs of optical images: one place in two illuminations and from two directions."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from groundtie.geometry.transform import Transform
from groundtie.rasters.atomic import write_json
from groundtie.simulation.files import NAMES
from groundtie.simulation.misregistration import (
    DistortionOptions,
    Positions,
    draw_misregistration,
    needed_margin,
    resample,
)
from groundtie.simulation.optical import OpticalOptions, blur, quantise, render_radiance
from groundtie.simulation.pair import map_grid
from groundtie.simulation.scene import SceneOptions, generate_scenes

from .attempt import Pair
from .cases import write_image
from .sar_pairs import CHANGED_BUILDINGS
from .simulations import fingerprint, kept, read_exact, simulator_version

# Morning and afternoon, from the west and from the east.
_EARLIER = OpticalOptions(sun_azimuth_deg=140.0, bands=("green",))
_LATER = OpticalOptions(210.0, 35.0, view_azimuth_deg=100.0, off_nadir_deg=8.0, bands=("red",))

# Seed offset of the second image's textures and noise.
_OTHER_DATE = 100_000


@dataclass(frozen=True)
class OpticalPair:
    """The parameters of a simulated pair of optical images.

    Parameters
    ----------
    size, density, seed
        See `groundtie.simulate`; pixels are of 1 m.
    """

    size: int
    density: str
    seed: int

    @property
    def name(self) -> str:
        """Name for display."""
        return f"optical {self.density} {self.size}², seed {self.seed}"

    def pair(self, cache: Path) -> Pair:
        """Return the pair; it is made unless the folder `cache` has it."""
        words = f"{self.size}-{self.density}-{self.seed}"
        folder = cache / f"optical-{words}-{simulator_version()}-{fingerprint([Path(__file__)])}"
        return read_exact(kept(folder, self._write))

    def _write(self, folder: Path) -> None:
        folder.mkdir()
        options = SceneOptions(
            (self.size, self.size),
            density=self.density,
            seed=self.seed,
            changed=CHANGED_BUILDINGS,
        )
        grid = map_grid(options)
        model = draw_misregistration(DistortionOptions(), grid, self.seed)
        truth = Transform(model, grid.crs, grid)
        reach = max(one.lean + one.shadow for one in (_EARLIER, _LATER))
        around = needed_margin(model, grid, grid) + math.ceil(reach * options.highest_object_m)
        earlier, later = generate_scenes(options, around)
        later = replace(later, seed=self.seed + _OTHER_DATE)
        noise = np.random.default_rng((self.seed, 1)), np.random.default_rng((self.seed, 2))
        light = render_radiance(earlier, _EARLIER)[0]
        blur(light, _EARLIER.psf_sigma_px)
        inner = slice(around, around + self.size)
        image = quantise(light[inner, inner], _EARLIER, noise[0])
        write_image(image[None], grid.transform, folder / NAMES["reference"])
        light = render_radiance(later, _LATER)[0]
        blur(light, _LATER.psf_sigma_px)
        seen = resample(light, Positions.interpolated(truth, grid.widened(around)))
        write_image(quantise(seen, _LATER, noise[1])[None], grid.transform, folder / NAMES["input"])
        write_json(folder / NAMES["truth"], truth.to_json())
