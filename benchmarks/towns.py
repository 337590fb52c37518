"""Dense cities with a surface model: the ground that both images show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import rasterio
from affine import Affine
from rasterio.enums import Resampling

from groundtie.geometry.views import View
from groundtie.rasters.grid import compose
from groundtie.simulation import files

from .accuracy import REFUSED, SILENTLY_WRONG
from .attempt import Outcome, accepted, attempt, count
from .city import WITHIN_PX, city, median_px, share_within
from .suites import Goal, Settings, SuiteResult, Table, run_cases
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
# By how much the azimuths of the radar, of the camera and of its sun are stated wrong, in degrees.
_ROTATIONS_DEG = {ROTATED: (90.0, 0.0), OPPOSITE: (180.0, 180.0)}
WANTED_SHARE = 0.9
LARGEST_PX = 3.0
_QUICK_SEEDS = 1

# Pixels, noise and displacement (east, north) of a model as stereo images of a satellite give it.
_ROUGH_M, _NOISE_M, _MOVED_M = 2.0, 0.5, (3.0, -2.0)


@dataclass(frozen=True)
class TownCase:
    """A city, with one of the surface models of `SETTINGS`."""

    seed: int
    setting: str
    cache: Path

    def run(self, workers: int | None) -> Outcome:
        """Make the pair if need be, register it and judge the result."""
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


def rotated_views(
    reference: Path, input: Path, radar_deg: float, camera_deg: float
) -> dict[str, str]:
    """Return the views of the images beside their files, with azimuths that are wrong."""
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


def rough(model: Path) -> Path:
    """Return a surface model with larger pixels, noise and a displacement, made beside the fine."""
    path = model.with_name("rough.tif")
    if path.exists():
        return path
    with rasterio.open(model) as fine:
        factor = _ROUGH_M / fine.res[0]
        shape = (round(fine.height / factor), round(fine.width / factor))
        heights = fine.read(1, out_shape=shape, resampling=Resampling.average)
        noise = np.random.default_rng(0).standard_normal(shape, np.float32)
        moved = compose(Affine.translation(*_MOVED_M), fine.transform)
        scale = Affine.scale(fine.width / shape[1], fine.height / shape[0])
        profile = {
            "driver": "GTiff",
            "count": 1,
            "dtype": "float32",
            "height": shape[0],
            "width": shape[1],
            "crs": fine.crs,
            "transform": compose(moved, scale),
        }
    # Whole or not at all, also where two processes make it.
    made = path.with_name(f"{path.stem}-{np.random.default_rng().integers(2**31)}.tif")
    with rasterio.open(made, "w", **profile) as raster:
        raster.write(heights + np.float32(_NOISE_M) * noise, 1)
    made.rename(path)
    return path


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    count_of = _QUICK_SEEDS if settings.quick else settings.seeds
    seeds = range(settings.first_seed, settings.first_seed + count_of)
    # Seed by seed, so that processes do not make the same pair at the same time.
    for seed in (*seeds, seeds[-1] + 1):
        city(seed).pair(settings.cache)
    cases = [TownCase(seed, setting, settings.cache) for seed in seeds for setting in SETTINGS]
    outcomes = run_cases(cases, settings.jobs)
    groups = {s: [o for o in outcomes if o.group == s] for s in SETTINGS}
    return SuiteResult(
        "Simulated dense cities with a surface model",
        [goal for name, group in groups.items() for goal in goals(name, group)],
        (ground_table(groups), accuracy_table("By surface model", groups)),
        [outcome.record() for outcome in outcomes],
        (
            "The error is that at check points on open ground. A rough model has pixels of "
            f"{_ROUGH_M:g} m, noise of {_NOISE_M:g} m, and lies {_MOVED_M[0]:g} m and "
            f"{_MOVED_M[1]:g} m off.",
        ),
    )


def goals(name: str, outcomes: Sequence[Outcome]) -> tuple[Goal, ...]:
    """Return the goals of one setting and what was found."""
    wrong, taken = count(outcomes, SILENTLY_WRONG), len(accepted(outcomes))
    found = [Goal(f"{name}: silently wrong", "none", f"{wrong} of {len(outcomes)}", wrong == 0)]
    if name == OTHER:
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
