"""Orthorectification of a large image, with peers in the same run."""

from __future__ import annotations

import shutil
import sys
import tempfile
import warnings
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

import cv2
import numpy as np
import rasterio
import rasterio.rpc
from affine import Affine
from rasterio.errors import NotGeoreferencedWarning
from rasterio.transform import RPCTransformer

import groundtie
from groundtie.rasters.grid import LON_LAT, mesh, reproject
from groundtie.rasters.reading import open_raster
from groundtie.sensor.dense import DenseOrientation
from groundtie.sensor.orientation import orient
from groundtie.sensor.rpc import RPC
from groundtie.sensor.rpc_files import rpc_of
from groundtie.sensor.rpc_tags import rpc_to_tags

from .half_real import sensor_rpc
from .processes import OUTPUT, Measured, measure_often
from .rpc_speed import OWN, PEERS, RASTERIO, THREADS
from .suites import Goal, Settings, SuiteResult, Table

GDALWARP_EXACT, GDALWARP_FAST = "gdalwarp, exact", "gdalwarp, -et 0.125"
SAME_FILE = f"{GDALWARP_FAST}, and gdaladdo"

_TIMES = 3
_SIDE_PX = 6633
_RESAMPLING = "bilinear"
_EXACT_PX, _FAST_PX = "0", "0.125"
_TILE = 512


def run(settings: Settings) -> SuiteResult:
    """Run the suite."""
    with tempfile.TemporaryDirectory() as folder:
        image, dem = write_large(Path(folder), sensor_rpc(settings.data, "ventoux"))
        like = Path(folder) / "like.tif"
        groundtie.orthorectify(image, like, dem, dem_datum="ellipsoidal", resampling="nearest")
        found = {
            name: measure_often(command, 1 if settings.quick else _TIMES)
            for name, command in commands(image, dem, like).items()
        }
        apart = position_error_px(image, dem, like)
    head = ("program", "s", "s of processors", "peak MB")
    rows = [
        [
            name,
            f"{one.seconds:.1f}",
            f"{one.processor_seconds:.1f}",
            f"{one.peak_bytes / 1e6:.0f}",
        ]
        for name, one in found.items()
    ]
    return SuiteResult(
        "Orthorectification",
        goals(found),
        (Table("Image of 44 Mpx over a terrain of 30 m, whole processes", head, rows),),
        [{"program": name, **asdict(one)} for name, one in found.items()],
        (
            f"Two threads, {_RESAMPLING}, deflate; {OWN} writes overviews, which of the others "
            f"{SAME_FILE} does alone. {OWN}'s positions differ from GDAL's exact ones by "
            f"{apart:.0e} px.",
        ),
    )


def goals(found: Mapping[str, Measured]) -> list[Goal]:
    """Return the goal, with its result, in processor time: it counts beside other work, too."""
    if SAME_FILE not in found:
        return []
    own, rival = found[OWN], found[SAME_FILE]
    text = (
        f"{own.seconds:.1f} s against {rival.seconds:.1f} s; of processors "
        f"{own.processor_seconds:.1f} s against {rival.processor_seconds:.1f} s"
    )
    is_reached = own.seconds <= rival.seconds
    return [Goal(f"Orthoimage, against {SAME_FILE}", "at least as fast", text, is_reached)]


def commands(image: Path, dem: Path, like: Path) -> dict[str, list[str]]:
    """Return the commands by which each program makes the orthoimage."""
    found = {
        OWN: [
            *(sys.executable, "-m", "groundtie", "orthorectify", str(image), OUTPUT, "--quiet"),
            *("--dem", str(dem), "--dem-datum", "ellipsoidal", "--reference", str(like)),
            *("--resampling", _RESAMPLING, "--workers", str(THREADS)),
        ]
    }
    script = str(PEERS / "gdal_ortho.py")
    for name, tolerance in (
        (f"{RASTERIO}, exact", _EXACT_PX), (f"{RASTERIO}, tolerance 0.125", _FAST_PX)
    ):  # fmt: skip
        found[name] = [
            *(sys.executable, script, str(image), str(dem), str(like)),
            *(_RESAMPLING, tolerance, OUTPUT),
        ]
    if shutil.which("gdalwarp"):
        for name, tolerance in ((GDALWARP_EXACT, _EXACT_PX), (GDALWARP_FAST, _FAST_PX)):
            found[name] = gdalwarp(image, dem, like, tolerance)
        if shutil.which("gdaladdo"):
            found[SAME_FILE] = with_overviews(found[GDALWARP_FAST])
    return found


def with_overviews(command: list[str]) -> list[str]:
    """Return a command that adds overviews to another command's output."""
    options = f"--config COMPRESS_OVERVIEW DEFLATE --config GDAL_NUM_THREADS {THREADS}"
    script = f'file=$1; shift; "$@" "$file" && gdaladdo -q -r average {options} "$file" 2 4 8 16'
    return ["sh", "-c", script, "sh", OUTPUT, *command[:-1]]


def gdalwarp(image: Path, dem: Path, like: Path, tolerance_px: str) -> list[str]:
    """Return the gdalwarp command that makes the same orthoimage."""
    with rasterio.open(like) as grid:
        bounds = [f"{value:.17g}" for value in grid.bounds]
        size, crs = [str(grid.width), str(grid.height)], grid.crs.to_string()
    return [
        *("gdalwarp", "-q", "-rpc", "-to", f"RPC_DEM={dem}", "-et", tolerance_px, "-t_srs", crs),
        *("-te", *bounds, "-ts", *size, "-r", _RESAMPLING, "-multi", "-wm", "256"),
        *("-wo", f"NUMTHREADS={THREADS}", "-co", "TILED=YES", "-co", "COMPRESS=DEFLATE"),
        *("-co", "ZLEVEL=1", "-co", "PREDICTOR=2", "-co", f"NUMTHREADS={THREADS}"),
        *(str(image), OUTPUT),
    ]


def write_large(folder: Path, sensor: RPC) -> tuple[Path, Path]:
    """Write an image of 44 Mpx with real RPCs, and a terrain model of 30 m pixels for it."""
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
    xy = tile.pixel_to_map(mesh(np.arange(_TILE), np.arange(_TILE)))
    x, y = np.ascontiguousarray(reproject(xy, tile.crs, LON_LAT).T)
    with rasterio.open(image) as dataset, RPCTransformer(dataset.rpcs, RPC_DEM=str(dem)) as exact:
        found = exact.rowcol(x, y, op=lambda value: value)
    return float(np.abs(np.column_stack([found[1], found[0]]) - 0.5 - own).max())
