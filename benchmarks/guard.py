"""Whether six fixed jobs cost more processor time or memory than the committed state says.

Costs are in units of a yardstick, a loop of numpy and Fourier transforms that is run beside each
job, so that they compare across machines and loads. `python -m benchmarks.guard --update` writes
the state of today to be committed.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

import groundtie

from .processes import OUTPUT, Measured, measure
from .simulations import Simulation
from .suites import Goal, Settings, SuiteResult, Table

STATE = Path(__file__).with_suffix(".json")

# Factor beyond which a cost is reported. Repeated runs of one state differ by less.
TOLERANCE = 1.15

_TIMES = 3
_YARDSTICK = """
import numpy as np, scipy.fft
image = np.random.default_rng(0).normal(size=(512, 512)).astype(np.float32)
for _ in range(40):
    found = scipy.fft.irfft2(scipy.fft.rfft2(image) ** 2)
    np.partition(np.sqrt(np.abs(found)).ravel(), 1000)
    np.searchsorted(found[0], image)
"""
_SENSOR_PX, _SEED = 500, 1
_DATUM = ("--dem-datum", "ellipsoidal")


@dataclass(frozen=True)
class Cost:
    """Processor time of a job, in yardsticks, and peak memory."""

    yardsticks: float
    peak_mb: float


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    found = costs(settings, 1 if settings.quick else _TIMES)
    before = read_state()
    rows = [
        [job, f"{cost.yardsticks:.2f}", f"{cost.peak_mb:.0f}", *_columns(before.get(job))]
        for job, cost in found.items()
    ]
    head = ["job", "yardsticks", "peak, MB", "committed yardsticks", "committed peak, MB"]
    return SuiteResult(
        "Cost of fixed jobs",
        goals(found, before),
        (Table("Processor time in yardsticks, least of all runs", head, rows),),
        [{"job": job, **asdict(cost)} for job, cost in found.items()],
        (f"A yardstick is the processor time of a fixed loop; least of {_TIMES} runs.",),
    )


def goals(found: Mapping[str, Cost], before: Mapping[str, Cost]) -> list[Goal]:
    """Return a goal for each job of the committed state."""
    return [
        Goal(
            job,
            f"at most {TOLERANCE:g} times the committed cost",
            _compare(cost, old),
            _is_kept(cost, old),
        )
        for job, cost in found.items()
        if (old := before.get(job)) is not None
    ]


def _is_kept(now: Cost, before: Cost) -> bool:
    slower, larger = now.yardsticks / before.yardsticks, now.peak_mb / before.peak_mb
    return max(slower, larger) <= TOLERANCE


def _compare(now: Cost, before: Cost) -> str:
    slower, larger = now.yardsticks / before.yardsticks, now.peak_mb / before.peak_mb
    return f"time × {slower:.2f}, memory × {larger:.2f}"


def _columns(cost: Cost | None) -> list[str]:
    return ["–", "–"] if cost is None else [f"{cost.yardsticks:.2f}", f"{cost.peak_mb:.0f}"]


def costs(settings: Settings, times: int) -> dict[str, Cost]:
    """Return the cost of each job; the yardstick is run beside it."""
    with tempfile.TemporaryDirectory() as folder:
        found = {}
        for job, words in jobs(settings, Path(folder)).items():
            runs = [
                (_measured(words), measure([sys.executable, "-c", _YARDSTICK]))
                for _ in range(times)
            ]
            own, yardstick = (min(run[k].processor_seconds for run in runs) for k in (0, 1))
            peak = min(run.peak_bytes for run, _ in runs)
            found[job] = Cost(own / yardstick, peak / 1e6)
            print(f"{job}: {found[job].yardsticks:.2f} yardsticks", flush=True)
    return found


def _measured(words: list[str]) -> Measured:
    return measure([sys.executable, "-m", "groundtie", *words])


def jobs(settings: Settings, folder: Path) -> dict[str, list[str]]:
    """Return the command-line words of each job; the inputs are made here."""
    small, large, open_land = (
        Simulation(size, density, _SEED).pair(settings.cache)
        for size, density in ((500, "rural"), (1000, "suburban"), (1000, "rural"))
    )
    groundtie.simulate_sensor(folder, size=_SENSOR_PX, seed=_SEED)
    image, reference, dem = (str(folder / f"{name}.tif") for name in ("sensor", "reference", "dem"))

    def register(pair: object, *more: str) -> list[str]:
        files = [str(getattr(pair, side)) for side in ("reference", "input")]
        return ["coregister", *files, OUTPUT, "--quiet", *more]

    return {
        "help": ["--help"],
        "coregister, rural 500²": register(small),
        "coregister, affine, suburban 1000²": register(large, "--model", "affine"),
        "coregister, affine, rural 1000²": register(open_land, "--model", "affine"),
        "refine-rpc 500²": [
            *(
                "refine-rpc",
                image,
                OUTPUT,
                "--reference",
                reference,
                "--dem",
                dem,
                *_DATUM,
                "--quiet",
            )
        ],
        "filter-speckle 1000²": ["filter-speckle", str(large.reference), OUTPUT, "--quiet"],
    }


def read_state() -> dict[str, Cost]:
    """Return the committed costs."""
    return {job: Cost(**cost) for job, cost in json.loads(STATE.read_text()).items()}


def main() -> None:
    """Write the current costs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--update", action="store_true", required=True, help="write the state")
    parser.parse_args()
    cache = Path(__file__).parent / ".cache"
    found = costs(Settings(False, 1, 1, Path(), cache), _TIMES)
    STATE.write_text(
        json.dumps({job: asdict(cost) for job, cost in found.items()}, indent=2) + "\n"
    )


if __name__ == "__main__":
    main()
