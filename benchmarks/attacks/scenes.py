"""Scenes for the attacks: windows of real pairs, and simulated ones."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from affine import Affine
from numpy.typing import NDArray

import groundtie
from groundtie.rasters.grid import compose
from groundtie.simulation import files

from ..attempt import on_pixels
from ..cases import (
    REFERENCE_TRANSFORM,
    SAR_OPTICAL,
    SAR_SAR,
    RealCase,
    image_size,
    read_cases,
    read_image,
)
from ..sar_pairs import SarPair
from ..simulations import kept, simulator_version
from .pairs import Image, Pair, Source, pixels, render, to_bytes

LARGE = "-large"
DENSITIES = ("rural", "suburban", "urban", "city")

# Least and largest sides of the windows in pixels, by source and size; and the margin around
# windows for displaced content.
_SIDES_PX, _LARGE_SIDES_PX = (300, 400), (450, 900)
_SIMULATED_SIDES_PX, _SIMULATED_LARGE_SIDES_PX = (320, 480), (700, 1000)
_MARGIN_PX = 26
_LEAST_SIDE_PX = 200

# Scenes of satellites of medium resolution, and their pixel size.
_COARSE = ("so-sentinel", "so-cloudy-sentinel", "oo-cloudy-sentinel", "oo-nanjing", "oi-sardinia")
_COARSE_M = 10.0

# Seeds of further simulated scenes of a kind: far apart, and odd so that their looks differ.
_FURTHER_SEEDS = 1001

# A truth that may be wrong by 3 px cannot reveal an error of 3 px.
_LARGEST_SIGMA_PX = 2.0

# From this number of bands an image is multispectral; its red, green and blue are taken.
_MANY_BANDS = 8
_RGB = (3, 2, 1)


@dataclass(frozen=True)
class Scene:
    """A scene from which pairs are cut.

    Parameters
    ----------
    name, kind, sigma_px
        As of a real case; simulated scenes have an exact truth.
    case
        The real pair; None: simulated.
    """

    name: str
    kind: str
    sigma_px: float = 0.0
    case: RealCase | None = None

    @property
    def is_large(self) -> bool:
        """Whether its windows are large."""
        return self.name.endswith(LARGE)

    @property
    def sides_px(self) -> tuple[int, int]:
        """Least and largest side of a window."""
        if self.case is not None:
            return _LARGE_SIDES_PX if self.is_large else _SIDES_PX
        return _SIMULATED_LARGE_SIDES_PX if self.is_large else _SIMULATED_SIDES_PX

    @property
    def place(self) -> str:
        """The place that is shown."""
        return self.name if self.case is None else self.case.place

    @property
    def density(self) -> str:
        """How densely a simulated scene is built up; empty for real scenes."""
        return self._simulated_name.rstrip("23") if self.case is None else ""

    @property
    def _simulated_name(self) -> str:
        return self.name.removesuffix(LARGE).partition("-")[2]

    def source(self, seed: int, cache: Path) -> Source:
        """Return the whole scene; a simulated one is made unless the folder `cache` has it."""
        if self.case is not None:
            return Source(
                *_real(self.case.reference, self.case.input), self.case.reference_to_input
            )
        last = self._simulated_name[-1]
        further = int(last) if last.isdigit() else 0
        size_px = self.sides_px[1] + 2 * _MARGIN_PX
        return _simulated(self.kind, self.density, size_px, seed + _FURTHER_SEEDS * further, cache)

    def pair(self, seed: int, cache: Path) -> Pair:
        """Return a window with correct georeferencing; the same seed gives the same window."""
        source = self.source(seed, cache)
        rng = np.random.default_rng((zlib.crc32(self.name.encode()), seed))
        most = np.array(source.reference.shape[:0:-1]) - 2 * _MARGIN_PX
        low, high = self.sides_px
        side = np.minimum(most, np.maximum(rng.integers(low, high + 1, 2), _LEAST_SIDE_PX))
        first = _corner(source, side, most, rng)
        window = slice(first[1], first[1] + side[1]), slice(first[0], first[0] + side[0])
        scale = Affine.scale(_COARSE_M if self.name.startswith(_COARSE) else 1.0)
        place = compose(REFERENCE_TRANSFORM, scale)
        empty = np.zeros((1, side[1], side[0]), np.uint8)
        pair = Pair(
            source.reference[:, window[0], window[1]],
            empty,
            pixels((int(side[0]), int(side[1]))),
            self.kind,
            self.sigma_px,
            source,
            (int(first[0]), int(first[1])),
            f"{self.place} {seed if self.case is None else ''}",
            place,
            place,
        )
        return pair.moved(np.zeros(2))


def _corner(
    source: Source, side: NDArray[np.int_], most: NDArray[np.int_], rng: np.random.Generator
) -> NDArray[np.int_]:
    """Return the first pixel of a window, of several drawn ones, whose input is nearly fullest."""
    tries = _MARGIN_PX + rng.integers(0, most - side + 1, (5, 2))
    # Some real scenes hold data only around their centres.
    tries = np.vstack([tries, _MARGIN_PX + (most - side) // 2])
    shares = [
        render(source, pixels((int(side[0]), int(side[1])))[::8, ::8] + first)[1].mean()
        for first in tries
    ]
    best = int(np.argmax(np.array(shares) >= max(shares) - 0.02))
    return np.asarray(tries[best])


def scenes(data: Path) -> tuple[Scene, ...]:
    """Return real and simulated scenes, including the large ones."""
    real = [
        Scene(case.name, case.kind, case.sigma_px, case)
        for case in read_cases(data)
        if case.sigma_px <= _LARGEST_SIGMA_PX and _has_room(case, _LEAST_SIDE_PX)
    ]
    names = (*DENSITIES, "city2", "city3", "urban2", "suburban2")
    simulated = [Scene(f"sim-{name}", SAR_OPTICAL) for name in names]
    radar = [Scene(f"simss-{density}", SAR_SAR) for density in DENSITIES[:3]]
    usual = (*real, *simulated, *radar)
    large = [
        replace(scene, name=f"{scene.name}{LARGE}")
        for scene in usual
        if scene.case is None or _has_room(scene.case, _LARGE_SIDES_PX[0])
    ]
    return (*usual, *large)


def _has_room(case: RealCase, side_px: int) -> bool:
    """Whether windows with a side can be cut from a real pair."""
    return min(image_size(case.reference)) >= side_px + 2 * _MARGIN_PX


def elsewhere(
    pair: Pair, others: Sequence[Scene], rng: np.random.Generator, seed: int, cache: Path
) -> Pair:
    """Return the pair with an input of another place, if possible from a pair of the same kind."""
    other_places = [one for one in others if one.place not in pair.place]
    choice = [one for one in other_places if one.kind == pair.kind] or other_places
    for _ in range(20):
        scene = choice[int(rng.integers(len(choice)))]
        other = scene.source(seed, cache)
        most = np.array(other.reference.shape[:0:-1]) - np.array(pair.size)
        corner = np.maximum(most // 2, 0) + rng.integers(-10, 11, 2)
        image, known = render(other, pixels(pair.size) + corner)
        if known.mean() > 0.8:
            shown = np.full((*image.shape[1:], 2), np.nan)
            return replace(pair, input=image, shown=shown, note=f"input of {scene.name}")
    raise ValueError(f"no other place is as large as {pair.place}")


@lru_cache(maxsize=40)
def _real(reference: Path, input: Path) -> tuple[Image, Image]:
    return to_grey(read_image(reference)), to_grey(read_image(input))


def to_grey(image: NDArray[Any]) -> Image:
    """Return bands as bytes from 1 to 255, as an export for viewing has."""
    if len(image) >= _MANY_BANDS:
        image = image[list(_RGB)]
    image = image[:3]
    if image.dtype == np.uint8:
        return np.maximum(image, 1)
    low, high = (np.nanpercentile(image, share, axis=(1, 2)) for share in (0.5, 99.5))
    if image.min() >= 0:
        # Speckle is multiplicative, so amplitudes keep their ratios.
        low = np.zeros_like(low)
    return to_bytes((image - low[:, None, None]) / (high - low)[:, None, None] * 254 + 1)


@lru_cache(maxsize=40)
def _simulated(kind: str, density: str, size_px: int, seed: int, cache: Path) -> Source:
    if kind == SAR_SAR:
        looks = 1 + seed % 4
        made = SarPair(size_px, density, seed, looks, bool(seed % 2)).pair(cache)
        found = made.reference.with_name("truth.json")
        reference, image = (to_grey(read_image(path)) for path in (made.reference, made.input))
        return Source(reference, image, on_pixels(groundtie.load_transform(found), made.reference))
    make = partial(
        groundtie.simulate,
        size=size_px,
        density=density,
        seed=seed,
        shift=0.0,
        looks=float(1 + seed % 3),
        changed=10.0 * (seed % 2),
        warp=2.0,
    )
    folder = kept(cache / f"attacked-{density}-{size_px}-{seed}-{simulator_version()}", make)
    reference, image = (folder / files.NAMES[key] for key in ("reference", "input"))
    truth = groundtie.load_transform(folder / files.NAMES["truth"])
    return Source(
        to_grey(read_image(reference)), to_grey(read_image(image)), on_pixels(truth, reference)
    )
