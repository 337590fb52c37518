"""Dense cities in push-broom images: RPCs and ground control must be right or refused."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

import groundtie
from groundtie.sensor.rpc_files import read_rpc

from .accuracy import CORRECT, CRASHED, INACCURATE, REFUSED, SILENTLY_WRONG, FloatArray
from .attempt import Outcome, accepted, count, tried
from .rpc import crs_of, image_positions, misses, rms
from .simulations import kept, simulator_version
from .suites import Goal, Settings, SuiteResult, Table, by_group, run_cases
from .tables import error_cells

SIZES_PX = (700, 1000)
LOOKS = (1.0, 4.0)
DENSITY = "city"
OFF_NADIR_DEG = 20.0
SEEDS = 12
CORRECT_PX, WRONG_PX = 2.0, 3.0


@dataclass(frozen=True)
class Run:
    """A tool, its output file, and the parameters that differ from their defaults.

    Parameters that are paths name a file of the scene.
    """

    tool: str
    output: str
    parameters: Mapping[str, Any] = field(default_factory=dict)

    def on(self, scene: Path) -> dict[str, Any]:
        """Return the parameters for the scene in a folder."""
        given = self.parameters.items()
        return {name: scene / v if isinstance(v, Path) else v for name, v in given}

    def call(self, scene: Path, output: Path, workers: int | None) -> Any:
        """Run the tool on the scene in a folder."""
        return getattr(groundtie, self.tool)(
            image=scene / "sensor.tif",
            reference=scene / "reference.tif",
            output=output,
            dem=scene / "dem.tif",
            dem_datum="ellipsoidal",
            workers=workers,
            **self.on(scene),
        )


_RPC = "refined_RPC.TXT"
REFINED, MODELLED, EXTRACTED = "refine_rpc", "refine_rpc, surface model", "extract_gcps"
RUNS = {
    REFINED: Run("refine_rpc", _RPC),
    MODELLED: Run("refine_rpc", _RPC, {"surface_model": Path("dsm.tif")}),
    EXTRACTED: Run("extract_gcps", "points.csv"),
}


@dataclass(frozen=True)
class City:
    """A dense city of `simulate_sensor`, otherwise with default parameters."""

    size: int
    looks: float
    seed: int

    @property
    def name(self) -> str:
        """Name for display."""
        return f"city {self.size}², {self.looks:g} looks, seed {self.seed}"

    def scene(self, cache: Path) -> Path:
        """Return the folder of the scene; it is made unless the folder `cache` has it."""
        parts = self.size, f"{self.looks:g}", self.seed, simulator_version()

        def make(folder: Path) -> None:
            groundtie.simulate_sensor(
                folder,
                size=self.size,
                density=DENSITY,
                off_nadir=OFF_NADIR_DEG,
                looks=self.looks,
                seed=self.seed,
            )

        return kept(cache / "-".join(map(str, ("sensor-city", *parts))), make)


@dataclass(frozen=True)
class CityCase:
    """A city and one of `RUNS`."""

    city: City
    what: str
    cache: Path

    @property
    def group(self) -> str:
        """Group that the case is counted in."""
        return group_name(self.what, self.city.size, self.city.looks)

    def run(self, workers: int | None) -> Outcome:
        """Make the scene if needed, run the tool, and judge its output by the truth."""
        scene, name = self.city.scene(self.cache), f"{self.what}, {self.city.name}"
        with tempfile.TemporaryDirectory() as folder:
            wanted = RUNS[self.what]
            output = Path(folder) / wanted.output
            one = tried(lambda: wanted.call(scene, output, workers))
            if one.result is None:
                return one.unregistered(name, self.group, 0.0)
            error_px = rms(misses_px(scene, output))
        verdict, summary = judge(error_px), one.result.summary()
        return Outcome(
            name,
            self.group,
            verdict,
            verdict,
            error_px,
            error_px,
            0.0,
            one.seconds,
            summary["verdict"]["check_rmse_px"],
            summary.get("bias", {}).get("model", "points"),
            summary["verdict"]["reason"],
            summary["verdict"]["ce90_px"],
        )


def group_name(what: str, size: int, looks: float) -> str:
    """Return the name of the group a city is counted in."""
    return f"{what}, {size} px, {looks:g} looks"


def misses_px(scene: Path, output: Path) -> FloatArray:
    """Return the misses at a scene's check points on the ground, image pixels, shape (n, 2).

    Parameters
    ----------
    scene
        Folder of `simulate_sensor`.
    output
        Refined RPCs, or ground control points. RPCs are compared with the check points directly. Of
        ground control points, the best-fitting affine change of the image is compared, as that is
        what would enter RPCs; errors that differ from point to point would not.
    """
    crs = crs_of(scene / "reference.tif")
    checks = scene / "check_points.csv"
    if output.suffix != ".csv":
        return misses(read_rpc(output), checks, crs)
    off = misses(read_rpc(scene / "exact_rpc.txt"), output, crs)
    change, *_ = np.linalg.lstsq(_terms(image_positions(output)), off, rcond=None)
    missed: FloatArray = -(_terms(image_positions(checks)) @ change)
    return missed


def _terms(px: FloatArray) -> FloatArray:
    return np.column_stack([np.ones(len(px)), px])


def judge(error_px: float) -> str:
    """Return the verdict on an accepted result by its error."""
    if error_px <= CORRECT_PX:
        return CORRECT
    return INACCURATE if error_px <= WRONG_PX else SILENTLY_WRONG


def cases(settings: Settings) -> list[CityCase]:
    """Return the cases, city by city."""
    numbers = settings.seed_numbers(SEEDS)
    cities = [City(*values) for values in product(SIZES_PX, LOOKS, numbers)]
    cities = cities[:1] if settings.quick else cities
    return [CityCase(city, what, settings.cache) for city in cities for what in RUNS]


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    wanted = cases(settings)
    # Made first, so that no two processes make the same scene at the same time.
    for city in dict.fromkeys(case.city for case in wanted):
        city.scene(settings.cache)
    outcomes = run_cases(wanted, settings.jobs)
    groups, kinds = by_group(outcomes), {what: list[Outcome]() for what in RUNS}
    for case, outcome in zip(wanted, outcomes, strict=True):
        kinds[case.what].append(outcome)
    return SuiteResult(
        "RPCs and ground control in dense cities",
        goals(kinds),
        (verdict_table(groups), verdict_table(kinds, "All cities")),
        [outcome.record() for outcome in outcomes],
        (
            f"Cities of `simulate_sensor`, off-nadir {OFF_NADIR_DEG:g}°, RPCs wrong by 60 m with "
            "2 px of drift; all tools with their defaults but for the surface model where it is "
            "named. The error is the RMSE at the scene's own check points on the ground, which no "
            "tool has seen: of refined RPCs, or of the affine change that ground control implies.",
            f"Correct: at most {CORRECT_PX:g} px; silently wrong: more than {WRONG_PX:g} px.",
        ),
    )


def goals(kinds: Mapping[str, Sequence[Outcome]]) -> tuple[Goal, ...]:
    """Return the goals, with their results."""
    return tuple(
        Goal(
            f"{what}: accepted though more than {WRONG_PX:g} px wrong",
            "none",
            f"{count(outcomes, SILENTLY_WRONG)} of {len(outcomes)}, "
            f"largest error {error_cells(outcomes)[1]} px",
            not count(outcomes, SILENTLY_WRONG),
        )
        for what, outcomes in kinds.items()
    )


def verdict_table(
    groups: Mapping[str, Sequence[Outcome]], title: str = "By size and looks"
) -> Table:
    """Return the outcomes of each group of cities."""
    verdicts = (CORRECT, INACCURATE, SILENTLY_WRONG, REFUSED, CRASHED)
    rows = [
        [
            name,
            str(len(outcomes)),
            *(str(count(outcomes, verdict)) for verdict in verdicts),
            *error_cells(outcomes),
            _below_ce90(accepted(outcomes)),
        ]
        for name, outcomes in groups.items()
    ]
    head = ("", "cities", *verdicts, "median error (px)", "largest (px)", "RMSE below CE90")
    return Table(title, head, rows)


def _below_ce90(outcomes: Sequence[Outcome]) -> str:
    below = sum(outcome.error_px <= outcome.claimed_ce90_px for outcome in outcomes)
    return f"{below} of {len(outcomes)}"
