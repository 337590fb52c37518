"""Pairs on one grid, with the input resampled by the truth except for a known offset."""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from groundtie.rasters.grid import PointFunction, reproject
from groundtie.rasters.pair import Image, ImagePair
from groundtie.rasters.reading import open_raster

from .accuracy import FloatArray, Truth
from .attempt import Pair
from .cases import RealCase, write_case, write_image
from .simulations import Simulation

# With fewer check points in both images, the truth is taken from the lattice.
_LEAST_CHECK_POINTS = 4


@dataclass(frozen=True)
class Scene:
    """A pair of images with known truth, real or simulated."""

    source: RealCase | Simulation
    cache: Path

    @property
    def name(self) -> str:
        return self.source.name

    @property
    def group(self) -> str:
        simulated = isinstance(self.source, Simulation)
        return self.source.density if simulated else self.source.kind

    def pair(self, folder: Path) -> Pair:
        """Return the pair's files, written into a folder unless they are kept."""
        if isinstance(self.source, Simulation):
            return self.source.pair(self.cache)
        return write_case(self.source, (0.0, 0.0), folder)

    def offset_px(self, limits: tuple[float, float]) -> FloatArray:
        """Return a drawn offset (col, row) whose components lie between the limits in size."""
        generator = np.random.default_rng((zlib.crc32(self.name.encode()), int(limits[1])))
        return generator.uniform(*limits, 2) * generator.choice([-1.0, 1.0], 2)


@dataclass(frozen=True)
class OffsetPair:
    """A pair on the reference's grid, with the input resampled by the truth except for an offset.

    Parameters
    ----------
    images
        The images on the reference's own grid.
    matrix
        Affine truth, input (col, row) = matrix · reference (col, row, 1).
    offset_px
        Position (col, row) in the resampled input that shows the reference's pixel 0.
    """

    images: ImagePair
    matrix: FloatArray
    offset_px: FloatArray

    @property
    def to_input_px(self) -> PointFunction:
        """The function from map positions to input pixels."""
        grid = self.images.grid
        return lambda xy: apply_matrix(self.matrix, grid.map_to_pixel(xy) - self.offset_px)

    def nominal(self, to_px: PointFunction | None = None) -> PointFunction:
        """Return the model for matchers: the nominal positions of the content at `to_px`.

        By default, that is `to_input_px`.
        """
        to_input_px = self.to_input_px if to_px is None else to_px
        reference, input = self.images.grid, self.images.input.source.grid

        def nominal_xy(xy: FloatArray) -> FloatArray:
            return reproject(input.pixel_to_map(to_input_px(xy)), input.crs, reference.crs)

        return nominal_xy

    def offset_of(self, input_px: FloatArray) -> FloatArray:
        """Return the positions of input pixels in the resampled input."""
        linear, shift = self.matrix[:, :2], self.matrix[:, 2]
        return np.asarray((input_px - shift) @ np.linalg.inv(linear).T + self.offset_px)


@contextmanager
def open_offset(pair: Pair, offset_px: FloatArray) -> Iterator[OffsetPair]:
    """Open a pair with its input displaced by a known offset."""
    assert pair.lattice is not None
    with open_raster(pair.reference) as reference, open_raster(pair.input) as image:
        grid = reference.grid
        size = grid.width, grid.height
        images = ImagePair(Image(reference), Image(image), grid, size, grid)
        yield OffsetPair(images, affine_of(pair.lattice), offset_px)


def affine_of(truth: Truth) -> FloatArray:
    """Return the affine matrix, shape (2, 3), that is nearest to a truth."""
    design = np.column_stack([truth.reference_px, np.ones(len(truth.reference_px))])
    return np.linalg.lstsq(design, truth.input_px, rcond=None)[0].T


def apply_matrix(matrix: FloatArray, px: FloatArray) -> FloatArray:
    return np.asarray(px @ matrix[:, :2].T + matrix[:, 2])


def write_offset(pair: Pair, offset_px: FloatArray, folder: Path) -> Pair:
    """Write both images on one grid, the input displaced by a known shift, cropped to common data.

    Every program gets the same files, including those without georeferencing or masks.
    """
    assert pair.truth is not None
    with open_offset(pair, offset_px) as off:
        grid = off.images.grid
        patches = [
            off.images.reference_patch(grid),
            off.images.input_patch(grid, off.to_input_px),
        ]
        col, row, width, height = valid_box(patches[0].valid & patches[1].valid)
        inside = slice(row, row + height), slice(col, col + width)
        transform = grid.window(col, row, width, height).transform
        paths = [
            write_image(
                np.where(patch.valid, patch.values, 0)[inside][None],
                transform,
                folder / f"{name}_cut.tif",
            )
            for patch, name in zip(patches, ("reference", "input"), strict=True)
        ]
        corner = np.array([col, row])
        truth = Truth(
            pair.truth.reference_px - corner,
            off.offset_of(pair.truth.input_px) - corner,
            np.eye(2),
        )
    lattice = Truth.on_lattice(lambda px: px + offset_px, (width, height), np.eye(2))
    seen = np.all((truth.reference_px >= 0) & (truth.reference_px < (width, height)), axis=1)
    is_lattice = pair.truth is pair.lattice or seen.sum() < _LEAST_CHECK_POINTS
    checked = Truth(truth.reference_px[seen], truth.input_px[seen], np.eye(2))
    return Pair(*paths, lattice if is_lattice else checked, lattice, pair.sigma_px)


def valid_box(valid: NDArray[np.bool_]) -> tuple[int, int, int, int]:
    """Return column, row, width and height of a box whose border has no invalid pixels.

    The side with most invalid pixels moves inwards until none are left.
    """
    top, left, (bottom, right) = 0, 0, valid.shape
    while top < bottom and left < right:
        box = ~valid[top:bottom, left:right]
        shares = [line.mean() for line in (box[0], box[-1], box[:, 0], box[:, -1])]
        worst = int(np.argmax(shares))
        if shares[worst] == 0:
            break
        top, bottom = top + (worst == 0), bottom - (worst == 1)
        left, right = left + (worst == 2), right - (worst == 3)
    return left, top, right - left, bottom - top
