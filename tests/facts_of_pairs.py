"""Small pairs that differ in what they are: fields or towns, with speckle or without."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import rasterio
from raster_files import utm_grid, write_raster

from groundtie.rasters.pair import Image, ImagePair, make_pair
from groundtie.rasters.radar_tags import SPECKLE_FILTER
from groundtie.rasters.reading import open_raster

SIZE = 400


def grey_values(bright_share: float, noise: float, seed: int = 0) -> np.ndarray:
    """Return grey values of 50, a share of them bright in squares, with relative noise."""
    random = np.random.default_rng(seed)
    chosen = random.permutation(400).reshape(20, 20) < 400 * bright_share
    squares = np.kron(chosen, np.ones((20, 20)))
    return (50 + 200 * squares) * (1 + noise * random.normal(size=(SIZE, SIZE)))


def speckled(bright_share: float) -> np.ndarray:
    """Return such grey values with speckle of one look."""
    random = np.random.default_rng(1)
    return grey_values(bright_share, 0.0) * np.sqrt(random.gamma(1, 1, (SIZE, SIZE)))


FIELDS, TOWN = grey_values(0.02, 0.01), grey_values(0.25, 0.01)


@contextmanager
def opened(
    folder: Path,
    reference: np.ndarray,
    input: np.ndarray,
    filtered: tuple[str, ...] = (),
    pixel_m: float | None = 1.0,
    has_crs: bool = True,
) -> Iterator[ImagePair]:
    """Open two images of grey values as a pair; metadata may name a speckle filter.

    Without a pixel size there is no georeferencing.
    """
    with ExitStack() as stack:
        images = []
        for name, values in (("reference", reference), ("input", input)):
            grid = None if pixel_m is None else utm_grid(*values.shape[::-1], pixel_m)
            if grid is not None and not has_crs:
                grid = replace(grid, crs=None)
            path = write_raster(folder / f"{name}.tif", values.astype(np.float32), grid)
            if name in filtered:
                with rasterio.open(path, "r+") as dataset:
                    dataset.update_tags(**{SPECKLE_FILTER: "a filter"})
            images.append(Image(stack.enter_context(open_raster(path))))
        yield make_pair(images[0], images[1])
