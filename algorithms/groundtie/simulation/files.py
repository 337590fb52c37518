"""Output files of a simulated pair."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from ..geometry.models import DEGREE, TERRAIN
from ..rasters.atomic import Outputs, make_folder, write_csv, write_json, writing
from ..rasters.grid import FloatArray
from ..rasters.writing import write_raster
from .metadata import optical_item, sar_item
from .pair import SAR, SimulatedPair

NAMES = {
    "reference": "reference.tif",
    "input": "input.tif",
    "dem": "dem.tif",
    "input_dem": "input_dem.tif",
    "dsm": "dsm.tif",
    "reference_metadata": "reference.json",
    "input_metadata": "input.json",
    "truth": "truth.json",
    "check_points": "check_points.csv",
    "roof_points": "roof_points.csv",
}
CHECK_POINT_COLUMNS = (
    "reference_x",
    "reference_y",
    "reference_col",
    "reference_row",
    "input_col",
    "input_row",
)
ROOF_POINT_COLUMNS = ("x", "y", "height_m", *CHECK_POINT_COLUMNS[2:])


def write_pair(pair: SimulatedPair, folder: str | Path) -> dict[str, Path]:
    """Write a pair into a folder, which is created if needed; all files appear or none.

    Returns
    -------
    dict
        Paths of reference, input, dem (bare ground in metres on the reference's pixels), input_dem
        (heights that the input was orthorectified with, only if they have errors), dsm (ground with
        buildings and trees), reference_metadata and input_metadata (STAC items), truth (JSON, which
        `load_transform` reads), check_points and roof_points (CSV). input_dem and dsm extend beyond
        the reference.

    Raises
    ------
    OutputError
        A file cannot be written.
    """
    paths = {key: Path(folder) / name for key, name in NAMES.items()}
    if not pair.options.terrain_error_m:
        del paths["input_dem"]
    make_folder(Path(folder))
    optical, sar = [band.capitalize() for band in pair.options.optical.bands], ["Amplitude"]
    reference, input = (optical, sar) if pair.options.input == SAR else (sar, optical)
    with Outputs() as outputs, writing(folder):
        staged = {key: outputs.stage(path) for key, path in paths.items()}
        write_raster(staged["reference"], pair.reference, pair.reference_grid, reference)
        write_raster(staged["input"], pair.input, pair.truth.input_grid, input)
        terrain = pair.scene.terrain_m[pair.scene.window]
        write_raster(staged["dem"], terrain[None], pair.reference_grid, ["Height of ground (m)"])
        surface, grid = pair.scene.surface_m, pair.reference_grid
        around = grid.widened(pair.scene.margin_px)
        write_raster(staged["dsm"], surface[None], around, ["Height of surface (m)"])
        if "input_dem" in staged:
            write_raster(staged["input_dem"], pair.assumed_m[None], around, ["Height taken (m)"])
        for name, lies in (("reference", grid), ("input", pair.truth.input_grid)):
            is_radar = (name == "input") == (pair.options.input == SAR)
            item = (
                sar_item(NAMES[name], lies, pair.options.sar)
                if is_radar
                else optical_item(NAMES[name], lies, pair.options.optical)
            )
            write_json(staged[f"{name}_metadata"], item)
        write_json(staged["truth"], truth_json(pair))
        write_table(staged["check_points"], CHECK_POINT_COLUMNS, _check_points(pair))
        write_table(staged["roof_points"], ROOF_POINT_COLUMNS, _roof_points(pair))
    return paths


def truth_json(pair: SimulatedPair) -> dict[str, Any]:
    """Return the truth and the options that it was drawn from.

    It is the JSON of the `Transform`, plus `seed`, `sigma_px` (0: exact) and `options`. An affine
    truth also has `reference_to_input` and `map_to_input`: the 2×3 matrices that map reference
    pixel (col, row, 1) and reference map position (x, y, 1) to input pixel (col, row).
    """
    values = {
        **pair.truth.to_json(),
        "seed": pair.options.scene.seed,
        "sigma_px": 0.0,
        "options": asdict(pair.options),
    }
    if pair.truth.model.kind == TERRAIN:
        values["model"] |= {key: NAMES[key] for key in ("dem", "input_dem")}
    elif DEGREE[pair.truth.model.kind] <= 1:
        grid, truth = pair.reference_grid, pair.truth
        centre = np.array(grid.centre_px)
        values["reference_to_input"] = _matrix(lambda px: truth(grid.pixel_to_map(px)), centre)
        values["map_to_input"] = _matrix(truth, grid.pixel_to_map(centre)[0])
    return values


def _matrix(function: Callable[[FloatArray], FloatArray], centre: FloatArray) -> list[list[float]]:
    """Return the 2×3 matrix of an affine function of the plane, from values around the centre."""
    step = 1000.0
    base, along_x, along_y = function(centre + [[0, 0], [step, 0], [0, step]])
    linear = np.column_stack([along_x - base, along_y - base]) / step
    return np.column_stack([linear, base - linear @ centre]).tolist()


def _check_points(pair: SimulatedPair) -> FloatArray:
    xy = pair.reference_grid.pixel_to_map(pair.check_points_px)
    return np.hstack([xy, pair.check_points_px, pair.truth(xy)])


def _roof_points(pair: SimulatedPair) -> FloatArray:
    points = pair.roof_points
    xy = pair.reference_grid.pixel_to_map(points.px)
    return np.hstack([xy, points.height_m[:, None], points.reference_px, points.input_px])


def write_table(path: Path, columns: Sequence[str], table: FloatArray) -> None:
    """Write a table as CSV, with six decimals."""
    texts = ([f"{value:.6f}" for value in row] for row in table)
    write_csv(path, columns, (dict(zip(columns, row, strict=True)) for row in texts))
