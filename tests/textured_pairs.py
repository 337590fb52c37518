"""Pairs of images of one texture, opposite in contrast, with an exactly known misregistration."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import rasterio
from numpy.typing import ArrayLike, NDArray
from raster_files import utm_grid, write_raster
from scipy.ndimage import gaussian_filter, map_coordinates

from groundtie.geometry.models import Frame, Model, PolynomialModel
from groundtie.geometry.transform import Transform
from groundtie.rasters.grid import Grid
from groundtie.rasters.pair import Image, ImagePair, make_pair
from groundtie.rasters.reading import open_raster

FloatArray = NDArray[np.float64]

# The texture goes on beyond the reference by this, in reference pixels.
_MARGIN_PX = 40


def texture(height: int, width: int, seed: int = 0) -> FloatArray:
    """Return a random texture of fine and coarse detail, mean 0 and standard deviation 1."""
    rng = np.random.default_rng(seed)
    total = np.zeros((height, width))
    for sigma in (1.5, 6.0):
        layer = gaussian_filter(rng.normal(size=(height, width)), sigma)
        total += layer / layer.std()
    return total / total.std()


def shift_on_map(dx: float, dy: float) -> Model:
    """Return the misregistration of a shift, in map units."""
    return PolynomialModel("translation", Frame.around(np.zeros((1, 2))), np.array([[dx, dy]]))


@dataclass(frozen=True)
class TexturedPair:
    """Files of a pair, what the reference shows, and the truth between them."""

    reference: Path
    input: Path
    reference_values: NDArray[np.uint16]
    truth: Transform

    @property
    def grid(self) -> Grid:
        """The reference's grid."""
        return utm_grid(*self.reference_values.shape[::-1])

    @contextmanager
    def opened(self) -> Iterator[ImagePair]:
        with open_raster(self.reference) as reference, open_raster(self.input) as input:
            yield make_pair(Image(reference), Image(input))


@dataclass(frozen=True)
class HoledGrid(Grid):
    """A grid some of whose map has no pixels, as ground of unknown height in an image with RPCs."""

    hole_xy: tuple[float, float] = (0.0, 0.0)
    radius: float = 40.0

    def map_to_pixel(self, xy: ArrayLike) -> FloatArray:
        """Return pixel positions; NaN in the hole."""
        px = super().map_to_pixel(xy)
        px[np.hypot(*(np.asarray(xy, float) - self.hole_xy).T) < self.radius] = np.nan
        return px


def with_hole_around(pair: ImagePair, px: ArrayLike) -> ImagePair:
    """Return a pair of `textured` whose input has a hole where a matching pixel's match lies."""
    x, y = pair.grid.pixel_to_map([px])[0]
    grid = pair.input.source.grid
    holed = HoledGrid(grid.transform, grid.crs, grid.width, grid.height, (x + 70.0, y - 45.0))
    return replace(pair, input=replace(pair.input, source=replace(pair.input.source, grid=holed)))


def write_textured_pair(
    folder: Path,
    size: tuple[int, int],
    model: Model,
    *,
    input_pixel_ratio: float = 1.0,
    input_grid: Grid | None = None,
    noise: float = 0.3,
    seed: int = 0,
    input_seed: int | None = None,
) -> TexturedPair:
    """Write a pair of which `model` is the misregistration, in metres; reference pixels are 10 m.

    The input claims `input_grid`, by default that of the reference in pixels `input_pixel_ratio`
    as large; `input_seed` makes it show another place.
    """
    width, height = size
    grid = utm_grid(width, height)
    truth = Transform(model, grid.crs, input_grid or grid.scaled(input_pixel_ratio))
    rng = np.random.default_rng(seed + 1000)
    canvas = texture(height + 2 * _MARGIN_PX, width + 2 * _MARGIN_PX, seed)
    shown = canvas[_MARGIN_PX:-_MARGIN_PX, _MARGIN_PX:-_MARGIN_PX]
    reference = 1000 + 200 * (shown + noise * rng.normal(size=shown.shape))
    if input_seed is not None:
        canvas = texture(*canvas.shape, input_seed)
    own = truth.input_grid
    px = np.stack(np.meshgrid(np.arange(own.width), np.arange(own.height)), -1).reshape(-1, 2)
    ground = grid.map_to_pixel(truth.inverse(px)) + _MARGIN_PX
    seen = map_coordinates(canvas, ground[:, ::-1].T, mode="nearest").reshape(own.height, own.width)
    input = 2000 - 300 * (seen + noise * rng.normal(size=seen.shape))
    paths = folder / "reference.tif", folder / "input.tif"
    values = [np.clip(image, 1, 65_535).astype(np.uint16) for image in (reference, input)]
    for path, image, place in zip(paths, values, (grid, own), strict=True):
        write_raster(path, image, place)
    return TexturedPair(*paths, values[0], truth)


def rms(errors: FloatArray) -> float:
    """Return the root mean square length of vectors, shape (n, 2)."""
    return float(np.sqrt((errors**2).sum(axis=1).mean()))


def everywhere(grid: Grid, inset: int = 25) -> FloatArray:
    """Return map positions on a lattice over a grid, shape (64, 2)."""
    cols = np.linspace(inset, grid.width - 1 - inset, 8)
    rows = np.linspace(inset, grid.height - 1 - inset, 8)
    return grid.pixel_to_map(np.stack(np.meshgrid(cols, rows), -1).reshape(-1, 2))


def error_m(model: Model, pair: TexturedPair) -> float:
    """Return the root mean square error of a misregistration over the reference, in metres."""
    xy = everywhere(pair.grid)
    return rms(model(xy) - pair.truth.model(xy))


def error_px(transform: Transform, pair: TexturedPair) -> float:
    """Return the root mean square error of a transform over the reference, in input pixels."""
    xy = everywhere(pair.grid)
    return rms(transform(xy) - pair.truth(xy))


def pixels(path: Path) -> NDArray[Any]:
    """Return all bands of a raster, shape (bands, h, w)."""
    with rasterio.open(path) as raster:
        return raster.read()


def listing(folder: Path) -> dict[str, tuple[int, int]]:
    """Return all files of a folder with size and time of their last change."""
    return {
        str(path.relative_to(folder)): (path.stat().st_size, path.stat().st_mtime_ns)
        for path in sorted(folder.rglob("*"))
    }


def rewritten(pair: TexturedPair, folder: Path, **changed: Any) -> TexturedPair:
    """Write changed images: `reference` and `input` take the pixels and return others.

    They return values, or values and options for `write_raster`, among which `grid`.
    """
    paths = {}
    for name in ("reference", "input"):
        with rasterio.open(getattr(pair, name)) as raster:
            values = raster.read(1)
            grid = Grid(raster.transform, raster.crs, raster.width, raster.height)
        new = changed.get(name, lambda values: values)(values)
        values, more = new if isinstance(new, tuple) else (new, {})
        paths[name] = write_raster(folder / f"{name}.tif", values, **{"grid": grid, **more})
    return replace(pair, **paths)


class _OfASensor(Grid):
    """The pixels of an image in the geometry of its sensor."""


def of_a_sensor(image: Image) -> Image:
    """Return an image as one in the geometry of its sensor."""
    own = _OfASensor(**{one.name: getattr(image.source.grid, one.name) for one in fields(Grid)})
    return replace(image, source=replace(image.source, grid=own))
