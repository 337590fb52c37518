"""Real image pairs with known truth, written as georeferenced pairs with a known wrong shift."""

from __future__ import annotations

import csv
import json
import os
import warnings
import zlib
from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from affine import Affine
from numpy.typing import NDArray
from rasterio.errors import NotGeoreferencedWarning

from groundtie.rasters.grid import compose

from .accuracy import FloatArray, Truth
from .attempt import Pair

# An arbitrary place: reference pixels of 1 m make search radii in metres equal to pixels.
CRS = "EPSG:32633"
REFERENCE_TRANSFORM = Affine(1.0, 0.0, 500_000.0, 0.0, -1.0, 5_000_000.0)

SAR_OPTICAL, SAR_SAR = "sar-optical", "sar-sar"
KINDS = (SAR_OPTICAL, SAR_SAR, "optical-optical", "optical-infrared", "day-night")

# Cases of another case's place, found by visual inspection: the file names do not show it.
_SAME_PLACE = {"ss-yellow-c": "ss-meander", "oo-cloudy-sentinel": "so-cloudy-sentinel"}

# Geotransforms refer to a pixel's corner, positions here to its centre.
_TO_CENTRE = Affine.translation(0.5, 0.5)


@dataclass(frozen=True)
class RealCase:
    """A pair of images and its truth.

    Parameters
    ----------
    name, kind
        From cases.json.
    reference, input
        Files, mostly without georeferencing.
    sigma_px
        Uncertainty of the truth, in reference pixels.
    matrix
        Input (col, row) = matrix · reference (col, row, 1), shape (2, 3).
    check_points
        Table with the columns reference col, row and input col, row, if one exists.
    """

    name: str
    kind: str
    reference: Path
    input: Path
    sigma_px: float
    matrix: FloatArray
    check_points: Path | None = None

    @property
    def place(self) -> str:
        """Name of the place that is shown."""
        return _SAME_PLACE.get(self.name, self.name)

    def reference_to_input(self, px: FloatArray) -> FloatArray:
        """Return the input positions of reference positions (col, row), shape (n, 2)."""
        return np.asarray(px @ self.matrix[:, :2].T + self.matrix[:, 2])

    def truths(self) -> tuple[Truth, Truth]:
        """Return the best truth, and the truth over the whole reference."""
        lattice = Truth.on_lattice(
            self.reference_to_input, image_size(self.reference), self.matrix[:, :2]
        )
        if self.check_points is None:
            return lattice, lattice
        points = read_check_points(self.check_points)
        return Truth(points[:, :2], points[:, 2:], self.matrix[:, :2]), lattice


def data_folder() -> Path:
    """Return the folder of the real image pairs: $GROUNDTIE_DATA or ../shared/data."""
    default = Path(__file__).resolve().parents[2] / "shared" / "data"
    return Path(os.environ.get("GROUNDTIE_DATA") or default)


def read_cases(folder: Path, kinds: Collection[str] = KINDS) -> tuple[RealCase, ...]:
    """Return a folder's cases of some kinds; by default, those neither rotated nor with RPCs."""
    listed = json.loads((folder / "cases.json").read_text(encoding="utf-8"))
    return tuple(_case(folder, values) for values in listed if values["kind"] in kinds)


def _case(folder: Path, values: dict[str, Any]) -> RealCase:
    truth = values["truth"]
    reference, points = folder / values["reference"], truth.get("check_points")
    return RealCase(
        values["id"],
        values["kind"],
        reference,
        folder / values["input"],
        float(truth["sigma_px"]),
        np.array(truth["reference_to_input"], float),
        None if points is None else reference.parent / points,
    )


def draw_shift(case: RealCase, largest_px: float, number: int) -> tuple[float, float]:
    """Return a shift (columns, rows) in reference pixels, each within ± `largest_px`."""
    generator = np.random.default_rng((zlib.crc32(case.name.encode()), number))
    dx, dy = generator.uniform(-largest_px, largest_px, 2)
    return float(dx), float(dy)


def search_radius_m(largest_px: float) -> float:
    """Return the search radius for shifts whose components are within ± `largest_px`."""
    return float(largest_px * np.sqrt(2) + 1)


def write_case(case: RealCase, shift_px: tuple[float, float], folder: Path) -> Pair:
    """Write a case as a georeferenced pair.

    The input's geotransform combines the linear part of the truth with a wrong shift: it puts
    every pixel `shift_px` (columns, rows) reference pixels off its place.
    """
    to_input = Affine(*case.matrix.ravel())
    shift = Affine.translation(*shift_px)
    claimed = compose(REFERENCE_TRANSFORM, _TO_CENTRE, shift, ~to_input, ~_TO_CENTRE)
    truth, lattice = case.truths()
    return Pair(
        write_image(read_image(case.reference), REFERENCE_TRANSFORM, folder / "reference.tif"),
        write_image(read_image(case.input), claimed, folder / "input.tif"),
        truth,
        lattice,
        case.sigma_px,
    )


def image_size(path: Path) -> tuple[int, int]:
    """Return columns and rows of an image."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        with rasterio.open(path) as source:
            return source.width, source.height


def read_image(path: Path) -> NDArray[Any]:
    """Return all bands, shape (bands, rows, columns); the files' palettes are plain grey."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        with rasterio.open(path) as source:
            return np.asarray(source.read())


def write_image(
    image: NDArray[Any],
    transform: Affine | None,
    path: Path,
    crs: Any = CRS,
    nodata: float | None = None,
) -> Path:
    """Write georeferenced bands; three or four bands of bytes become RGB and RGBA."""
    bands, height, width = image.shape
    with rasterio.open(
        path,
        "w",
        driver="GTiff",
        count=bands,
        height=height,
        width=width,
        dtype=image.dtype,
        crs=crs,
        transform=transform,
        nodata=nodata,
    ) as target:
        target.write(image)
    return path


def read_check_points(path: Path) -> FloatArray:
    """Return reference col, row and input col, row of a table of check points, shape (n, 4)."""
    columns = ("reference_col", "reference_row", "input_col", "input_row")
    with path.open(newline="", encoding="utf-8") as file:
        return np.array([[float(row[name]) for name in columns] for row in csv.DictReader(file)])
