"""Refined RPCs: real RPCs with known biases, and half-real images matched with real SAR images."""

from __future__ import annotations

import csv
import tempfile
import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import rasterio
from rasterio.crs import CRS
from rasterio.errors import NotGeoreferencedWarning

import groundtie
from groundtie.rasters.grid import LON_LAT, mesh, reproject
from groundtie.sensor.bias import Bias, fold
from groundtie.sensor.rpc import RPC
from groundtie.sensor.rpc_files import read_rpc
from groundtie.sensor.rpc_tags import rpc_to_tags

from .accuracy import CORRECT, CORRECT_PX, REFUSED, FloatArray, classify
from .attempt import Outcome, count, tried
from .half_real import (
    BIASES,
    PLACES,
    SENSORS,
    bias_of,
    make_scene,
    place_case,
    sensor_of,
    sensor_rpc,
)
from .suites import Case, Goal, Settings, SuiteResult, by_group, run_cases
from .tables import accuracy_table

HALF_REAL, ROUND_TRIP, BLUNDERS = "half real", "round trip", "blunders"
RURAL, URBAN = "simulated, hills", "simulated, town"
# The variant that masks the brightest part of the reference, as in [Suri2010] 4.5.
HALF_REAL_MASKED = "half real, thresholds"
DENSITY = {RURAL: "rural", URBAN: "urban"}
GOAL_PX = {RURAL: 1.0, URBAN: 2.0}

# Largest error of simulated RPCs on the ground.
_LARGEST_SHIFT_M = 300.0
_NEAR_PX = 2.0

# Control points of the round trip: their number and accuracy; share and size of blunders.
_POINTS = 100
_NOISE_PX = 0.3
_BLUNDERS = 0.3
_BLUNDER_PX = 100.0
RECOVERED_PX = 0.1
CHANGED_PX = 0.2
_SIZE = (6000, 5000)


@dataclass(frozen=True)
class HalfRealCase:
    """A half-real image whose biased RPCs are refined by the real SAR image."""

    data: Path
    place: str
    number: int
    group: str = HALF_REAL

    @property
    def name(self) -> str:
        """Place, sensor and number of the bias."""
        return f"{self.place}, {sensor_of(self.place, self.number)}, bias {self.number}"

    def run(self, workers: int | None) -> Outcome:
        """Make the scene, refine its RPCs, and judge them by the true ones."""
        with tempfile.TemporaryDirectory() as folder:
            scene = make_scene(
                place_case(self.data, self.place),
                sensor_rpc(self.data, sensor_of(self.place, self.number)),
                self.number,
                Path(folder),
            )
            output, table = Path(folder) / "refined_RPC.TXT", Path(folder) / "points.csv"
            mask = None
            if self.group == HALF_REAL_MASKED:
                mask = Path(folder) / "mask.tif"
                groundtie.mask_threshold(scene.reference, mask)
            refine = partial(
                groundtie.refine_rpc,
                scene.image,
                output,
                reference=scene.reference,
                dem=scene.dem,
                dem_datum="ellipsoidal",
                reference_mask=mask,
                residuals=table,
                workers=workers,
            )
            one = tried(refine)
            if one.result is None:
                return one.unregistered(self.name, self.group, scene.sigma_px)
            error = scene.error_px(read_rpc(output))
            kept = misses(scene.truth, table, crs_of(scene.reference))
        verdict = classify(True, error, scene.sigma_px)
        return Outcome(
            self.name,
            self.group,
            verdict,
            verdict,
            error,
            error,
            scene.sigma_px,
            one.seconds,
            one.result.verdict.check_rmse_px,
            one.result.adjustment.bias.kind,
            near_the_truth(kept),
        )


@dataclass(frozen=True)
class SimulatedCase:
    """A simulated push-broom image whose RPCs are refined by the simulated SAR image."""

    group: str
    seed: int

    @property
    def name(self) -> str:
        """Kind and seed."""
        return f"{self.group}, seed {self.seed}"

    def run(self, workers: int | None) -> Outcome:
        """Make the scene, refine its RPCs, and judge them at the check points."""
        with tempfile.TemporaryDirectory() as folder:
            scene = Path(folder)
            random = np.random.default_rng(self.seed)
            groundtie.simulate_sensor(
                scene,
                density=DENSITY[self.group],
                shift=random.uniform(5, _LARGEST_SHIFT_M),
                drift=random.uniform(0, 4),
                seed=self.seed,
            )
            refine = partial(
                groundtie.refine_rpc,
                scene / "sensor.tif",
                scene / "refined_RPC.TXT",
                reference=scene / "reference.tif",
                dem=scene / "dem.tif",
                dem_datum="ellipsoidal",
                search_radius=1.1 * _LARGEST_SHIFT_M,
                residuals=scene / "points.csv",
                workers=workers,
            )
            one = tried(refine)
            if one.result is None:
                return one.unregistered(self.name, self.group, 0.0)
            crs = crs_of(scene / "reference.tif")
            error = rms(
                misses(read_rpc(scene / "refined_RPC.TXT"), scene / "check_points.csv", crs)
            )
            kept = misses(read_rpc(scene / "exact_rpc.txt"), scene / "points.csv", crs)
        return Outcome(
            self.name,
            self.group,
            classify(True, error, GOAL_PX[self.group] - CORRECT_PX),
            classify(True, error, GOAL_PX[self.group] - CORRECT_PX),
            error,
            error,
            0.0,
            one.seconds,
            one.result.verdict.check_rmse_px,
            one.result.adjustment.bias.kind,
            near_the_truth(kept),
        )


def near_the_truth(misses_px: FloatArray) -> str:
    """Return in words the number of points near the truth."""
    near = float((np.hypot(*misses_px.T) < _NEAR_PX).mean())
    return f"{near:.0%} of the kept points within {_NEAR_PX:g} px of the truth"


def crs_of(path: Path) -> CRS:
    """Return the CRS of a raster."""
    with rasterio.open(path) as dataset:
        return dataset.crs


def misses(rpc: RPC, table: Path, crs: CRS) -> FloatArray:
    """Return measured minus projected positions of a table's points, (n, 2)."""
    x, y, height = _columns(table, "reference_x", "reference_y", "height_m").T
    lon_lat = reproject(np.column_stack([x, y]), crs, LON_LAT)
    return image_positions(table) - rpc.project(lon_lat, height)


def image_positions(table: Path) -> FloatArray:
    """Return the image positions (col, row) of a table's points, (n, 2)."""
    return _columns(table, "input_col", "input_row")


def _columns(table: Path, *names: str) -> FloatArray:
    """Return columns of a table of points; after a fit, only of the points that it kept."""
    with table.open(newline="") as file:
        kept = {"state": "used", "role": "fit"}
        rows = [
            row
            for row in csv.DictReader(file)
            if all(row.get(name, value) == value for name, value in kept.items())
        ]
    return np.array([[float(row[name]) for name in names] for row in rows])


def rms(off_px: FloatArray) -> float:
    """Return the root mean square length of differences, shape (n, 2)."""
    return float(np.sqrt((off_px**2).sum(axis=1).mean()))


@dataclass(frozen=True)
class RoundTripCase:
    """Real RPCs, a known bias, and measured control points, some of which may be blunders."""

    data: Path
    sensor: str
    number: int
    wrong: bool

    @property
    def group(self) -> str:
        """Group that the case is counted in."""
        return BLUNDERS if self.wrong else ROUND_TRIP

    def run(self, workers: int | None) -> Outcome:
        """Refine, with and without blunders, and compare with the truth or between the two."""
        truth = sensor_rpc(self.data, self.sensor)
        truth = truth.shifted(np.array(_SIZE) / 2 - truth.image_offset)
        bias = bias_of(self.number, _SIZE)
        started = time.perf_counter()
        with tempfile.TemporaryDirectory() as folder:
            clean, result = self._refined(truth, bias, Path(folder), 0.0)
            seconds = time.perf_counter() - started
            if self.wrong:
                found, result = self._refined(truth, bias, Path(folder), _BLUNDERS)
                error = _distance_px(found, clean, truth)
            else:
                error = _distance_px(clean, truth, truth)
        limit = CHANGED_PX if self.wrong else RECOVERED_PX
        verdict = CORRECT if error <= limit else "inaccurate"
        reason = result.verdict.reason
        return Outcome(
            f"{self.sensor}, bias {self.number}",
            self.group,
            verdict,
            verdict,
            error,
            error,
            limit,
            seconds,
            result.verdict.check_rmse_px,
            result.adjustment.bias.kind,
            reason,
        )

    def _refined(
        self, truth: RPC, bias: Bias, folder: Path, wrong: float
    ) -> tuple[RPC, groundtie.tools.refine_rpc.RefinedRpc]:
        random = np.random.default_rng(self.number)
        px = random.uniform(0, 1, (_POINTS, 2)) * _SIZE
        height = truth.offset[2] + random.uniform(-0.2, 0.2, _POINTS) * truth.scale[2]
        lon_lat = truth.localise(px, height)
        measured = px + random.normal(0, _NOISE_PX, px.shape)
        moved = random.permutation(_POINTS)[: int(wrong * _POINTS)]
        measured[moved] += random.uniform(-_BLUNDER_PX, _BLUNDER_PX, (len(moved), 2))
        table = folder / "points.csv"
        with table.open("w", newline="") as file:
            writer = csv.writer(file)
            names = "reference_x", "reference_y", "input_col", "input_row", "height_m"
            writer.writerow([*names, "reference_crs", "sigma_x_px", "sigma_y_px"])
            for row in np.column_stack([lon_lat, measured, height]).tolist():
                writer.writerow([*row, "EPSG:4326", _NOISE_PX, _NOISE_PX])
        image = folder / "image.tif"
        _write_empty(image, fold(truth, bias).rpc)
        output = folder / "refined.RPB"
        result = groundtie.refine_rpc(image, output, gcps=table, height=truth.offset[2])
        return read_rpc(output), result


def _distance_px(found: RPC, expected: RPC, truth: RPC) -> float:
    """Return the RMSE between two models of one image, pixels."""
    nodes = mesh(*(np.linspace(0, side, 15) for side in _SIZE))
    ground = truth.localise(nodes, truth.offset[2])
    apart = found.project(ground, truth.offset[2]) - expected.project(ground, truth.offset[2])
    return float(np.sqrt((apart**2).sum(axis=1).mean()))


def _write_empty(path: Path, rpc: RPC) -> None:
    profile = {"driver": "GTiff", "count": 1, "dtype": "uint8", "sparse_ok": True, "tiled": True}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        with rasterio.open(path, "w", width=_SIZE[0], height=_SIZE[1], **profile) as dataset:
            dataset.rpcs = rasterio.rpc.RPC.from_gdal(rpc_to_tags(rpc))


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    cases: list[Case] = [
        HalfRealCase(settings.data, place, number, group)
        for group in (HALF_REAL, HALF_REAL_MASKED)
        for place in PLACES
        for number in range(1 if settings.quick else BIASES)
    ]
    cases += [
        RoundTripCase(settings.data, sensor, number, wrong)
        for wrong in (False, True)
        for sensor in SENSORS
        for number in range(1 if settings.quick else BIASES)
    ]
    cases += [SimulatedCase(group, seed) for group in DENSITY for seed in settings.seed_numbers()]
    outcomes = run_cases(cases, settings.jobs)
    kinds = (HALF_REAL, HALF_REAL_MASKED, ROUND_TRIP, BLUNDERS, *DENSITY)
    groups = by_group(outcomes, kinds)
    return SuiteResult(
        "RPCs",
        (
            *goals(groups[HALF_REAL], groups[ROUND_TRIP], groups[BLUNDERS]),
            *(simulated_goal(group, groups[group]) for group in DENSITY),
        ),
        (accuracy_table("By kind", groups),),
        [outcome.record() for outcome in outcomes],
        (
            "Half real: the optical image of a real pair, seen by real RPCs over made-up hills; "
            "shifts to 50 px, every second with a drift to 4 px. The error is the RMSE of the "
            "refined RPCs all over the image, against the true ones.",
            "Simulated: shifts of 5 to 300 m, drift to 4 px; the error is the RMSE at the scene's "
            "own check points on the ground, which no tool has seen.",
            f"Round trip: real RPCs, {_POINTS} control points with {_NOISE_PX:g} px of noise. "
            f"Blunders: {_BLUNDERS:.0%} of the points moved by up to {_BLUNDER_PX:g} px; the error "
            "is what that changes.",
        ),
    )


def goals(
    half_real: Sequence[Outcome], round_trip: Sequence[Outcome], blunders: Sequence[Outcome]
) -> tuple[Goal, ...]:
    """Return the goals, with their results."""
    right, refused = count(half_real, CORRECT), count(half_real, REFUSED)
    return (
        Goal(
            "half real: within sigma + 1 px, or refused",
            "all",
            f"{right + refused} of {len(half_real)} ({right} right, {refused} refused), largest "
            f"{_largest(half_real):.2f} px",
            right + refused == len(half_real),
        ),
        Goal(
            "round trip: biases recovered",
            f"to {RECOVERED_PX:g} px",
            f"{_largest(round_trip):.3f} px",
            _largest(round_trip) <= RECOVERED_PX,
        ),
        Goal(
            f"{_BLUNDERS:.0%} blunders change the refined RPCs",
            f"by {CHANGED_PX:g} px",
            f"{_largest(blunders):.3f} px",
            _largest(blunders) <= CHANGED_PX,
        ),
    )


def simulated_goal(group: str, outcomes: Sequence[Outcome]) -> Goal:
    """Return the goal of simulated scenes of one kind, with its result."""
    right, refused = count(outcomes, CORRECT), count(outcomes, REFUSED)
    return Goal(
        f"{group}: error at check points",
        f"at most {GOAL_PX[group]:g} px, or refused",
        f"{right + refused} of {len(outcomes)} ({right} right, {refused} refused), largest "
        f"{_largest(outcomes):.2f} px",
        right + refused == len(outcomes),
    )


def _largest(outcomes: Sequence[Outcome]) -> float:
    return max((o.error_px for o in outcomes if np.isfinite(o.error_px)), default=float("nan"))
