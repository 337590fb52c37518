"""Output files of a simulated sensor image."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from ..rasters.atomic import Outputs, make_folder, write_json, writing
from ..rasters.writing import write_raster
from ..sensor.rpc_files import write_rpc
from ..sensor.rpc_tags import rpc_to_tags
from .files import write_table
from .metadata import optical_item, sar_item
from .sensor_image import FloatArray, SensorImage

NAMES = {
    "reference": "reference.tif",
    "image": "sensor.tif",
    "dem": "dem.tif",
    "dsm": "dsm.tif",
    "reference_metadata": "reference.json",
    "image_metadata": "sensor.json",
    "exact_rpc": "exact_rpc.txt",
    "truth": "truth.json",
    "check_points": "check_points.csv",
    "roof_points": "roof_points.csv",
}
CHECK_POINT_COLUMNS = ("reference_x", "reference_y", "height_m", "input_col", "input_row")
ROOF_POINT_COLUMNS = (
    *("x", "y", "ground_m", "height_m"),
    *("reference_col", "reference_row", "input_col", "input_row"),
)


def write_sensor_image(made: SensorImage, folder: str | Path) -> dict[str, Path]:
    """Write a sensor image into a folder, which is created if needed; all files appear or none.

    Returns
    -------
    dict
        Paths of reference (SAR orthoimage), image (with the delivered RPCs in its tags), dem (bare
        ground, metres above the ellipsoid), dsm (the same with buildings and trees),
        reference_metadata and image_metadata (STAC items), exact_rpc, truth (JSON), check_points
        and roof_points (CSV).

    Raises
    ------
    OutputError
        A file cannot be written.
    """
    paths = {key: Path(folder) / name for key, name in NAMES.items()}
    make_folder(Path(folder))
    bands = [band.capitalize() for band in made.options.optical.bands]
    rpc_tags = rpc_to_tags(made.delivered.rpc)
    own = made.reference_grid.on_own_pixels()
    with Outputs() as outputs, writing(folder):
        staged = {key: outputs.stage(path) for key, path in paths.items()}
        write_raster(staged["reference"], made.reference[None], made.reference_grid, ["Amplitude"])
        write_raster(staged["image"], made.image, own, bands, rpc_tags=rpc_tags)
        heights = ["Height of ground above the ellipsoid (m)"]
        write_raster(staged["dem"], made.terrain.height_m[None], made.terrain.grid, heights)
        surface = ["Height of surface above the ellipsoid (m)"]
        write_raster(staged["dsm"], made.surface_m[None], made.terrain.grid, surface)
        sar, grid = made.options.sar, made.reference_grid
        write_json(staged["reference_metadata"], sar_item(NAMES["reference"], grid, sar))
        write_json(
            staged["image_metadata"], optical_item(NAMES["image"], grid, made.options.optical)
        )
        write_rpc(staged["exact_rpc"], made.exact.rpc)
        write_json(staged["truth"], truth_json(made))
        write_table(staged["check_points"], CHECK_POINT_COLUMNS, _check_points(made))
        write_table(staged["roof_points"], ROOF_POINT_COLUMNS, _roof_points(made))
    return paths


def truth_json(made: SensorImage) -> dict[str, Any]:
    """Return the truth of a sensor image and the options that it was drawn from.

    `true_to_delivered` and `delivered_to_true` are the 2×3 matrices between the image positions
    (col, row, 1) of the camera and those of the delivered RPCs.
    """
    return {
        "seed": made.options.scene.seed,
        "vertical_datum": "ellipsoidal",
        "true_to_delivered": made.error.matrix.tolist(),
        "delivered_to_true": made.error.inverse().matrix.tolist(),
        "largest_rpc_residual_px": {
            "exact": made.exact.largest_residual_px,
            "delivered": made.delivered.largest_residual_px,
        },
        "options": asdict(made.options),
    }


def _check_points(made: SensorImage) -> FloatArray:
    ground = made.ground_m(made.check_points_px)
    return np.hstack([ground, made.camera.project(ground)])


def _roof_points(made: SensorImage) -> FloatArray:
    points = made.roof_points
    ground = made.ground_m(points.px)
    heights = points.height_m[:, None]
    return np.hstack([ground, heights, points.reference_px, points.input_px])
