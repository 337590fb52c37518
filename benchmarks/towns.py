"""Dense cities with a surface model: of the ground visible in both images, or as the reference."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import rasterio
from affine import Affine
from rasterio.enums import Resampling

from groundtie.geometry.views import View
from groundtie.masks.object_heights import LOWEST_M, bare_ground
from groundtie.rasters.grid import compose
from groundtie.rasters.reading import FloatImage, open_raster
from groundtie.simulation import files

from .accuracy import REFUSED, Truth
from .attempt import Outcome, Pair, accepted, attempt, count, median_px
from .cases import write_image
from .city import WITHIN_PX, city, share_within
from .simulations import Simulation
from .suites import Case, Goal, Settings, SuiteResult, Table, by_group, none_wrong, run_cases
from .tables import accuracy_table

NONE, MODEL, ROUGH, OTHER, ROTATED, OPPOSITE = (
    "no surface model",
    "surface model",
    "rough surface model",
    "surface model of another city",
    "the radar's view rotated by 90°",
    "both views from the other side",
)
SETTINGS = (NONE, MODEL, ROUGH, OTHER, ROTATED, OPPOSITE)
# A radar image registered to a rough model in which a tenth of the objects are missing.
TO_MODEL, STEEPER, TO_OTHER, TO_ROTATED, TO_OPPOSITE = (
    "to the rough model",
    "to it, incidence stated 5° too large",
    "to the rough model of another city",
    "to it, azimuth rotated by 90°",
    "to it, from the other side",
)
REFERENCES = {TO_MODEL: (0.0, 0.0), STEEPER: (0.0, 5.0), TO_OTHER: (0.0, 0.0)} | {
    TO_ROTATED: (90.0, 0.0),
    TO_OPPOSITE: (180.0, 0.0),
}
_REFUSED = (OTHER, TO_OTHER, TO_ROTATED, TO_OPPOSITE)
# Errors of the stated azimuths of the radar, and of the camera and its sun, in degrees.
_ROTATIONS_DEG = {ROTATED: (90.0, 0.0), OPPOSITE: (180.0, 180.0)}
WANTED_SHARE = 0.9
LARGEST_PX = 3.0

# Pixel size, noise and displacement (east, north) of a model from satellite stereo images. A
# model that is the reference is not displaced, but lacks a share of the objects.
_ROUGH_M, _NOISE_M, _MOVED_M = 2.0, 0.5, (3.0, -2.0)
_MISSING_SHARE = 0.1


@dataclass(frozen=True)
class TownCase:
    """A city with one of the surface models of `SETTINGS`."""

    seed: int
    setting: str
    cache: Path

    def run(self, workers: int | None) -> Outcome:
        """Make the pair if needed, register it and judge the result."""
        pair, parameters = city(self.seed).pair(self.cache), {}
        if self.setting != NONE:
            other = city(self.seed + 1) if self.setting == OTHER else city(self.seed)
            model = other.pair(self.cache).reference.parent / files.NAMES["dsm"]
            parameters["surface_model"] = rough(model) if self.setting == ROUGH else model
            if self.setting in _ROTATIONS_DEG:
                parameters |= rotated_views(
                    pair.reference, pair.input, *_ROTATIONS_DEG[self.setting]
                )
        name = f"city, seed {self.seed}"
        return attempt(name, self.setting, pair, workers, **parameters)


@dataclass(frozen=True)
class ReferenceCase:
    """A radar image of a city, registered to a surface model in one of the ways of `REFERENCES`."""

    seed: int
    setting: str
    cache: Path

    def run(self, workers: int | None) -> Outcome:
        """Make the pair if needed, register it and judge the result."""
        pair = seen_by_radar(self.seed).pair(self.cache)
        of = pair if self.setting != TO_OTHER else seen_by_radar(self.seed + 1).pair(self.cache)
        model = rough(of.reference.parent / files.NAMES["dsm"], is_reference=True)
        view = View.of(pair.input, None)
        assert view is not None
        azimuth_deg, incidence_deg = REFERENCES[self.setting]
        stated = replace(view, incidence_deg=view.incidence_deg + incidence_deg)
        views = f"surface {_words(stated, azimuth_deg)}"
        name = f"city, seed {self.seed}"
        return attempt(name, self.setting, to_model(pair, model), workers, views=views)


def seen_by_radar(seed: int) -> Simulation:
    """Return the city of a seed with the radar image as the input."""
    simulation = city(seed)
    return replace(simulation, further=(*simulation.further, ("input", "sar")))


def to_model(pair: Pair, model: Path) -> Pair:
    """Return a pair with a model as the reference, and the truth in the model's pixels."""
    with open_raster(pair.reference) as image, open_raster(model) as heights:
        larger = heights.grid.pixel_size_m / image.grid.pixel_size_m

        def of_model(truth: Truth | None) -> Truth | None:
            if truth is None:
                return None
            px = heights.grid.map_to_pixel(image.grid.pixel_to_map(truth.reference_px))
            return Truth(px, truth.input_px, truth.linear * larger)

        return Pair(model, pair.input, of_model(pair.truth), of_model(pair.lattice))


def rotated_views(
    reference: Path, input: Path, radar_deg: float, camera_deg: float
) -> dict[str, str]:
    """Return the views from the files beside the images, with wrong azimuths."""
    radar = _words(View.of(reference, None), radar_deg)
    return {"views": f"{radar}; {_words(View.of(input, None), camera_deg)}"}


def _words(view: View | None, rotation_deg: float) -> str:
    if view is None:
        raise ValueError("a simulated image has no view beside it")
    words = [view.sensor, f"azimuth={(view.azimuth_deg + rotation_deg) % 360:.1f}"]
    words.append(f"incidence={view.incidence_deg:.1f}")
    if view.sun_azimuth_deg is not None and view.sun_elevation_deg is not None:
        words.append(f"sun-azimuth={(view.sun_azimuth_deg + rotation_deg) % 360:.1f}")
        words.append(f"sun-elevation={view.sun_elevation_deg:.1f}")
    return " ".join(words)


def rough(model: Path, is_reference: bool = False) -> Path:
    """Return a surface model with larger pixels and noise, written beside the fine one.

    It is displaced, or, as a reference, lacks a share of the objects.
    """
    path = model.with_name("rough_reference.tif" if is_reference else "rough.tif")
    if path.exists():
        return path
    with rasterio.open(model) as fine:
        factor = _ROUGH_M / fine.res[0]
        shape = (round(fine.height / factor), round(fine.width / factor))
        heights = fine.read(1, out_shape=shape, resampling=Resampling.average)
        noise = np.random.default_rng(0).standard_normal(shape, np.float32)
        moved = fine.transform
        if is_reference:
            heights = without_some(heights, _ROUGH_M)
        else:
            moved = compose(Affine.translation(*_MOVED_M), moved)
        scale = Affine.scale(fine.width / shape[1], fine.height / shape[0])
        transform, crs = compose(moved, scale), fine.crs
    # Complete or not at all, even if two processes make it.
    made = path.with_name(f"{path.stem}-{np.random.default_rng().integers(2**31)}.tif")
    write_image((heights + np.float32(_NOISE_M) * noise)[None], transform, made, crs)
    made.rename(path)
    return path


def without_some(surface_m: FloatImage, pixel_m: float) -> FloatImage:
    """Return heights without a random share of the objects, as if these were built since."""
    ground = bare_ground(surface_m, np.ones(surface_m.shape, bool), pixel_m)
    stands = (surface_m - ground > LOWEST_M).astype(np.uint8)
    count, labels = cv2.connectedComponents(stands, connectivity=4)
    missing = np.random.default_rng(0).random(count) < _MISSING_SHARE
    missing[0] = False
    return np.where(missing[labels], ground, surface_m)


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    seeds = settings.seed_numbers()
    # Seed by seed, so that no two processes make the same pair at the same time.
    for seed in (*seeds, seeds[-1] + 1):
        city(seed).pair(settings.cache)
        seen_by_radar(seed).pair(settings.cache)
    cases: list[Case] = []
    for seed in seeds:
        cases += [TownCase(seed, setting, settings.cache) for setting in SETTINGS]
        cases += [ReferenceCase(seed, setting, settings.cache) for setting in REFERENCES]
    outcomes = run_cases(cases, settings.jobs)
    groups = by_group(outcomes, (*SETTINGS, *REFERENCES))
    return SuiteResult(
        "Simulated dense cities with a surface model",
        [goal for name, group in groups.items() for goal in goals(name, group)],
        (ground_table(groups), accuracy_table("By surface model", groups)),
        [outcome.record() for outcome in outcomes],
        (
            "The error is that at check points on open ground. A rough model has pixels of "
            f"{_ROUGH_M:g} m, noise of {_NOISE_M:g} m, and lies {_MOVED_M[0]:g} m and "
            f"{_MOVED_M[1]:g} m off; as the reference it lies right, {_MISSING_SHARE:.0%} of the "
            "objects are missing, and errors are in its own pixels.",
        ),
    )


def goals(name: str, outcomes: Sequence[Outcome]) -> tuple[Goal, ...]:
    """Return the goals of one setting, with their results."""
    taken = len(accepted(outcomes))
    found = [none_wrong(f"{name}: silently wrong", outcomes)]
    if name in _REFUSED:
        found.append(Goal(f"{name}: accepted", "none", str(taken), taken == 0))
    if name == MODEL:
        share = share_within(outcomes)
        wanted = f"at least {WANTED_SHARE:.0%}"
        reached = share >= WANTED_SHARE
        found.append(Goal(f"{name}: within {WITHIN_PX:g} px", wanted, f"{share:.0%}", reached))
    return tuple(found)


def ground_table(groups: Mapping[str, Sequence[Outcome]]) -> Table:
    """Return a table of the errors on the ground, one row for each setting."""
    beyond = f"beyond {LARGEST_PX:g} px"
    head = ("surface model", "accepted", "median error (px)", "within 1 px", beyond, "cities")
    rows = [
        [
            name,
            str(len(group) - count(group, REFUSED)),
            f"{median_px(group):.2f}",
            f"{share_within(group):.0%}",
            str(sum(outcome.error_px > LARGEST_PX for outcome in accepted(group))),
            str(len(group)),
        ]
        for name, group in groups.items()
    ]
    return Table("On the ground", head, rows)
