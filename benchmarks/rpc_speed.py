"""Speed of RPCs: a million points both ways, and orthorectification, with peers in the same run."""

from __future__ import annotations

import json
import shutil
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np
import rasterio
import rasterio.rpc
from affine import Affine
from numpy.typing import NDArray
from rasterio.errors import NotGeoreferencedWarning
from rasterio.transform import RPCTransformer

import groundtie
from groundtie.rasters.grid import LON_LAT, reproject
from groundtie.rasters.reading import open_raster
from groundtie.sensor.dense import DenseOrientation
from groundtie.sensor.orientation import orient
from groundtie.sensor.rpc import RPC
from groundtie.sensor.rpc_files import rpc_of
from groundtie.sensor.rpc_tags import rpc_to_tags

from .half_real import sensor_rpc
from .processes import OUTPUT, measure, measure_often
from .suites import Goal, Settings

FORWARD, INVERSE, ORTHO = (
    "1e6 points to the image",
    "1e6 points to the ground",
    "orthoimage, 44 Mpx",
)
OWN, RASTERIO = "GroundTie", "rasterio"
GDALWARP_EXACT, GDALWARP_FAST = "gdalwarp, exact", "gdalwarp, -et 0.125"
ORTHORITY = "orthority"
FORWARD_SECONDS, FORWARD_RATIO = 0.040, 4.0

_POINTS = 1_000_000
_THREADS = 2
_SIDE_PX = 6633
_RESAMPLING = "bilinear"
_EXACT_PX, _FAST_PX = "0", "0.125"
_TILE = 512
_PEERS = Path(__file__).parent / "peers"

FloatArray = NDArray[np.float64]
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
        (FORWARD, OWN, _best(lambda: rpc.project(ground, height, _THREADS), rounds), ""),
        (
            INVERSE,
            OWN,
            _best(lambda: rpc.localise(px, height, _THREADS), rounds),
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


def _best(work: Callable[[], object], times: int) -> float:
    seconds = []
    for _ in range(times):
        started = time.perf_counter()
        work()
        seconds.append(time.perf_counter() - started)
    return min(seconds)


def _miss(rpc: RPC, px: FloatArray, height: FloatArray) -> str:
    miss = np.abs(rpc.project(rpc.localise(px, height), height) - px).max()
    return f"misses by {miss:.0e} px"


def _orthority_points(
    python: Path, rpc: RPC, ground: FloatArray, height: FloatArray, px: FloatArray
) -> list[Timing]:
    with tempfile.TemporaryDirectory() as folder:
        given = Path(folder) / "points.npz"
        np.savez(given, ground=ground, height=height, px=px, tags=json.dumps(rpc_to_tags(rpc)))
        run = measure([str(python), str(_PEERS / "orthority_points.py"), str(given)])
        seconds = json.loads(run.output.strip().splitlines()[-1])
        apart = np.abs(np.load(given.with_suffix(".out.npy")) - rpc.project(ground, height)).max()
    return [
        (FORWARD, ORTHORITY, seconds["forward"], f"differs by {apart:.0e} px"),
        (INVERSE, ORTHORITY, seconds["inverse"], ""),
    ]


def time_ortho(settings: Settings, times: int) -> list[Timing]:
    """Time the orthorectification of a large image over hills, as whole processes."""
    with tempfile.TemporaryDirectory() as folder:
        image, dem = _write_large(Path(folder), sensor_rpc(settings.data, "ventoux"))
        like = Path(folder) / "like.tif"
        groundtie.orthorectify(image, like, dem, dem_datum="ellipsoidal", resampling="nearest")
        own = [
            *(sys.executable, "-m", "groundtie", "orthorectify", str(image), OUTPUT, "--quiet"),
            *("--dem", str(dem), "--dem-datum", "ellipsoidal", "--reference", str(like)),
            *("--resampling", _RESAMPLING, "--workers", str(_THREADS)),
        ]
        commands = {OWN: own}
        script = str(_PEERS / "gdal_ortho.py")
        for name, tolerance in (
            (f"{RASTERIO}, exact", _EXACT_PX), (f"{RASTERIO}, tolerance 0.125", _FAST_PX)
        ):  # fmt: skip
            commands[name] = [
                *(sys.executable, script, str(image), str(dem), str(like)),
                *(_RESAMPLING, tolerance, OUTPUT),
            ]
        if shutil.which("gdalwarp"):
            for name, tolerance in ((GDALWARP_EXACT, _EXACT_PX), (GDALWARP_FAST, _FAST_PX)):
                commands[name] = gdalwarp(image, dem, like, tolerance)
        note = f"positions differ from GDAL's by {position_error_px(image, dem, like):.0e} px"
        return [
            (ORTHO, name, measure_often(command, times).seconds, note if name == OWN else "")
            for name, command in commands.items()
        ]


def gdalwarp(image: Path, dem: Path, like: Path, tolerance_px: str) -> list[str]:
    """Return the call of gdalwarp that makes the same orthoimage."""
    with rasterio.open(like) as grid:
        bounds = [f"{value:.17g}" for value in grid.bounds]
        size, crs = [str(grid.width), str(grid.height)], grid.crs.to_string()
    return [
        *("gdalwarp", "-q", "-rpc", "-to", f"RPC_DEM={dem}", "-et", tolerance_px, "-t_srs", crs),
        *("-te", *bounds, "-ts", *size, "-r", _RESAMPLING, "-multi", "-wm", "256"),
        *("-wo", f"NUM_THREADS={_THREADS}", "-co", "TILED=YES", "-co", "COMPRESS=DEFLATE"),
        *("-co", "ZLEVEL=1", "-co", "PREDICTOR=2", "-co", f"NUM_THREADS={_THREADS}"),
        *(str(image), OUTPUT),
    ]


def _write_large(folder: Path, sensor: RPC) -> tuple[Path, Path]:
    """Write an image of 44 Mpx with real RPCs, and a terrain of 30 m pixels under it."""
    random = np.random.default_rng(0)
    texture = cv2.GaussianBlur(random.normal(size=(_SIDE_PX,) * 2).astype(np.float32), (0, 0), 2)
    values = np.clip(2000 + 400 * texture / texture.std(), 1, 65_535).astype(np.uint16)
    middle = np.array([_SIDE_PX / 2] * 2)
    rpc = sensor.shifted(middle - sensor.image_offset)
    image, dem = folder / "image.tif", folder / "dem.tif"
    profile = {"driver": "GTiff", "count": 1, "tiled": True, "width": _SIDE_PX, "height": _SIDE_PX}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        with rasterio.open(image, "w", dtype="uint16", **profile) as dataset:
            dataset.rpcs = rasterio.rpc.RPC.from_gdal(rpc_to_tags(rpc))
            dataset.write(values, 1)
    size, step = 320, 1 / 3600
    corner = rpc.localise([middle], rpc.offset[2])[0] + [-size / 2 * step, size / 2 * step]
    hills = cv2.GaussianBlur(random.normal(size=(size, size)), (0, 0), 6)
    heights = (rpc.offset[2] + 60 * hills / hills.std()).astype(np.float32)
    transform = Affine(step, 0, corner[0], 0, -step, corner[1])
    shape = {"driver": "GTiff", "count": 1, "width": size, "height": size}
    with rasterio.open(
        dem, "w", dtype="float32", crs="EPSG:4326", transform=transform, **shape
    ) as dataset:
        dataset.write(heights, 1)
    return image, dem


def position_error_px(image: Path, dem: Path, like: Path) -> float:
    """Return the largest error of a tile's positions against GDAL's exact ones, in pixels."""
    with (
        open_raster(image, allow_sensor_geometry=True) as source,
        open_raster(dem) as terrain,
        open_raster(like) as grid,
    ):
        orientation = orient(source, rpc_of(source), grid.grid.crs, terrain)
        tile = grid.grid.window(grid.grid.width // 2, grid.grid.height // 2, _TILE, _TILE)
        own = DenseOrientation(orientation).coordinates(tile).reshape(2, -1).T
    cols, rows = np.meshgrid(np.arange(_TILE), np.arange(_TILE))
    xy = tile.pixel_to_map(np.column_stack([cols.ravel(), rows.ravel()]))
    x, y = np.ascontiguousarray(reproject(xy, tile.crs, LON_LAT).T)
    with rasterio.open(image) as dataset, RPCTransformer(dataset.rpcs, RPC_DEM=str(dem)) as exact:
        found = exact.rowcol(x, y, op=lambda value: value)
    return float(np.abs(np.column_stack([found[1], found[0]]) - 0.5 - own).max())


def goals(timings: Sequence[Timing]) -> list[Goal]:
    """Return the goals and what was found."""
    seconds = {(what, program): value for what, program, value, _ in timings}
    own = {what: seconds[what, OWN] for what in (FORWARD, INVERSE)}
    ratio = seconds[FORWARD, RASTERIO] / own[FORWARD]
    found = [
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
    rivals = [GDALWARP_FAST, f"{RASTERIO}, tolerance 0.125"]
    for rival in rivals:
        if (ORTHO, rival) in seconds:
            mine, theirs = seconds[ORTHO, OWN], seconds[ORTHO, rival]
            text = f"{mine:.1f} s against {theirs:.1f} s"
            found.append(
                Goal(f"{ORTHO}, against {rival}", "at least as fast", text, mine <= theirs)
            )
    return found
