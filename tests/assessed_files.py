"""A registration that is exact, and evidence on it with known errors, as files."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from affine import Affine
from raster_files import UTM, utm_grid, wave_image, write_raster
from rasterio.crs import CRS

from groundtie.geometry.models import Frame, PolynomialModel
from groundtie.geometry.tie_point_files import write_tie_points
from groundtie.geometry.tie_points import TiePoints
from groundtie.geometry.transform import Transform
from groundtie.rasters.grid import Grid

# The reference has pixels of 10 m, the input of 5 m.
REFERENCE, INPUT = utm_grid(160, 120), utm_grid(320, 240, 5.0)
SHIFT_M = np.array([70.0, -40.0])


def shifted(shift: Any, grid: Grid = INPUT, crs: CRS | None = UTM) -> Transform:
    """Return the transform of an input that claims to lie off by map units."""
    model = PolynomialModel("translation", Frame(Affine.identity()), np.array([shift], float))
    return Transform(model, crs, grid)


def stored(path: Path, transform: Transform) -> Path:
    path.write_text(json.dumps(transform.to_json()), encoding="utf-8")
    return path


def table(path: Path, xy: np.ndarray, px: np.ndarray) -> Path:
    lines = ["reference_x,reference_y,input_col,input_row"]
    lines += [",".join(repr(value) for value in row) for row in np.hstack([xy, px]).tolist()]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def tie_points(path: Path, transform: Transform, fit_px: Any, check_px: Any) -> Path:
    """Write 30 tie points with these errors at those of the fit and at those held out, 10."""
    is_check = np.arange(30) % 3 == 0
    px = np.random.default_rng(0).uniform([10, 10], [300, 220], (30, 2))
    points = TiePoints(
        reference_xy=transform.inverse(px),
        input_px=px + np.where(is_check[:, None], check_px, fit_px),
        score=np.ones(30),
        covariance_px2=np.tile(np.eye(2), (30, 1, 1)),
        forward_backward_error_px=np.zeros(30),
        is_check=is_check,
        state=np.full(30, "used"),
    )
    write_tie_points(path, points, transform)
    return path


@dataclass(frozen=True)
class Files:
    """A registration that is exact, and evidence on it with known errors."""

    folder: Path

    def path(self, name: str) -> Path:
        return self.folder / name


def written_files(tmp_path: Path) -> Files:
    """Write the registration A → B and its evidence.

    Check points are off by (0.3, −0.4) input pixels; the transform back by (6, 8) m.
    """
    folder = tmp_path / "in"
    folder.mkdir()
    truth = shifted(SHIFT_M)
    stored(folder / "t.json", truth)
    stored(folder / "back.json", shifted(-SHIFT_M + [6, 8], REFERENCE))
    xy = REFERENCE.pixel_to_map(np.random.default_rng(1).uniform([20, 20], [140, 100], (25, 2)))
    table(folder / "check.csv", xy, truth(xy) + [0.3, -0.4])
    tie_points(folder / "points.gpkg", truth, [1.0, 0.0], [0.0, 0.5])
    length = 400.0
    write_raster(
        folder / "reference.tif", wave_image(REFERENCE, length).astype(np.float32), REFERENCE
    )
    moved = wave_image(INPUT.shifted(*-SHIFT_M), length).astype(np.float32)
    write_raster(folder / "input.tif", moved, INPUT)
    return Files(folder)


def words(**options: Any) -> list[str]:
    """Return the words of a call on the command line."""
    named = ((f"--{name.replace('_', '-')}", str(value)) for name, value in options.items())
    return ["assess", *(word for pair in named for word in pair)]
