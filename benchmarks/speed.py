"""Speed and memory, with peers in the same run."""

from __future__ import annotations

import json
import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from functools import partial
from multiprocessing import get_context
from pathlib import Path

import cv2
import numpy as np
import rasterio
from affine import Affine
from numpy.typing import NDArray

from groundtie.context import threads
from groundtie.geometry.transform import Transform
from groundtie.masks.ground import find_ground
from groundtie.masks.scene import Scene
from groundtie.rasters.patch import Patch
from groundtie.rasters.reading import open_raster
from groundtie.similarity.description import BORDER_PX
from groundtie.similarity.measures import nmi
from groundtie.similarity.surface import SimilaritySettings, describe
from groundtie.speckle.filters import FILTERS, SpeckleFilter

from . import rpc_speed
from .attempt import Pair, on_pixels
from .offsets import apply_matrix
from .processes import OUTPUT, Measured, measure, measure_often, shortest_s
from .simulations import Simulation
from .suites import Goal, Settings, SuiteResult, Table

PEERS = Path(__file__).parent / "peers"
ENVIRONMENTS = Path(__file__).parent / ".peers"
NOT_INSTALLED = "not installed"
OWN = "GroundTie"
SIMPLEITK_METRIC = "SimpleITK Mattes metric"
SIMPLEITK_AFFINE = "SimpleITK affine"
AROSICS_LOCAL = "AROSICS local"

# The surface to be compared.
RADIUS_PX = 20
WINDOW_PX = 1000
BINS = 64
THREADS = 2
SURFACE = f"NMI surface, {2 * RADIUS_PX + 1}×{2 * RADIUS_PX + 1} shifts"
PEER_STEP_PX = 3
_TIMES = 3
_WANTED_RATIO = 60.0

_LARGEST_SHIFT_PX = 20

# A radar image that is filtered and searched for its ground on one core.
RADAR_PX = 4000
FILTER, FILTER_RATE = "speckle filter ", 20.0
GROUND, GROUND_SECONDS = f"ground of a town, {RADAR_PX}×{RADAR_PX} px", 10.0

_SEED = 1


@dataclass(frozen=True)
class Record:
    """One measurement of one program."""

    what: str
    program: str
    seconds: float
    peak_bytes: int | None = None
    note: str = ""


def peer_python(name: str) -> Path | None:
    """Return the Python of a peer's environment; None if it is not installed."""
    folder = ENVIRONMENTS / name
    return folder / "bin" / "python" if (folder / ".installed").exists() else None


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    times = 1 if settings.quick else _TIMES
    surfaces = time_surfaces(settings, times)
    affine = time_affine(settings, times)
    radar = time_radar(times)
    timings = rpc_speed.time_points(settings, times, peer_python("orthority"))
    records = [*surfaces, *affine, *radar]
    records += [Record(what, name, seconds, note=note) for what, name, seconds, note in timings]
    goals = [surface_goal(surfaces), *affine_goals(affine), *radar_goals(radar)]
    goals += rpc_speed.goals(timings)
    return SuiteResult(
        "Speed and memory",
        goals,
        (measurements(records),),
        [asdict(record) for record in records],
        (
            f"Surface: {WINDOW_PX}×{WINDOW_PX} px window, {BINS} bins, {THREADS} threads, from "
            "grey values to similarities; SimpleITK's metric is evaluated by its exhaustive "
            f"optimiser, at every {PEER_STEP_PX}rd shift each way, and scaled up. "
            "Registrations: whole processes, start, imports and written output included, median "
            f"of {times}.",
        ),
    )


def simulated(settings: Settings, size: int) -> Pair:
    """Return a simulated pair, made in a process that ends and frees its memory."""
    simulation = Simulation(size, "suburban", _SEED)
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        return pool.submit(simulation.pair, settings.cache).result()


def time_surfaces(settings: Settings, times: int) -> list[Record]:
    """Time the surface of one window, here and with SimpleITK's metric."""
    pair = simulated(settings, WINDOW_PX + 200)
    template = read_window(pair.reference, WINDOW_PX + 2 * BORDER_PX)
    search = read_window(pair.input, WINDOW_PX + 2 * BORDER_PX + 2 * RADIUS_PX)
    own = min(_own_surface_seconds(template, search) for _ in range(times))
    python = peer_python("simpleitk")
    if python is None:
        return [Record(SURFACE, OWN, own)]
    inner = slice(BORDER_PX, -BORDER_PX)
    with tempfile.TemporaryDirectory() as folder:
        windows = Path(folder) / "windows.npz"
        np.savez(windows, template=template[inner, inner], search=search[inner, inner])
        numbers = (BINS, THREADS, PEER_STEP_PX, RADIUS_PX // PEER_STEP_PX)
        script = PEERS / "simpleitk_surface.py"
        run = measure([str(python), str(script), str(windows), *map(str, numbers)])
    found = json.loads(run.output)
    seconds = found["seconds"] * surface_shifts(1) / surface_shifts(PEER_STEP_PX)
    note = f"{surface_shifts(PEER_STEP_PX)} shifts in {found['seconds']:.2f} s, scaled up"
    return [Record(SURFACE, OWN, own), Record(SURFACE, SIMPLEITK_METRIC, seconds, note=note)]


def surface_shifts(step_px: int) -> int:
    """Return the number of shifts of the surface at this spacing in pixels."""
    return (2 * (RADIUS_PX // step_px) + 1) ** 2


def read_window(path: Path, size: int) -> NDArray[np.float32]:
    """Return the mean of all bands of a raster's central square."""
    with rasterio.open(path) as source:
        col, row = (source.width - size) // 2, (source.height - size) // 2
        window = rasterio.windows.Window(col, row, size, size)
        return source.read(window=window).mean(axis=0, dtype=np.float32)


def _own_surface_seconds(template: NDArray[np.float32], search: NDArray[np.float32]) -> float:
    settings = SimilaritySettings("nmi", bins=BINS)
    patches = [Patch(image, np.ones(image.shape, bool)) for image in (template, search)]
    with threads(THREADS) as context:
        started = time.perf_counter()
        windows = [describe(patch, WINDOW_PX**2, settings) for patch in patches]
        nmi(*windows, context)
        return time.perf_counter() - started


def time_affine(settings: Settings, times: int) -> list[Record]:
    """Time affine registrations of the same pair."""
    pair = simulated(settings, WINDOW_PX)
    files = [str(pair.reference), str(pair.input), OUTPUT]
    commands = {OWN: [*own_command(pair), "--model", "affine"]}
    for program, environment, script, more in (
        (SIMPLEITK_AFFINE, "simpleitk", "simpleitk_affine.py", []),
        (AROSICS_LOCAL, "arosics", "arosics_local.py", [str(_LARGEST_SHIFT_PX)]),
    ):
        python = peer_python(environment)
        if python is not None:
            commands[program] = [str(python), str(PEERS / script), *files, *more]
    what = f"affine, {WINDOW_PX}×{WINDOW_PX} px"
    return [
        record_of(what, program, measure_often(command, times), pair)
        for program, command in commands.items()
    ]


def own_command(pair: Pair) -> list[str]:
    """Return the command that registers a pair and prints its result as JSON."""
    files = [str(pair.reference), str(pair.input), OUTPUT]
    return [sys.executable, "-m", "groundtie", "coregister", *files, "--json", "--quiet"]


def record_of(what: str, program: str, measured: Measured, pair: Pair) -> Record:
    """Return the record of a registration, including its result."""
    note = describe_found(program, measured.output, pair)
    return Record(what, program, measured.seconds, measured.peak_bytes, note)


def describe_found(program: str, output: str, pair: Pair) -> str:
    """Return in words the result in a program's JSON: its last line of output, or all of it."""
    if program == OWN:
        error_px = own_error_px(output, pair)
        return "refused" if error_px is None else f"error {error_px:.2f} px"
    found = json.loads(output.strip().splitlines()[-1])
    if program == AROSICS_LOCAL:
        return f"{found['tie_points']} tie points of {found['of']} kept"
    assert pair.truth is not None
    matrix = np.array(found)
    error_px = pair.truth.error_px(lambda px: apply_matrix(matrix, px))
    return f"error {error_px:.2f} px"


def own_error_px(output: str, pair: Pair) -> float | None:
    """Return the error of the output of `groundtie coregister --json`; None if refused."""
    values = json.loads(output)
    if not values["verdict"]["accepted"]:
        return None
    assert pair.truth is not None
    return pair.truth.error_px(on_pixels(Transform.from_json(values["transform"]), pair.reference))


def time_radar(times: int) -> list[Record]:
    """Time speckle filters and the search for the ground, on one core."""
    generator = np.random.default_rng(_SEED)
    cells = generator.choice([1.0, 4.0, 20.0], (RADAR_PX // 80, RADAR_PX // 80))
    power = np.kron(cells, np.ones((80, 80))) * generator.standard_gamma(1, (RADAR_PX, RADAR_PX))
    image, valid = power.astype(np.float32), np.ones(power.shape, bool)
    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        records = [
            Record(
                f"{FILTER}{name}",
                OWN,
                shortest_s(partial(SpeckleFilter(name, 7, 1.0), image, valid), times),
            )
            for name in FILTERS
        ]
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "radar.tif"
            profile = {"driver": "GTiff", "dtype": "float32", "count": 1}
            # The ground of a town is found by sizes in metres.
            profile |= {"transform": Affine.scale(1.0, -1.0), "crs": "EPSG:32632"}
            with rasterio.open(path, "w", width=RADAR_PX, height=RADAR_PX, **profile) as written:
                written.write(np.sqrt(image), 1)
            with open_raster(path) as source:
                seconds = shortest_s(partial(find_ground, Scene.of(source)), times)
        records.append(Record(GROUND, OWN, seconds))
    finally:
        cv2.setNumThreads(threads)
    return records


def radar_goals(records: Sequence[Record]) -> list[Goal]:
    """Return the goals for the processing of radar images, with their results."""
    goals = []
    for record in records:
        if record.what == GROUND:
            wanted, reached = f"at most {GROUND_SECONDS:g} s", record.seconds <= GROUND_SECONDS
            found = f"{record.seconds:.1f} s"
        else:
            rate = RADAR_PX**2 / record.seconds / 1e6
            wanted, reached = f"at least {FILTER_RATE:g} Mpx/s", rate >= FILTER_RATE
            found = f"{rate:.0f} Mpx/s"
        goals.append(Goal(record.what, wanted, found, reached))
    return goals


def surface_goal(records: Sequence[Record]) -> Goal:
    """Return the goal for the surface, with its result."""
    seconds = {record.program: record.seconds for record in records}
    what, wanted = "Surface against SimpleITK's metric", f"at least {_WANTED_RATIO:g} times faster"
    if SIMPLEITK_METRIC not in seconds:
        return Goal(what, wanted, f"{seconds[OWN]:.2f} s; SimpleITK {NOT_INSTALLED}", None)
    ratio = seconds[SIMPLEITK_METRIC] / seconds[OWN]
    found = f"{ratio:.0f} times ({seconds[OWN]:.2f} s against {seconds[SIMPLEITK_METRIC]:.0f} s)"
    return Goal(what, wanted, found, ratio >= _WANTED_RATIO)


def affine_goals(records: Sequence[Record]) -> list[Goal]:
    """Return the goals for affine registrations, with their results."""
    seconds = {record.program: record.seconds for record in records}
    goals = []
    for peer in (SIMPLEITK_AFFINE, AROSICS_LOCAL):
        own = f"{seconds[OWN]:.1f} s"
        faster, found = None, f"{own}; {peer} {NOT_INSTALLED}"
        if peer in seconds:
            faster, found = seconds[OWN] < seconds[peer], f"{own} against {seconds[peer]:.1f} s"
        goals.append(Goal(f"Affine against {peer}", "faster", found, faster))
    return goals


def measurements(records: Sequence[Record]) -> Table:
    """Return all measurements, including peers that are not installed."""
    rows = [
        [
            record.what,
            record.program,
            f"{record.seconds:.2f}",
            "–" if record.peak_bytes is None else f"{record.peak_bytes / 1e6:.0f}",
            record.note,
        ]
        for record in records
    ]
    there = {record.program for record in records}
    for peer in (SIMPLEITK_METRIC, SIMPLEITK_AFFINE, AROSICS_LOCAL):
        if peer not in there:
            rows.append(["", peer, NOT_INSTALLED, "–", "see make_peers_env.sh"])
    return Table("Measured", ("what", "program", "s", "peak MB", "found"), rows)
