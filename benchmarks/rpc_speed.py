"""Speed of RPCs: a million points both ways, with peers in the same run."""

from __future__ import annotations

import json
import tempfile
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import rasterio
import rasterio.rpc
from rasterio.transform import RPCTransformer

from groundtie.rasters.grid import FloatArray
from groundtie.sensor.rpc import RPC
from groundtie.sensor.rpc_tags import rpc_to_tags

from .half_real import sensor_rpc
from .processes import measure, shortest_s
from .suites import Goal, Settings

FORWARD, INVERSE = "1e6 points to the image", "1e6 points to the ground"
OWN, RASTERIO = "GroundTie", "rasterio"
ORTHORITY = "orthority"
FORWARD_SECONDS, FORWARD_RATIO = 0.040, 4.0

_POINTS = 1_000_000
THREADS = 2
PEERS = Path(__file__).parent / "peers"

Timing = tuple[str, str, float, str]


def time_points(settings: Settings, times: int, orthority: Path | None) -> list[Timing]:
    """Time a million points to the image and back to the ground, best of several runs."""
    rpc = sensor_rpc(settings.data, "triplet")
    random = np.random.default_rng(0)
    height = rpc.offset[2] + random.uniform(-0.9, 0.9, _POINTS) * rpc.scale[2]
    px = random.uniform(0, 1000, (_POINTS, 2))
    ground = rpc.localise(px, height)
    rounds = 2 * times + 1
    found = [
        (FORWARD, OWN, _best(lambda: _in_threads(rpc.project, ground, height), rounds), ""),
        (
            INVERSE,
            OWN,
            _best(lambda: _in_threads(rpc.localise, px, height), rounds),
            _miss(rpc, px, height),
        ),
    ]
    with RPCTransformer(rasterio.rpc.RPC.from_gdal(rpc_to_tags(rpc))) as transformer:
        x, y = np.ascontiguousarray(ground.T)
        rows, cols = transformer.rowcol(x, y, zs=height, op=lambda value: value)
        apart = np.abs(np.column_stack([cols, rows]) - 0.5 - rpc.project(ground, height)).max()

        def forward() -> object:
            return transformer.rowcol(x, y, zs=height, op=lambda value: value)

        def inverse() -> object:
            return transformer.xy(rows, cols, zs=height, offset="ul")

        found += [
            (FORWARD, RASTERIO, _best(forward, times), f"differs by {apart:.0e} px"),
            (INVERSE, RASTERIO, _best(inverse, times), "stops at 0.1 px"),
        ]
    if orthority is not None:
        found += _orthority_points(orthority, rpc, ground, height, px)
    return found


def _in_threads(work: Callable[..., FloatArray], *points: FloatArray) -> list[FloatArray]:
    """Process points in as many parts at a time as there are threads, as tiles are processed."""
    with ThreadPoolExecutor(THREADS) as pool:
        return list(pool.map(work, *(np.array_split(part, THREADS) for part in points)))


def _best(work: Callable[[], object], times: int) -> float:
    return shortest_s(work, times, time.perf_counter)


def _miss(rpc: RPC, px: FloatArray, height: FloatArray) -> str:
    miss = np.abs(rpc.project(rpc.localise(px, height), height) - px).max()
    return f"misses by {miss:.0e} px"


def _orthority_points(
    python: Path, rpc: RPC, ground: FloatArray, height: FloatArray, px: FloatArray
) -> list[Timing]:
    with tempfile.TemporaryDirectory() as folder:
        given = Path(folder) / "points.npz"
        np.savez(given, ground=ground, height=height, px=px, tags=json.dumps(rpc_to_tags(rpc)))
        run = measure([str(python), str(PEERS / "orthority_points.py"), str(given)])
        seconds = json.loads(run.output.strip().splitlines()[-1])
        apart = np.abs(np.load(given.with_suffix(".out.npy")) - rpc.project(ground, height)).max()
    return [
        (FORWARD, ORTHORITY, seconds["forward"], f"differs by {apart:.0e} px"),
        (INVERSE, ORTHORITY, seconds["inverse"], ""),
    ]


def goals(timings: Sequence[Timing]) -> list[Goal]:
    """Return the goals, with their results."""
    seconds = {(what, program): value for what, program, value, _ in timings}
    own = {what: seconds[what, OWN] for what in (FORWARD, INVERSE)}
    ratio = seconds[FORWARD, RASTERIO] / own[FORWARD]
    return [
        Goal(
            FORWARD,
            f"at most {1000 * FORWARD_SECONDS:g} ms",
            f"{1000 * own[FORWARD]:.0f} ms",
            own[FORWARD] <= FORWARD_SECONDS,
        ),
        Goal(
            f"{FORWARD}, against rasterio",
            f"at least {FORWARD_RATIO:g} times faster",
            f"{ratio:.1f} times",
            ratio >= FORWARD_RATIO,
        ),
        Goal(
            f"{INVERSE}, against rasterio",
            "at least as fast",
            f"{own[INVERSE]:.3f} s against {seconds[INVERSE, RASTERIO]:.3f} s",
            own[INVERSE] <= seconds[INVERSE, RASTERIO],
        ),
    ]
